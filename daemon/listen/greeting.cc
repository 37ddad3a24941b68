#include "daemon/listen/greeting.h"

#include <algorithm>
#include <utility>

#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"

namespace voxeld::daemon::listen {
namespace {

constexpr std::string_view kPreface = "PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n";
constexpr size_t kHeadBytes = 9;
constexpr uint8_t kData = 0, kHeaders = 1, kReset = 3, kSettings = 4, kContinuation = 9;
constexpr uint8_t kAck = 1, kEndStream = 1, kEndHeaders = 4, kPadded = 8;
constexpr size_t kPrefixBytes = 5;  // a gRPC message's prefix: compressed flag and length
constexpr size_t kShownBytes = 16;

uint32_t BigEndian(std::string_view bytes) {
  uint32_t out = 0;
  for (const char byte : bytes) out = out << 8 | static_cast<uint8_t>(byte);
  return out;
}

}  // namespace

Greeting::Verdict Greeting::Read(std::string_view received) {
  received = received.substr(0, kMostBytes);
  if (at_ == 0) {
    const size_t some = std::min(received.size(), kPreface.size());
    if (received.substr(0, some) != kPreface.substr(0, some)) {
      const std::string_view shown = received.substr(0, kShownBytes);
      return Wrong(absl::StrCat("it begins with \"", absl::CHexEscape({shown.data(), shown.size()}),
                                "\"; this address speaks HTTP/2 without TLS"));
    }
    if (some < kPreface.size()) return Await(kPreface.size());
    at_ = kPreface.size();
  }
  for (;;) {
    if (received.size() < at_ + kHeadBytes) return Await(at_ + kHeadBytes);
    const Head head = {.size = BigEndian(received.substr(at_, 3)),
                       .type = static_cast<uint8_t>(received[at_ + 3]),
                       .flags = static_cast<uint8_t>(received[at_ + 4]),
                       .stream = BigEndian(received.substr(at_ + 5, 4)) & 0x7fff'ffff};
    const size_t before = at_;
    const Verdict verdict = ReadFrame(received, head);
    if (verdict != Verdict::kMore || at_ == before) return verdict;
  }
}

Greeting::Verdict Greeting::ReadTls(std::string_view received) {
  constexpr std::string_view kHandshake("\x16\x03", 2);  // version 3.x, as in all versions of TLS
  constexpr size_t kRecordHead = 5, kHelloHead = 4;
  constexpr char kClientHello = 1;
  received = received.substr(0, kMostBytes);
  const size_t some = std::min(received.size(), kHandshake.size());
  if (received.substr(0, some) != kHandshake.substr(0, some)) {
    const std::string_view shown = received.substr(0, kShownBytes);
    return Wrong(absl::StrCat("it begins with \"", absl::CHexEscape({shown.data(), shown.size()}),
                              "\"; this address speaks TLS"));
  }
  if (received.size() < kRecordHead + kHelloHead) return Await(kRecordHead + kHelloHead);
  const size_t record = BigEndian(received.substr(3, 2));
  const size_t hello = BigEndian(received.substr(kRecordHead + 1, 3));
  if (received[kRecordHead] != kClientHello || hello + kHelloHead != record) {
    return Wrong("its first record is no whole ClientHello");
  }
  if (received.size() < kRecordHead + record) return Await(kRecordHead + record);
  return Verdict::kCall;
}

Greeting::Verdict Greeting::ReadFrame(std::string_view received, const Head& head) {
  if (!settings_ && (head.type != kSettings || (head.flags & kAck) != 0)) {
    return Wrong(absl::StrCat("its first frame is of type ", head.type, "; SETTINGS come first"));
  }
  settings_ = true;
  if (head.type == kData) return ReadData(received, head);
  const size_t end = at_ + kHeadBytes + head.size;
  if (received.size() < end) return Await(end);
  switch (head.type) {
    case kHeaders:
      if ((head.flags & kEndHeaders) == 0) {
        return Wrong("the headers of its first call go on in further frames; give them in one");
      }
      if ((head.flags & kEndStream) != 0) return Verdict::kCall;  // gRPC reports what is missing
      prefixes_[head.stream];
      break;
    case kContinuation:
      return Wrong("CONTINUATION comes without headers that go on");
    case kReset:
      prefixes_.erase(head.stream);
      break;
    default:
      break;
  }
  at_ = end;
  return Verdict::kMore;
}

Greeting::Verdict Greeting::ReadData(std::string_view received, const Head& head) {
  const auto stream = prefixes_.find(head.stream);
  if (stream == prefixes_.end()) {
    return Wrong(absl::StrCat("DATA comes for stream ", head.stream, ", which has no headers"));
  }
  const size_t end = at_ + kHeadBytes + head.size;
  size_t begin = at_ + kHeadBytes, padding = 0;
  if ((head.flags & kPadded) != 0) {
    if (received.size() <= begin) return Await(begin + 1);
    padding = static_cast<uint8_t>(received[begin++]);
    if (begin + padding > end) return Wrong("DATA has more padding than it is long");
  }
  // Waits only for the message's length, because the message may be long.
  const size_t wanted = std::min(kPrefixBytes - stream->second.size(), end - padding - begin);
  if (received.size() < begin + wanted) return Await(begin + wanted);
  stream->second.append(received.substr(begin, wanted));
  if (stream->second.size() == kPrefixBytes) {
    const uint32_t size = BigEndian(std::string_view(stream->second).substr(1));
    if (size <= most_message_) return Verdict::kCall;
    return Wrong(
        absl::StrCat("the first message of its first call has ", size,
                     " bytes; a client's first call is at most ", most_message_ >> 10,
                     " KiB in all, and on a stream it sends nothing but Open before Opened"));
  }
  if ((head.flags & kEndStream) != 0) return Verdict::kCall;
  at_ = end;  // including padding that may not have arrived yet
  return Verdict::kMore;
}

Greeting::Verdict Greeting::Await(size_t bytes) {
  if (bytes > kMostBytes) {
    return Wrong(absl::StrCat("its first call's first message does not begin within ", kMostBytes,
                              " bytes; headers of a first call are shorter"));
  }
  needed_ = bytes;
  return Verdict::kMore;
}

Greeting::Verdict Greeting::Wrong(std::string why) {
  why_ = std::move(why);
  return Verdict::kWrong;
}

}  // namespace voxeld::daemon::listen
