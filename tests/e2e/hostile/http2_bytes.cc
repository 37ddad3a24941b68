#include "tests/e2e/hostile/http2_bytes.h"

namespace voxeld::e2e {

std::string Frame(FrameType type, uint8_t flags, uint32_t stream, std::string_view payload) {
  std::string out;
  for (const int shift : {16, 8, 0}) out.push_back(static_cast<char>(payload.size() >> shift));
  out.push_back(static_cast<char>(type));
  out.push_back(static_cast<char>(flags));
  for (const int shift : {24, 16, 8, 0}) out.push_back(static_cast<char>(stream >> shift));
  return out.append(payload);
}

std::string HpackInteger(uint64_t value, int prefix_bits) {
  const uint64_t most = (uint64_t{1} << prefix_bits) - 1;
  if (value < most) return std::string(1, static_cast<char>(value));
  std::string out(1, static_cast<char>(most));
  value -= most;
  for (; value >= 128; value >>= 7) out.push_back(static_cast<char>((value & 127) | 128));
  out.push_back(static_cast<char>(value));
  return out;
}

std::string Field(std::string_view name, std::string_view value) {
  std::string out(1, '\0');
  for (const std::string_view text : {name, value}) {
    out.append(HpackInteger(text.size(), 7)).append(text);
  }
  return out;
}

std::string CallFields(std::string_view path) {
  return Field(":method", "POST") + Field(":scheme", "http") + Field(":path", path) +
         Field(":authority", "voxeld") + Field("content-type", "application/grpc") +
         Field("te", "trailers");
}

std::string Greeting() { return std::string(kPreface) + Frame(FrameType::kSettings, 0, 0, ""); }

std::string GrpcMessage(std::string_view message) {
  std::string out(1, '\0');
  for (const int shift : {24, 16, 8, 0}) out.push_back(static_cast<char>(message.size() >> shift));
  return out.append(message);
}

}  // namespace voxeld::e2e
