// The packed slice images of the slices that an engine owns, on the device: footprints, tone, and
// since which frame each slice image has had its bytes.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "display/api/slice_frame.h"
#include "display/geometry/footprint.h"
#include "gpu/cuda/device.h"
#include "gpu/cuda/draw_types.h"
#include "gpu/cuda/packed_plan.h"
#include "gpu/cuda/stopwatch.h"
#include "gpu/cuda/types.h"
#include "gpu/engine.h"
#include "gpu/slice/light_plan.h"

namespace voxeld::gpu::cuda {

struct PicturesPlan {
  display::FrameLayout layout;
  display::Tone tone;
  int32_t begin = 0, end = 0;  // the owned slices
};

// Thread-bound. Calls queue work in the device's stream.
class CudaPictures {
 public:
  // All slices are sliced again. If the layout is that of `before` (may be null), slice images with
  // unchanged bytes keep the frame of their last change.
  static absl::StatusOr<std::unique_ptr<CudaPictures>> Make(
      Device& device, const PicturesPlan& plan, const LightPlan& light,
      const display::FootprintTable& table, const display::TileToSlices& tile_to_slices,
      const std::optional<PackedPlan>& packed, const CudaPictures* before);
  ~CudaPictures();
  CudaPictures(const CudaPictures&) = delete;
  CudaPictures& operator=(const CudaPictures&) = delete;

  const SliceIndexView& index() const { return index_; }
  // Returns where tiles are packed as they are drawn; null if they are stored, and sliced by Draw.
  const PackedView* packed() const { return packed_ ? &*packed_ : nullptr; }
  // Returns whether the slice images start with the contents of others, which may differ from those
  // of an empty volume.
  bool inherited() const { return inherited_; }

  // Returns the groups in which regions are drawn, if they are packed as they are drawn, so that
  // slice images of one are copied while the next is drawn. `together`: use a single group.
  DrawGroups GroupsOfRegions(bool together) const;

  // Draws a group, queued in a stream; `apart`: two groups may be drawn at once.
  struct Drawing {
    std::function<absl::Status(uint32_t group, cudaStream_t stream)> queue;
    bool apart;
  };

  // Slices the dirty slices again, as slice images of `frame`, and brings `buffer` up to date;
  // waits until it is complete. First draws each group of slices, if slice images are packed as
  // they are drawn, otherwise group 0 as the group of all; sets the marks. `result` gets the
  // counters, which are then cleared on the device. After an error nothing writes to `buffer`,
  // whose slice images may be of this frame or older; the next frame may report what was drawn, or,
  // if everything was drawn, no frame does.
  absl::Status Draw(const VolumeView& volume, uint64_t frame, FrameBuffer buffer,
                    uint64_t buffer_holds, bool together, const Drawing& drawing,
                    Stopwatch& stopwatch, FrameResult& result);

 private:
  CudaPictures(Device& device, const PicturesPlan& plan) : device_(device), plan_(plan) {}
  absl::Status PutTables(const LightPlan& light, const display::FootprintTable& table,
                         const display::TileToSlices& tile_to_slices);
  absl::Status PutPacked(const std::optional<PackedPlan>& packed);
  absl::Status PutPictures(const CudaPictures* before);
  // Slices [begin, end), counted from the first owned slice.
  struct Range {
    size_t begin, end;
  };
  std::vector<Range> RangesOf(bool together) const;
  absl::Status QueueSlices(const VolumeView& volume, uint64_t frame, Range range, bool last,
                           cudaStream_t stream);
  absl::Status QueueGroups(const VolumeView& volume, uint64_t frame, std::span<const Range> ranges,
                           const Drawing& drawing, Stopwatch& stopwatch);
  absl::Status CopyGroups(std::span<const Range> ranges, FrameBuffer buffer, uint64_t buffer_holds);
  absl::Status Record(size_t event, cudaStream_t stream);
  // Makes `stream` wait for the work that precedes events_[event].
  absl::Status Await(size_t event, cudaStream_t stream);

  absl::Status CopyPictures(size_t first, size_t count, FrameBuffer buffer, uint64_t buffer_holds);

  Device& device_;
  const PicturesPlan plan_;
  SliceIndexView index_;
  SliceView view_;
  std::optional<PackedView> packed_;
  std::vector<PackedPlan::Group> groups_;  // if they are packed as they are drawn
  bool inherited_ = false;
  std::vector<Block> tables_;
  Block dirty_, lit_tiles_, blank_, bytes_, changed_in_, differs_;
  // Pinned, and written by kernels: the values of changed_in_, and the counters of the frame.
  uint64_t* numbers_ = nullptr;
  Counters* counters_ = nullptr;
  std::vector<cudaEvent_t> events_;  // one for each group, and one that lets drawing start
};

}  // namespace voxeld::gpu::cuda
