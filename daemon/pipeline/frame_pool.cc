#include "daemon/pipeline/frame_pool.h"

#include <algorithm>
#include <utility>

namespace voxeld::daemon {

FramePool::FramePool(const display::FrameLayout& layout)
    : layout_(layout), shelf_(std::make_shared<Shelf>()) {}

FramePool::~FramePool() {
  sync::MutexLock lock(shelf_->mutex);
  shelf_->open = false;
  shelf_->free.clear();
}

FramePool::Lease FramePool::Acquire() {
  std::unique_ptr<display::SliceFrame> frame;
  {
    sync::MutexLock lock(shelf_->mutex);
    const auto newest =
        std::max_element(shelf_->free.begin(), shelf_->free.end(),
                         [](const auto& a, const auto& b) { return a->volume < b->volume; });
    if (newest != shelf_->free.end()) {
      frame = std::move(*newest);
      shelf_->free.erase(newest);
    }
  }
  if (frame == nullptr) {
    frame = std::make_unique<display::SliceFrame>();
    frame->layout = layout_;
    frame->bytes.resize(layout_.bytes());
    frame->changed_in.resize(layout_.pictures());
  }
  Lease lease;
  lease.holds = frame->volume > forgotten_ ? frame->volume : 0;
  frame->volume = 0;
  lease.frame = std::shared_ptr<display::SliceFrame>(
      frame.release(), [shelf = shelf_](display::SliceFrame* returned) {
        std::unique_ptr<display::SliceFrame> owned(returned);
        sync::MutexLock lock(shelf->mutex);
        if (shelf->open) shelf->free.push_back(std::move(owned));
      });
  return lease;
}

}  // namespace voxeld::daemon
