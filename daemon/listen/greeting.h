// Checks the beginning of an HTTP/2 connection (RFC 9113) from an unknown client before gRPC gets
// it. gRPC parses headers of any length at any cost, so it should never see an invalid beginning.
//
//   preface, SETTINGS    first; then, in any order and number:
//   other small frames   accepted; gRPC handles them
//   HEADERS              of the first call, complete in one frame: no CONTINUATION
//   DATA                 up to the length of the call's first message; gRPC checks the message
//
// Over TLS (RFC 8446) the beginning is a ClientHello, complete in one record. gRPC does the
// handshake, and parses no HTTP/2 before it has verified a client's certificate.
//
// All of this must fit into kMostBytes. Before clients receive the daemon's SETTINGS they send only
// the preface and SETTINGS, so the caller sends kServerSettings in between.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <string>
#include <string_view>

namespace voxeld::daemon::listen {

// Not thread-safe; accesses no socket.
class Greeting {
 public:
  static constexpr size_t kMostBytes = 12u << 10;
  // Empty SETTINGS: HTTP/2's defaults apply until gRPC sends its own.
  static constexpr std::string_view kServerSettings{"\0\0\0\x04\0\0\0\0\0", 9};

  // Sent to a client whose connection exceeds a limit, before closing it: HTTP/1.1 status 503.
  // HTTP/2 clients treat this as a failed connection and retry with a delay. After SETTINGS and
  // GOAWAY they would reconnect at once until the deadline of the call.
  static constexpr std::string_view kRefusal =
      "HTTP/1.1 503 Service Unavailable\r\nContent-Type: text/plain\r\nContent-Length: 42\r\n"
      "Connection: close\r\n\r\nvoxeld has no room for another connection\n";

  enum class Verdict : uint8_t {
    kMore,   // valid so far
    kCall,   // a call has begun: pass the connection to gRPC
    kWrong,  // invalid; see why()
  };

  // `most_message` is the limit on the bytes of the first message.
  explicit Greeting(uint64_t most_message) : most_message_(most_message) {}

  // `received` is everything since the connection's first byte; kMostBytes are enough. Do not call
  // again after kCall or kWrong.
  Verdict Read(std::string_view received);
  // Does the same for a TLS connection. Always call the same one of the two functions.
  Verdict ReadTls(std::string_view received);

  // Returns: the number of bytes from the beginning below which the verdict cannot change.
  size_t needed() const { return needed_; }
  // Returns: whether the preface was valid, so that the client speaks HTTP/2.
  bool speaks_http2() const { return at_ > 0; }
  const std::string& why() const { return why_; }

 private:
  struct Head {
    size_t size = 0;
    uint8_t type = 0, flags = 0;
    uint32_t stream = 0;
  };
  // Reads the frame at at_. kMore: at_ moves to the next frame.
  Verdict ReadFrame(std::string_view received, const Head& head);
  Verdict ReadData(std::string_view received, const Head& head);
  // Waits for this many bytes. Returns: kMore, or kWrong if they exceed the limit.
  Verdict Await(size_t bytes);
  Verdict Wrong(std::string why);

  const uint64_t most_message_;
  size_t at_ = 0;  // beginning of the next frame
  size_t needed_ = 1;
  bool settings_ = false;                     // received
  std::map<uint32_t, std::string> prefixes_;  // of messages, by streams whose headers were received
  std::string why_;
};

}  // namespace voxeld::daemon::listen
