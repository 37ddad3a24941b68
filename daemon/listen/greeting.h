// How a connection over HTTP/2 begins (RFC 9113), as far as a stranger's must be known before gRPC is
// given it: gRPC parses headers of any length, at any price, and what it never sees costs nothing.
//
//   preface, SETTINGS    first of all; then, in any order and number:
//   other small frames   they are let by; gRPC sees to them
//   HEADERS              of the first call, whole in one frame: no CONTINUATION
//   DATA                 up to the length of the call's first message; what the message says is
//                        gRPC's
//
// Over TLS (RFC 8446) it is a ClientHello, whole in one record; gRPC gets the handshake, and nothing that
// is parsed as HTTP/2 before a client's certificate is verified.
//
// All this within kMostBytes. What clients send before the daemon's SETTINGS have come is the preface
// and SETTINGS alone, so whoever reads a greeting sends kServerSettings in between.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <string>
#include <string_view>

namespace voxeld::daemon::listen {

// No thread's; touches no socket.
class Greeting {
 public:
  static constexpr size_t kMostBytes = 12u << 10;
  // Empty SETTINGS: HTTP/2's defaults, until gRPC sends its own.
  static constexpr std::string_view kServerSettings{"\0\0\0\x04\0\0\0\0\0", 9};

  // Sent to a client when there is no room for its connection, which is then closed: HTTP/1.1 status 503. HTTP/2 clients treat
  // this as a failed connection and retry with a delay. After SETTINGS and GOAWAY they would reconnect at once until the
  // deadline of the call.
  static constexpr std::string_view kRefusal =
      "HTTP/1.1 503 Service Unavailable\r\nContent-Type: text/plain\r\nContent-Length: 42\r\n"
      "Connection: close\r\n\r\nvoxeld has no room for another connection\n";

  enum class Verdict : uint8_t {
    kMore,   // as it should be so far
    kCall,   // a call has begun: gRPC's turn
    kWrong,  // it will never be; see why()
  };

  // `most_message`: bytes of the first message.
  explicit Greeting(uint64_t most_message) : most_message_(most_message) {}

  // `received`: all that has come so far, from the connection's first byte on; kMostBytes of it are
  // enough. After kCall and kWrong it is not asked again.
  Verdict Read(std::string_view received);
  // The same for a connection that is to speak TLS. One of the two is asked, always the same.
  Verdict ReadTls(std::string_view received);

  // Fewer bytes than this, from the first on, have nothing new to say.
  size_t needed() const { return needed_; }
  // The preface was right: the other end speaks HTTP/2.
  bool speaks_http2() const { return at_ > 0; }
  const std::string& why() const { return why_; }

 private:
  struct Head {
    size_t size = 0;
    uint8_t type = 0, flags = 0;
    uint32_t stream = 0;
  };
  // What the frame at at_ comes to; kMore: at_ moves behind it.
  Verdict ReadFrame(std::string_view received, const Head& head);
  Verdict ReadData(std::string_view received, const Head& head);
  // So many bytes, or else it is wrong.
  Verdict Await(size_t bytes);
  Verdict Wrong(std::string why);

  const uint64_t most_message_;
  size_t at_ = 0;  // where the next frame begins
  size_t needed_ = 1;
  bool settings_ = false;                     // have come
  std::map<uint32_t, std::string> prefixes_;  // of messages, by the streams whose headers came
  std::string why_;
};

}  // namespace voxeld::daemon::listen
