// Collects footprint entries in any order and converts them to compressed rows.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "display/geometry/footprint.h"

namespace voxeld::display {

class ListBuilder {
 public:
  // Requires: `lists` < 2³².
  explicit ListBuilder(size_t lists) : lists_(lists) {}

  void Add(size_t list, const FootprintEntry& entry) {
    records_.push_back({static_cast<uint32_t>(list), entry});
  }

  // Returns the sorted lists; a voxel added several times to a list keeps the greatest weight.
  // Empties the builder.
  FootprintLists Build();

 private:
  struct Record {
    uint32_t list;
    FootprintEntry entry;
  };
  size_t lists_;
  std::vector<Record> records_;
};

}  // namespace voxeld::display
