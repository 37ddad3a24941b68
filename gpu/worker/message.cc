#include "gpu/worker/message.h"

#include <sys/socket.h>
#include <unistd.h>

#include <cerrno>
#include <iterator>
#include <system_error>

#include "absl/strings/str_cat.h"

namespace voxeld::gpu {
namespace {

constexpr size_t kMostBody = 4096;

struct Header {
  MessageType type;
  uint32_t reserved;
  uint64_t call;
};

}  // namespace

Message MakeDone(uint64_t call, const absl::Status& status) {
  const absl::string_view text = status.message().substr(0, 2048);
  return MakeMessage(MessageType::kDone, call, DoneMessage{static_cast<int32_t>(status.code())},
                     {text.data(), text.size()});
}

absl::Status StatusOf(const Message& done) {
  const auto body = done.As<DoneMessage>();
  if (!body.has_value()) return absl::DataLossError("the worker's answer is too short");
  return absl::Status(
      static_cast<absl::StatusCode>(body->code),
      absl::string_view(reinterpret_cast<const char*>(done.body.data()) + sizeof(DoneMessage),
                        done.body.size() - sizeof(DoneMessage)));
}

absl::Status SendMessage(int socket, const Message& message) {
  const Header header{message.type, 0, message.call};
  iovec parts[] = {{const_cast<Header*>(&header), sizeof(header)},
                   {const_cast<std::byte*>(message.body.data()), message.body.size()}};
  msghdr out = {};
  out.msg_iov = parts;
  out.msg_iovlen = std::size(parts);
  alignas(cmsghdr) char control[CMSG_SPACE(sizeof(int))] = {};
  if (message.fd >= 0) {
    out.msg_control = control;
    out.msg_controllen = sizeof(control);
    cmsghdr* rights = CMSG_FIRSTHDR(&out);
    rights->cmsg_level = SOL_SOCKET;
    rights->cmsg_type = SCM_RIGHTS;
    rights->cmsg_len = CMSG_LEN(sizeof(int));
    std::memcpy(CMSG_DATA(rights), &message.fd, sizeof(int));
  }
  if (TEMP_FAILURE_RETRY(sendmsg(socket, &out, MSG_NOSIGNAL)) >= 0) return absl::OkStatus();
  if (errno == EAGAIN) {
    return absl::ResourceExhaustedError("the other process does not read");
  }
  return absl::UnavailableError(
      absl::StrCat("the other process is gone: ", std::generic_category().message(errno)));
}

absl::StatusOr<Message> ReceiveMessage(int socket) {
  Header header;
  Message message;
  message.body.resize(kMostBody);
  iovec parts[] = {{&header, sizeof(header)}, {message.body.data(), message.body.size()}};
  msghdr in = {};
  in.msg_iov = parts;
  in.msg_iovlen = std::size(parts);
  alignas(cmsghdr) char control[CMSG_SPACE(sizeof(int))] = {};
  in.msg_control = control;
  in.msg_controllen = CMSG_LEN(sizeof(int));  // with its padding, a second one would fit
  const ssize_t got = TEMP_FAILURE_RETRY(recvmsg(socket, &in, MSG_CMSG_CLOEXEC));
  for (cmsghdr* c = got < 0 ? nullptr : CMSG_FIRSTHDR(&in); c != nullptr; c = CMSG_NXTHDR(&in, c)) {
    if (c->cmsg_level == SOL_SOCKET && c->cmsg_type == SCM_RIGHTS) {
      std::memcpy(&message.fd, CMSG_DATA(c), sizeof(int));
    }
  }
  if (got < static_cast<ssize_t>(sizeof(header)) || (in.msg_flags & MSG_TRUNC) != 0) {
    if (message.fd >= 0) close(message.fd);
    return absl::UnavailableError("the other process has ended");
  }
  message.type = header.type;
  message.call = header.call;
  message.body.resize(static_cast<size_t>(got) - sizeof(header));
  return message;
}

}  // namespace voxeld::gpu
