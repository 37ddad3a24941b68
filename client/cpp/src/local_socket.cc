#include "client/cpp/src/local_socket.h"

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <sys/un.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <deque>
#include <map>
#include <optional>
#include <thread>
#include <utility>

#include "display/sync/mutex.h"
#include "voxeld/v1/local.pb.h"

namespace voxeld::client {
namespace {

constexpr timeval kAnswerLimit{.tv_sec = 2, .tv_usec = 0};
constexpr size_t kGreatestPacket = 4096;

class Descriptor {
 public:
  explicit Descriptor(int fd) : fd_(fd) {}
  ~Descriptor() {
    if (fd_ >= 0) close(fd_);
  }
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;
  int get() const { return fd_; }

 private:
  const int fd_;
};

// Writes instead of mapping: out of memory would raise a signal there, and is an error here.
bool WriteWhole(int fd, std::string_view bytes) {
  while (!bytes.empty()) {
    const ssize_t written = write(fd, bytes.data(), bytes.size());
    if (written < 0 && errno == EINTR) continue;
    if (written <= 0) return false;
    bytes.remove_prefix(static_cast<size_t>(written));
  }
  return true;
}

bool FillAndSeal(int fd, const Rope& content) {
  if (fd < 0 || !WriteWhole(fd, content.head())) return false;
  for (const Rope::Chunk& chunk : content.tail()) {
    if (!WriteWhole(fd, chunk.bytes())) return false;
  }
  return fcntl(fd, F_ADD_SEALS, F_SEAL_SHRINK | F_SEAL_GROW | F_SEAL_WRITE) == 0;
}

class LocalSocket final : public MemoryChannel {
 public:
  LocalSocket(std::string path, std::string token, Events* events)
      : path_(std::move(path)),
        token_(std::move(token)),
        events_(events),
        socket_(socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0)),
        thread_([this] { Run(); }) {}

  ~LocalSocket() override {
    {
      sync::MutexLock lock(mutex_);
      stop_ = true;
      changed_.NotifyAll();
    }
    shutdown(socket_.get(), SHUT_RDWR);  // nobody waits for an answer now
    thread_.join();
  }

  void Hold(uint64_t id, Rope content) override { Add({id, std::move(content)}); }
  void Release(uint64_t id) override { Add({id, std::nullopt}); }

 private:
  struct Job {
    uint64_t id = 0;
    std::optional<Rope> content;  // empty: release it
  };

  void Add(Job job) {
    sync::MutexLock lock(mutex_);
    jobs_.push_back(std::move(job));
    changed_.NotifyAll();
  }

  std::optional<Job> Next() {
    sync::MutexLock lock(mutex_);
    while (!stop_ && jobs_.empty()) changed_.Wait(mutex_);
    if (stop_) return std::nullopt;
    Job job = std::move(jobs_.front());
    jobs_.pop_front();
    return job;
  }

  void Run() {
    gone_ = !Connect();
    while (const std::optional<Job> job = Next()) {
      if (job->content) {
        events_->OnHold(job->id, HoldNow(job->id, *job->content));
      } else if (!gone_) {
        ReleaseNow(job->id);
      }
    }
  }

  bool Connect() {
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    if (socket_.get() < 0 || path_.size() >= sizeof(address.sun_path)) return false;
    path_.copy(address.sun_path, path_.size());
    for (const int option : {SO_RCVTIMEO, SO_SNDTIMEO})
      setsockopt(socket_.get(), SOL_SOCKET, option, &kAnswerLimit, sizeof kAnswerLimit);
    if (connect(socket_.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0)
      return false;
    v1::LocalMessage hello;
    hello.mutable_hello()->set_token(token_);
    const std::optional<v1::LocalAnswer> answer = Ask(hello, -1);
    if (!answer || !answer->has_welcome()) return false;
    max_memories_ = answer->welcome().max_memories();
    max_bytes_ = answer->welcome().max_bytes();
    return true;
  }

  Answer HoldNow(uint64_t id, const Rope& content) {
    if (gone_) return Answer::kGone;
    if (held_.size() >= max_memories_ || content.size() > max_bytes_ - held_bytes_)
      return Answer::kNoRoom;
    const Descriptor memory(memfd_create("voxeld-client", MFD_CLOEXEC | MFD_ALLOW_SEALING));
    if (!FillAndSeal(memory.get(), content)) return Answer::kRefused;
    v1::LocalMessage message;
    message.mutable_memory()->set_id(id);
    message.mutable_memory()->set_size(content.size());
    const std::optional<v1::LocalAnswer> answer = Ask(message, memory.get());
    if (!answer) return Answer::kGone;
    if (!answer->has_held() || answer->held().id() != id) return Answer::kRefused;
    held_.emplace(id, content.size());
    held_bytes_ += content.size();
    return Answer::kHeld;
  }

  void ReleaseNow(uint64_t id) {
    const auto it = held_.find(id);
    if (it == held_.end()) return;
    v1::LocalMessage message;
    message.mutable_release()->set_id(id);
    if (!Ask(message, -1)) return;
    held_bytes_ -= it->second;
    held_.erase(it);
  }

  // Sends the message, with a descriptor if that is not negative, and waits for the answer. Returns
  // nothing if the connection has become unusable.
  std::optional<v1::LocalAnswer> Ask(const v1::LocalMessage& asked, int descriptor) {
    std::optional<v1::LocalAnswer> answer = Exchange(asked.SerializeAsString(), descriptor);
    gone_ = gone_ || !answer;
    return answer;
  }

  std::optional<v1::LocalAnswer> Exchange(const std::string& packet, int descriptor) {
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
    ssize_t size = 0;
    do {
      size = sendmsg(socket_.get(), &message, MSG_NOSIGNAL);
    } while (size < 0 && errno == EINTR);
    if (size < 0) return std::nullopt;
    std::array<char, kGreatestPacket> received;
    do {
      size = recv(socket_.get(), received.data(), received.size(), 0);
    } while (size < 0 && errno == EINTR);
    v1::LocalAnswer answer;
    if (size <= 0 || !answer.ParseFromArray(received.data(), static_cast<int>(size)))
      return std::nullopt;
    return answer;
  }

  const std::string path_, token_;
  Events* const events_;
  const Descriptor socket_;
  sync::Mutex mutex_;
  sync::CondVar changed_;
  bool stop_ VOXELD_GUARDED_BY(mutex_) = false;
  std::deque<Job> jobs_ VOXELD_GUARDED_BY(mutex_);
  // The following members are used by the thread only.
  bool gone_ = false;
  uint64_t max_memories_ = 0, max_bytes_ = 0, held_bytes_ = 0;
  std::map<uint64_t, uint64_t> held_;  // id → bytes
  std::thread thread_;                 // last: it uses the others
};

}  // namespace

std::unique_ptr<MemoryChannel> ConnectLocalSocket(std::string path, std::string token,
                                                  MemoryChannel::Events* events) {
  return std::make_unique<LocalSocket>(std::move(path), std::move(token), events);
}

}  // namespace voxeld::client
