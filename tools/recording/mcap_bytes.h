// MCAP's encodings of numbers, texts and records.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <string_view>

namespace voxeld::recording {

inline constexpr std::string_view kMcapMagic("\x89MCAP0\r\n", 8);

enum McapRecord : uint8_t {
  kHeader = 0x01,
  kFooter = 0x02,
  kSchema = 0x03,
  kChannel = 0x04,
  kMessage = 0x05,
  kChunk = 0x06,
  kMessageIndex = 0x07,
  kChunkIndex = 0x08,
  kStatistics = 0x0B,
  kSummaryOffset = 0x0E,
  kDataEnd = 0x0F,
};

// An opcode and a 64-bit length.
inline constexpr size_t kRecordHead = 9;

class McapBytes {
 public:
  template <typename T>
  McapBytes& Number(T value) {
    for (size_t i = 0; i < sizeof(T); ++i) {
      text_.push_back(static_cast<char>(static_cast<uint64_t>(value) >> (8 * i)));
    }
    return *this;
  }
  McapBytes& Text(std::string_view text) {
    Number(static_cast<uint32_t>(text.size()));
    text_.append(text);
    return *this;
  }
  McapBytes& Raw(std::string_view bytes) {
    text_.append(bytes);
    return *this;
  }
  // Writes a map whose entries are already encoded.
  McapBytes& Map(const McapBytes& entries) { return Text(entries.text_); }
  McapBytes& Map(const std::map<std::string, std::string>& entries) {
    McapBytes inner;
    for (const auto& [key, value] : entries) inner.Text(key).Text(value);
    return Map(inner);
  }

  const std::string& text() const { return text_; }
  std::string Record(uint8_t kind) const {
    McapBytes out;
    out.Number(kind).Number(uint64_t{text_.size()}).Raw(text_);
    return out.text_;
  }

 private:
  std::string text_;
};

// Reads what McapBytes writes. Missing data are read as 0 or empty, and `ok` reports it.
class McapParse {
 public:
  explicit McapParse(std::string_view bytes) : rest_(bytes) {}

  template <typename T>
  T Number() {
    if (rest_.size() < sizeof(T)) {
      ok_ = false;
      rest_ = {};
      return 0;
    }
    uint64_t value = 0;
    for (size_t i = 0; i < sizeof(T); ++i) {
      value |= uint64_t{static_cast<uint8_t>(rest_[i])} << (8 * i);
    }
    rest_.remove_prefix(sizeof(T));
    return static_cast<T>(value);
  }
  std::string_view Bytes(uint64_t size) {
    if (rest_.size() < size) {
      ok_ = false;
      rest_ = {};
      return {};
    }
    const std::string_view out = rest_.substr(0, size);
    rest_.remove_prefix(size);
    return out;
  }
  std::string_view Text() { return Bytes(Number<uint32_t>()); }
  std::map<std::string, std::string> Map() {
    std::map<std::string, std::string> out;
    McapParse inner(Text());
    while (!inner.rest().empty() && inner.ok()) {
      std::string key(inner.Text());
      out[std::move(key)] = std::string(inner.Text());
    }
    ok_ = ok_ && inner.ok();
    return out;
  }

  std::string_view rest() const { return rest_; }
  bool ok() const { return ok_; }

 private:
  std::string_view rest_;
  bool ok_ = true;
};

}  // namespace voxeld::recording
