// Large bytes fields of a message, left in the pieces that gRPC delivers.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace voxeld::daemon::wire {

// Bytes in pieces. The pieces, and the bytes to which they point, must outlive it.
class Payload {
 public:
  Payload() = default;
  explicit Payload(std::string_view whole) : whole_(whole), size_(whole.size()) {}
  Payload(std::span<const std::string_view> pieces, uint64_t size) : pieces_(pieces), size_(size) {}

  uint64_t size() const { return size_; }
  bool empty() const { return size_ == 0; }

  // Calls `run(data, count)` for contiguous elements of `element` bytes (at most 16), in order. An
  // element that spans several pieces is copied together first. Incomplete elements at the end are
  // ignored.
  template <typename Run>
  void ForEachRun(size_t element, Run&& run) const {
    char joined[16];
    size_t has = 0;
    for (std::string_view piece : pieces_.empty() ? std::span(&whole_, 1) : pieces_) {
      if (has > 0) {
        const size_t take = std::min(element - has, piece.size());
        std::memcpy(joined + has, piece.data(), take);
        has += take;
        piece.remove_prefix(take);
        if (has < element) continue;
        run(static_cast<const char*>(joined), size_t{1});
        has = 0;
      }
      const size_t count = piece.size() / element;
      if (count > 0) run(piece.data(), count);
      piece.remove_prefix(count * element);
      if (!piece.empty()) std::memcpy(joined, piece.data(), piece.size());
      has = piece.size();
    }
  }

 private:
  std::span<const std::string_view> pieces_;
  std::string_view whole_;  // used if there are no pieces
  uint64_t size_ = 0;
};

// Payloads that were removed from a message; the message refers to each by a token.
class PayloadTable {
 public:
  // Begins a payload; Add appends its pieces and Token returns its name.
  void Begin();
  void Add(std::string_view piece);
  std::string Token() const;

  // Returns: the payload for which the content of a bytes field stands; empty if it is not a token.
  Payload Find(std::string_view token) const;

 private:
  struct Range {
    size_t begin = 0, end = 0;  // indices in pieces_
    uint64_t size = 0;
  };
  std::vector<std::string_view> pieces_;
  std::vector<Range> ranges_;
};

}  // namespace voxeld::daemon::wire
