// HTTP/2 as bytes (RFC 9113, RFC 7541), written by hand: what a library would refuse to send.
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

// A frame's 9 bytes and its payload; `payload` is at most 2²⁴ − 1 bytes.
std::string Frame(FrameType type, uint8_t flags, uint32_t stream, std::string_view payload);

// An HPACK integer of a byte whose upper bits, those above `prefix_bits`, are zero.
std::string HpackInteger(uint64_t value, int prefix_bits);

// A field as a literal that is not kept.
std::string Field(std::string_view name, std::string_view value);

// The fields of a gRPC call of `path`, "/package.Service/Method".
std::string CallFields(std::string_view path);

// Preface and empty settings: what every client begins with.
std::string Greeting();

// One message as gRPC frames it.
std::string GrpcMessage(std::string_view message);

}  // namespace voxeld::e2e
