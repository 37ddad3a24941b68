#include "daemon/local/packet.h"

#include <google/protobuf/stubs/logging.h>
#include <sys/socket.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <utility>

#include "absl/strings/str_cat.h"
#include "voxeld/v1/local.pb.h"

namespace voxeld::daemon::local {
namespace {

void TakeDescriptors(msghdr& header, Packet* out) {
  for (cmsghdr* at = CMSG_FIRSTHDR(&header); at != nullptr; at = CMSG_NXTHDR(&header, at)) {
    if (at->cmsg_level != SOL_SOCKET || at->cmsg_type != SCM_RIGHTS) continue;
    const size_t count = (at->cmsg_len - CMSG_LEN(0)) / sizeof(int);
    for (size_t i = 0; i < count; ++i) {
      int fd = -1;
      std::memcpy(&fd, CMSG_DATA(at) + i * sizeof(int), sizeof(int));
      out->descriptors.emplace_back(fd);
    }
  }
}

std::string Bytes(const v1::LocalAnswer& answer) { return answer.SerializeAsString(); }

}  // namespace

Packet Receive(int socket, size_t room) {
  std::array<char, kGreatestPacket> buffer;
  alignas(cmsghdr) std::array<char, CMSG_SPACE(kDescriptors * sizeof(int))> control = {};
  iovec bytes = {buffer.data(), buffer.size()};
  msghdr header = {};
  header.msg_iov = &bytes;
  header.msg_iovlen = 1;
  if (room > 0) {
    header.msg_control = control.data();
    header.msg_controllen = CMSG_SPACE(room * sizeof(int));
  }
  ssize_t got = 0;
  while ((got = recvmsg(socket, &header, MSG_CMSG_CLOEXEC | MSG_DONTWAIT)) < 0 && errno == EINTR) {
  }
  Packet packet;
  if (got < 0) {
    const bool later =
        errno == EAGAIN || errno == EWOULDBLOCK || errno == ENOBUFS || errno == ENOMEM;
    packet.what = later ? Packet::What::kNothing : Packet::What::kEnd;
    return packet;
  }
  TakeDescriptors(header, &packet);
  packet.what = got == 0 ? Packet::What::kEnd : Packet::What::kPacket;
  packet.bytes.assign(buffer.data(), static_cast<size_t>(got));
  packet.truncated = (header.msg_flags & MSG_TRUNC) != 0;
  const bool cut = (header.msg_flags & MSG_CTRUNC) != 0;
  packet.more_descriptors = cut && packet.descriptors.size() >= room;
  packet.descriptors_lost = cut && !packet.more_descriptors;
  return packet;
}

absl::StatusOr<Message> ParseMessage(const Packet& packet) {
  if (packet.truncated) {
    return absl::InvalidArgumentError(
        absl::StrCat("a packet of more than ", kGreatestPacket, " bytes; that is the most"));
  }
  v1::LocalMessage parsed;
  const google::protobuf::LogSilencer silence;
  if (!parsed.ParseFromString(packet.bytes)) {
    return absl::InvalidArgumentError(absl::StrCat("a packet of ", packet.bytes.size(),
                                                   " bytes is not a voxeld.v1.LocalMessage"));
  }
  Message message;
  switch (parsed.what_case()) {
    case v1::LocalMessage::kHello:
      message.what = Message::What::kHello;
      message.token = std::move(*parsed.mutable_hello()->mutable_token());
      return message;
    case v1::LocalMessage::kMemory:
      message.what = Message::What::kMemory;
      message.id = parsed.memory().id();
      message.size = parsed.memory().size();
      return message;
    case v1::LocalMessage::kRelease:
      message.what = Message::What::kRelease;
      message.id = parsed.release().id();
      return message;
    case v1::LocalMessage::WHAT_NOT_SET:
      break;
  }
  return absl::InvalidArgumentError(
      "a LocalMessage that says nothing this version of the server knows; send hello, memory or "
      "release");
}

std::string Welcome(uint32_t max_memories, uint64_t max_bytes) {
  v1::LocalAnswer answer;
  answer.mutable_welcome()->set_max_memories(max_memories);
  answer.mutable_welcome()->set_max_bytes(max_bytes);
  return Bytes(answer);
}

std::string Held(uint64_t id) {
  v1::LocalAnswer answer;
  answer.mutable_held()->set_id(id);
  return Bytes(answer);
}

std::string Released(uint64_t id) {
  v1::LocalAnswer answer;
  answer.mutable_released()->set_id(id);
  return Bytes(answer);
}

std::string Refused(uint64_t id, std::string_view message) {
  v1::LocalAnswer answer;
  answer.mutable_refused()->set_id(id);
  answer.mutable_refused()->set_message(std::string(message));
  return Bytes(answer);
}

}  // namespace voxeld::daemon::local
