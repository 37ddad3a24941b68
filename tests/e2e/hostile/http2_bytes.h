// HTTP/2 as bytes (RFC 9113, RFC 7541), written by hand, including what a library would refuse to
// send.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace voxeld::e2e {

inline constexpr std::string_view kPreface = "PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n";

enum class FrameType : uint8_t {
  kData = 0,
  kHeaders = 1,
  kResetStream = 3,
  kSettings = 4,
  kWindowUpdate = 8,
  kContinuation = 9,
};
inline constexpr uint8_t kEndStream = 1, kEndHeaders = 4;

// Returns a frame's 9 bytes and its payload; `payload` is at most 2²⁴ − 1 bytes.
std::string Frame(FrameType type, uint8_t flags, uint32_t stream, std::string_view payload);

// Returns an HPACK integer whose first byte has zeros in the bits above `prefix_bits`.
std::string HpackInteger(uint64_t value, int prefix_bits);

// Returns a field as a literal that is not indexed.
std::string Field(std::string_view name, std::string_view value);

// Returns the fields of a gRPC call of `path`, "/package.Service/Method".
std::string CallFields(std::string_view path);

// Returns the preface and empty settings, with which every client begins.
std::string Greeting();

// Returns one message in gRPC's framing.
std::string GrpcMessage(std::string_view message);

}  // namespace voxeld::e2e
