#include "display/geometry/list_builder.h"

#include <algorithm>
#include <tuple>

namespace voxeld::display {
namespace {

bool Before(const FootprintEntry& a, const FootprintEntry& b) {
  return std::tuple(a.z, a.y, a.x, b.weight) < std::tuple(b.z, b.y, b.x, a.weight);
}

bool SameVoxel(const FootprintEntry& a, const FootprintEntry& b) {
  return a.x == b.x && a.y == b.y && a.z == b.z;
}

}  // namespace

FootprintLists ListBuilder::Build() {
  FootprintLists out;
  out.begin.assign(lists_ + 1, 0);
  for (const Record& record : records_) ++out.begin[record.list + 1];
  for (size_t list = 0; list < lists_; ++list) out.begin[list + 1] += out.begin[list];

  out.entries.resize(records_.size());
  std::vector<uint32_t> next(out.begin.begin(), out.begin.end() - 1);
  for (const Record& record : records_) out.entries[next[record.list]++] = record.entry;
  records_ = {};

  size_t kept = 0;
  for (size_t list = 0; list < lists_; ++list) {
    const auto first = out.entries.begin() + out.begin[list];
    const auto last = out.entries.begin() + next[list];
    std::sort(first, last, Before);
    const auto end = std::unique(first, last, SameVoxel);
    out.begin[list] = static_cast<uint32_t>(kept);
    for (auto entry = first; entry != end; ++entry) out.entries[kept++] = *entry;
  }
  out.begin[lists_] = static_cast<uint32_t>(kept);
  out.entries.resize(kept);
  out.entries.shrink_to_fit();
  return out;
}

}  // namespace voxeld::display
