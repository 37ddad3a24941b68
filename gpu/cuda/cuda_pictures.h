// The packed pictures of the slices that an engine owns, on the device: footprints, tone, and since
// which frame each picture has its bytes.
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
  int32_t begin = 0, end = 0;  // the slices owned
};

// Thread-bound. Its calls queue work in the device's stream.
class CudaPictures {
 public:
  // Everything is to be sliced anew. With the layout of `before` (may be null) pictures that come
  // out the same keep the frame of their last change.
  static absl::StatusOr<std::unique_ptr<CudaPictures>> Make(
      Device& device, const PicturesPlan& plan, const LightPlan& light,
      const display::FootprintTable& table, const display::TileToSlices& tile_to_slices,
      const std::optional<PackedPlan>& packed, const CudaPictures* before);
  ~CudaPictures();
  CudaPictures(const CudaPictures&) = delete;
  CudaPictures& operator=(const CudaPictures&) = delete;

  const SliceIndexView& index() const { return index_; }
  // Where tiles are to be packed as they are drawn; null: they are kept, and sliced by Draw.
  const PackedView* packed() const { return packed_ ? &*packed_ : nullptr; }
  // Whether they begin with what others had, which may not be what an empty volume shows.
  bool inherited() const { return inherited_; }

  // Where they are packed as they are drawn: the groups in which that can be done, so that one's
  // pictures are copied while the next is drawn. `together`: as one.
  DrawGroups GroupsOfRegions(bool together) const;

  // What draws a group, queued in a stream; `apart`: two groups may be drawn at once.
  struct Drawing {
    std::function<absl::Status(uint32_t group, cudaStream_t stream)> queue;
    bool apart;
  };

  // Slices again what is dirty, as pictures of `frame`, and brings `buffer` up to it; waits until
  // all is there. Draws each group of slices before, where pictures are packed as they are drawn, else
  // group 0 as that of all; sets the marks. `result` gets what was counted, of which nothing is left on
  // the device. After an error nothing writes to `buffer` any more, whose pictures may be of this frame
  // or older; what was drawn may be told by the next one, or, if all of it was, by none.
  absl::Status Draw(const VolumeView& volume, uint64_t frame, FrameBuffer buffer,
                    uint64_t buffer_holds, bool together, const Drawing& drawing,
                    Stopwatch& stopwatch, FrameResult& result);

 private:
  CudaPictures(Device& device, const PicturesPlan& plan) : device_(device), plan_(plan) {}
  absl::Status PutTables(const LightPlan& light, const display::FootprintTable& table,
                         const display::TileToSlices& tile_to_slices);
  absl::Status PutPacked(const std::optional<PackedPlan>& packed);
  absl::Status PutPictures(const CudaPictures* before);
  // Slices [begin, end), from the first owned.
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
  // `stream` goes on after what events_[event] has been recorded behind.
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
  // Pinned, and written by kernels: what changed_in_ has, and what was counted in the frame.
  uint64_t* numbers_ = nullptr;
  Counters* counters_ = nullptr;
  std::vector<cudaEvent_t> events_;  // of each group, and that drawing may begin
};

}  // namespace voxeld::gpu::cuda
