#include "tools/bench/voxel_bench/local_socket.h"

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <sys/un.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>

#include "absl/cleanup/cleanup.h"
#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "voxeld/v1/local.pb.h"

namespace voxeld::bench {
namespace {

constexpr int kAnswerSeconds = 10;
constexpr size_t kGreatestPacket = 4096;

// Returns a memfd that contains the bytes and is sealed against changes.
absl::StatusOr<int> SealedMemory(std::string_view bytes) {
  const int fd = memfd_create("voxel-bench", MFD_CLOEXEC | MFD_ALLOW_SEALING);
  if (fd < 0) return absl::ErrnoToStatus(errno, "no memfd");
  absl::Cleanup close_fd = [fd] { close(fd); };
  if (ftruncate(fd, static_cast<off_t>(bytes.size())) != 0) {
    return absl::ErrnoToStatus(errno, absl::StrCat("no memfd of ", bytes.size(), " bytes"));
  }
  // The memory is written and not mapped: pages that are written completely are neither cleared
  // first nor faulted in one by one.
  for (size_t done = 0; done < bytes.size();) {
    const ssize_t written =
        pwrite(fd, bytes.data() + done, bytes.size() - done, static_cast<off_t>(done));
    if (written < 0 && errno == EINTR) continue;
    if (written <= 0) return absl::ErrnoToStatus(errno, "a memfd cannot be written");
    done += static_cast<size_t>(written);
  }
  if (fcntl(fd, F_ADD_SEALS, F_SEAL_SHRINK | F_SEAL_GROW | F_SEAL_WRITE) != 0) {
    return absl::ErrnoToStatus(errno, "a memfd cannot be sealed");
  }
  std::move(close_fd).Cancel();
  return fd;
}

}  // namespace

absl::StatusOr<std::unique_ptr<LocalSocket>> LocalSocket::Connect(const std::string& path,
                                                                  const std::string& token) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  if (path.size() >= sizeof(address.sun_path)) {
    return absl::InvalidArgumentError(absl::StrCat(path, " is too long for a socket"));
  }
  path.copy(address.sun_path, path.size());
  const int fd = socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0);
  if (fd < 0) return absl::ErrnoToStatus(errno, "no socket");
  std::unique_ptr<LocalSocket> out(new LocalSocket(fd));
  const timeval limit{.tv_sec = kAnswerSeconds, .tv_usec = 0};
  setsockopt(fd, SOL_SOCKET, SO_RCVTIMEO, &limit, sizeof(limit));
  if (connect(fd, reinterpret_cast<const sockaddr*>(&address), sizeof(address)) != 0) {
    return absl::ErrnoToStatus(errno, path);
  }
  v1::LocalMessage hello;
  hello.mutable_hello()->set_token(token);
  if (absl::Status said = out->Say(hello.SerializeAsString(), -1); !said.ok()) return said;
  if (absl::Status answered = out->Answered(); !answered.ok()) return answered;
  return out;
}

LocalSocket::~LocalSocket() { close(fd_); }

absl::Status LocalSocket::Hold(uint64_t id, std::string_view bytes) {
  const absl::StatusOr<int> memory = SealedMemory(bytes);
  if (!memory.ok()) return memory.status();
  const absl::Cleanup close_memory = [&memory] { close(*memory); };
  v1::LocalMessage message;
  message.mutable_memory()->set_id(id);
  message.mutable_memory()->set_size(bytes.size());
  if (absl::Status said = Say(message.SerializeAsString(), *memory); !said.ok()) return said;
  return Answered();
}

absl::Status LocalSocket::Release(uint64_t id) {
  v1::LocalMessage message;
  message.mutable_release()->set_id(id);
  return Say(message.SerializeAsString(), -1);
}

absl::Status LocalSocket::Say(const std::string& packet, int descriptor) {
  iovec bytes{.iov_base = const_cast<char*>(packet.data()), .iov_len = packet.size()};
  alignas(cmsghdr) std::array<char, CMSG_SPACE(sizeof(int))> control{};
  msghdr message{};
  message.msg_iov = &bytes;
  message.msg_iovlen = 1;
  if (descriptor >= 0) {
    message.msg_control = control.data();
    message.msg_controllen = control.size();
    cmsghdr* const head = CMSG_FIRSTHDR(&message);
    head->cmsg_level = SOL_SOCKET;
    head->cmsg_type = SCM_RIGHTS;
    head->cmsg_len = CMSG_LEN(sizeof(int));
    std::memcpy(CMSG_DATA(head), &descriptor, sizeof(int));
  }
  if (sendmsg(fd_, &message, MSG_NOSIGNAL) < 0) {
    return absl::ErrnoToStatus(errno, "the local socket takes nothing");
  }
  ++unanswered_;
  return absl::OkStatus();
}

absl::Status LocalSocket::Answered() {
  for (; unanswered_ > 0; --unanswered_) {
    std::array<char, kGreatestPacket> answer;
    ssize_t size = 0;
    do {
      size = recv(fd_, answer.data(), answer.size(), 0);
    } while (size < 0 && errno == EINTR);
    if (size <= 0) {
      return absl::ErrnoToStatus(size == 0 ? ECONNRESET : errno, "the local socket gave no answer");
    }
    v1::LocalAnswer parsed;
    if (!parsed.ParseFromArray(answer.data(), static_cast<int>(size))) {
      return absl::DataLossError("an answer that is no LocalAnswer");
    }
    if (parsed.has_refused()) {
      return absl::FailedPreconditionError(
          absl::StrCat("the local socket refused: ", parsed.refused().message()));
    }
  }
  return absl::OkStatus();
}

}  // namespace voxeld::bench
