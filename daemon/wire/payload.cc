#include "daemon/wire/payload.h"

namespace voxeld::daemon::wire {

void PayloadTable::Begin() { ranges_.push_back({pieces_.size(), pieces_.size(), 0}); }

void PayloadTable::Add(std::string_view piece) {
  if (piece.empty()) return;
  pieces_.push_back(piece);
  ranges_.back().end = pieces_.size();
  ranges_.back().size += piece.size();
}

std::string PayloadTable::Token() const {
  const auto index = static_cast<uint32_t>(ranges_.size() - 1);
  return std::string(reinterpret_cast<const char*>(&index), sizeof(index));
}

Payload PayloadTable::Find(std::string_view token) const {
  uint32_t index = 0;
  if (token.size() != sizeof(index)) return {};
  std::memcpy(&index, token.data(), sizeof(index));
  if (index >= ranges_.size()) return {};
  const Range& range = ranges_[index];
  return {std::span(pieces_).subspan(range.begin, range.end - range.begin), range.size};
}

}  // namespace voxeld::daemon::wire
