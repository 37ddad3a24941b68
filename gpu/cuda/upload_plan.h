// Which copies bring the arrays of a delta to the device: as few as there can be, into one piece of
// memory.
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

  // A geometry with vertices whose arrays lie in the delta. All such come before the first AddBulk:
  // they go over as one, the records between them included.
  void AddInline(const GeometryView& view);
  // One whose arrays lie in bulk memory. Answers where its positions come to lie; its other arrays
  // keep their distance from them. What lies side by side in a segment goes over as one.
  size_t AddBulk(const GeometryView& view);

  const std::vector<Copy>& copies() const { return copies_; }
  size_t size() const { return size_; }  // of the device's memory
  // What comes to lie at the beginning, if there are such arrays.
  const std::byte* inline_begin() const { return copies_.empty() ? nullptr : copies_[0].from; }

 private:
  std::vector<Copy> copies_;
  size_t size_ = 0;
  uint64_t segment_ = 0;  // of the last copy; 0: the delta
};

}  // namespace voxeld::gpu::cuda
