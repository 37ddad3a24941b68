// Plans the copies that bring the arrays of a delta to the device: as few as possible, into one
// piece of memory.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "gpu/delta.h"

namespace voxeld::gpu::cuda {

class UploadPlan {
 public:
  struct Copy {
    const std::byte* from = nullptr;
    size_t size = 0;
    size_t to = 0;  // offset in the device's memory
  };

  // Adds a geometry with vertices whose arrays are in the delta. All of these must be added before
  // the first AddBulk: they are copied as one, including the records between them.
  void AddInline(const GeometryView& view);
  // Adds a geometry whose arrays are in bulk memory. Returns the offset of its positions; its other
  // arrays keep their distance from them. Adjacent data of a segment is copied as one.
  size_t AddBulk(const GeometryView& view);

  const std::vector<Copy>& copies() const { return copies_; }
  size_t size() const { return size_; }  // of the device's memory
  // Returns the start of the data at the beginning, if there are such arrays.
  const std::byte* inline_begin() const { return copies_.empty() ? nullptr : copies_[0].from; }

 private:
  std::vector<Copy> copies_;
  size_t size_ = 0;
  uint64_t segment_ = 0;  // of the last copy; 0: the delta
};

}  // namespace voxeld::gpu::cuda
