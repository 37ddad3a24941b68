#include "gpu/cuda/cuda_pictures.h"

#include <algorithm>
#include <utility>

#include "gpu/cuda/kernels.h"

namespace voxeld::gpu::cuda {
namespace {

// The number of groups of slices, so that slice images of one are copied while the next is drawn.
constexpr size_t kSampledGroups = 4;
constexpr size_t kMostGroups = kMostDrawGroups;
static_assert(kMostGroups >= kSampledGroups && kMostGroups >= PackedPlan::kMostGroups);
static_assert(PackedPlan::kGroupGrain == 1 << RegionBits(2));

}  // namespace

absl::StatusOr<std::unique_ptr<CudaPictures>> CudaPictures::Make(
    Device& device, const PicturesPlan& plan, const LightPlan& light,
    const display::FootprintTable& table, const display::TileToSlices& tile_to_slices,
    const std::optional<PackedPlan>& packed, const CudaPictures* before) {
  std::unique_ptr<CudaPictures> made(new CudaPictures(device, plan));
  if (absl::Status status = made->PutTables(light, table, tile_to_slices); !status.ok()) {
    return status;
  }
  if (absl::Status status = made->PutPictures(before); !status.ok()) return status;
  if (absl::Status status = made->PutPacked(packed); !status.ok()) return status;
  return made;
}

CudaPictures::~CudaPictures() {
  // After an error, kernels may still be running that write to memory freed here.
  for (cudaStream_t stream : {device_.beside(), device_.stream()}) cudaStreamSynchronize(stream);
  for (cudaEvent_t event : events_) cudaEventDestroy(event);
  if (numbers_ != nullptr) cudaFreeHost(numbers_);
  if (counters_ != nullptr) cudaFreeHost(counters_);
}

absl::Status CudaPictures::PutTables(const LightPlan& light, const display::FootprintTable& table,
                                     const display::TileToSlices& tile_to_slices) {
  absl::Status status;
  const auto put = [&](const auto* data, size_t count) {
    using Value = std::remove_cvref_t<decltype(*data)>;
    if (!status.ok()) return static_cast<const Value*>(nullptr);
    absl::StatusOr<Block> block = device_.Upload(data, count);
    if (!block.ok()) {
      status = block.status();
      return static_cast<const Value*>(nullptr);
    }
    tables_.push_back(*std::move(block));
    return static_cast<const Value*>(tables_.back().as<Value>());
  };
  const display::TileToSlices::Tables tiles = tile_to_slices.tables();
  for (int axis = 0; axis < 3; ++axis) {
    index_.stride[axis] = static_cast<uint32_t>(tiles.stride[axis]);
  }
  index_.inner_axis = static_cast<uint32_t>(tiles.inner_axis);
  index_.inner_sets = static_cast<uint32_t>(tiles.inner_sets);
  index_.inner_tiles = static_cast<uint32_t>(tiles.inner_tiles);
  index_.begin = put(tiles.begin.data(), tiles.begin.size());
  index_.slices = put(tiles.slices.data(), tiles.slices.size());
  index_.inner_seen = put(tiles.seen.data(), tiles.seen.size());
  index_.first = plan_.begin;
  index_.last = plan_.end;

  view_.outer.begin = put(table.outer.begin.data(), table.outer.begin.size());
  view_.outer.entries = put(table.outer.entries.data(), table.outer.entries.size());
  view_.inner.begin = put(table.inner.begin.data(), table.inner.begin.size());
  view_.inner.entries = put(table.inner.entries.data(), table.inner.entries.size());
  view_.width = static_cast<uint32_t>(plan_.layout.width);
  view_.height = static_cast<uint32_t>(plan_.layout.height);
  view_.columns = static_cast<uint32_t>(table.width);
  view_.flat_row = static_cast<uint32_t>(table.flat_row);
  view_.inner_sets = static_cast<uint32_t>(table.inner_sets);
  view_.inner_axis = static_cast<uint32_t>(table.inner_axis);
  for (const display::FootprintEntry& entry : table.inner.entries) {
    view_.line = std::max<uint32_t>(view_.line, std::max({entry.x, entry.y, entry.z}) + 1u);
  }
  view_.sampling = plan_.tone.sampling;
  view_.finish = light.finish(plan_.layout, plan_.tone);
  view_.sub_frames = static_cast<uint32_t>(plan_.layout.sub_frames);
  view_.bytes_per_picture = static_cast<uint32_t>(plan_.layout.bytes_per_slice());
  view_.finish.curves = put(light.curves.data(), light.curves.size());
  if (!light.noise.empty()) view_.finish.noise = put(light.noise.data(), light.noise.size());
  if (!light.factors.empty()) {
    view_.finish.factors = put(light.factors.data(), light.factors.size());
  }
  return status;
}

absl::Status CudaPictures::PutPacked(const std::optional<PackedPlan>& packed) {
  if (!packed) return absl::OkStatus();
  absl::StatusOr<Block> z = device_.Upload(packed->slice_of_z.data(), packed->slice_of_z.size());
  if (!z.ok()) return z.status();
  absl::StatusOr<Block> least = device_.Upload(packed->least.data(), packed->least.size());
  if (!least.ok()) return least.status();
  packed_ = PackedView{z->as<int32_t>(), packed->y0,           packed->y_step, view_,
                       index_.dirty,     least->as<uint32_t>()};
  groups_ = packed->groups;
  tables_.push_back(*std::move(z));
  tables_.push_back(*std::move(least));
  return absl::OkStatus();
}

absl::Status CudaPictures::PutPictures(const CudaPictures* before) {
  const size_t slices = static_cast<size_t>(plan_.end - plan_.begin);
  const size_t pictures = slices * view_.sub_frames;
  const std::vector<uint32_t> ones(slices, 1);
  struct Wanted {
    Block* block;
    size_t bytes;
    const Block* before;  // its initial contents, instead of zeros
  };
  const bool same = before != nullptr && before->plan_.layout == plan_.layout &&
                    before->plan_.begin == plan_.begin && before->plan_.end == plan_.end;
  inherited_ = same;
  for (const Wanted& wanted :
       {Wanted{&lit_tiles_, slices * sizeof(uint32_t), nullptr},
        {&differs_, pictures * sizeof(uint32_t), same ? &before->differs_ : nullptr},
        // The size is in whole words, because neighbouring bytes may be changed together.
        {&bytes_, (pictures * view_.bytes_per_picture + 3) / 4 * 4,
         same ? &before->bytes_ : nullptr},
        {&changed_in_, pictures * sizeof(uint64_t), same ? &before->changed_in_ : nullptr},
        // For slice images packed as they were drawn, this is not known.
        {&blank_, slices * sizeof(uint32_t),
         same && !before->packed_ ? &before->blank_ : nullptr}}) {
    absl::StatusOr<Block> block = device_.Zeros(wanted.bytes);
    if (!block.ok()) return block.status();
    *wanted.block = *std::move(block);
    if (wanted.before == nullptr) continue;
    absl::Status status = device_.Run("cudaMemcpyAsync", [&] {
      return cudaMemcpyAsync(wanted.block->as<void>(), wanted.before->as<void>(), wanted.bytes,
                             cudaMemcpyDeviceToDevice, device_.stream());
    });
    if (!status.ok()) return status;
  }
  absl::StatusOr<Block> dirty = device_.Upload(ones.data(), slices);
  if (!dirty.ok()) return dirty.status();
  dirty_ = *std::move(dirty);
  if (!same) {
    absl::Status status =
        device_.ToDevice(blank_.as<uint32_t>(), ones.data(), slices * sizeof(uint32_t));
    if (!status.ok()) return status;
  }
  index_.dirty = dirty_.as<uint32_t>();
  index_.lit_tiles = lit_tiles_.as<uint32_t>();
  view_.bytes = bytes_.as<uint8_t>();
  view_.changed_in = changed_in_.as<uint64_t>();
  view_.differs = differs_.as<uint32_t>();
  view_.blank = blank_.as<uint32_t>();

  absl::Status status = device_.Run("cudaHostAlloc", [&] {
    return cudaHostAlloc(reinterpret_cast<void**>(&numbers_),
                         std::max<size_t>(1, pictures) * sizeof(uint64_t), cudaHostAllocMapped);
  });
  if (!status.ok()) return status;
  view_.told = numbers_;
  status = device_.ToHost(numbers_, view_.changed_in, pictures * sizeof(uint64_t));
  if (!status.ok()) return status;
  status = device_.Run("cudaHostAlloc", [&] {
    return cudaHostAlloc(reinterpret_cast<void**>(&counters_), sizeof(Counters),
                         cudaHostAllocMapped);
  });
  for (size_t i = 0; i < kMostGroups + 1 && status.ok(); ++i) {
    cudaEvent_t event = nullptr;
    status = device_.Run("cudaEventCreateWithFlags", [&] {
      return cudaEventCreateWithFlags(&event, cudaEventDisableTiming | cudaEventBlockingSync);
    });
    if (status.ok()) events_.push_back(event);
  }
  return status;
}

// Copies slice images that are newer than those in the buffer, in runs of neighbours.
absl::Status CudaPictures::CopyPictures(size_t first, size_t count, FrameBuffer buffer,
                                        uint64_t buffer_holds) {
  const size_t size = view_.bytes_per_picture;
  const size_t offset = static_cast<size_t>(plan_.begin) * view_.sub_frames;
  std::copy_n(numbers_ + first, count,
              buffer.changed_in.begin() + static_cast<ptrdiff_t>(offset + first));
  for (size_t p = first; p < first + count;) {
    if (numbers_[p] <= buffer_holds) {
      ++p;
      continue;
    }
    size_t end = p + 1;
    while (end < first + count && numbers_[end] > buffer_holds) ++end;
    absl::Status status = device_.Run("cudaMemcpyAsync", [&] {
      return cudaMemcpyAsync(buffer.bytes.data() + (offset + p) * size, view_.bytes + p * size,
                             (end - p) * size, cudaMemcpyDeviceToHost, device_.copies());
    });
    if (!status.ok()) return status;
    p = end;
  }
  return absl::OkStatus();
}

DrawGroups CudaPictures::GroupsOfRegions(bool together) const {
  DrawGroups groups;
  if (together || !packed_) return groups;
  groups.count = 0;
  for (const PackedPlan::Group& group : groups_) {
    groups.end[groups.count++] =
        (group.z_end + PackedPlan::kGroupGrain - 1) / PackedPlan::kGroupGrain;
  }
  return groups;
}

std::vector<CudaPictures::Range> CudaPictures::RangesOf(bool together) const {
  const size_t slices = static_cast<size_t>(plan_.end - plan_.begin);
  std::vector<Range> ranges;
  if (together) return {{0, slices}};
  if (packed_) {
    for (const PackedPlan::Group& group : groups_) {
      ranges.push_back({static_cast<size_t>(group.begin), static_cast<size_t>(group.end)});
    }
    return ranges;
  }
  for (size_t g = 0; g < kSampledGroups; ++g) {
    ranges.push_back({g * slices / kSampledGroups, (g + 1) * slices / kSampledGroups});
  }
  return ranges;
}

absl::Status CudaPictures::QueueSlices(const VolumeView& volume, uint64_t frame, Range range,
                                       bool last, cudaStream_t stream) {
  const size_t count = range.end - range.begin;
  if (count == 0 && !last) return absl::OkStatus();
  Counters* const told = last ? counters_ : nullptr;
  return device_.Run("DrawSlices", [&] {
    const uint32_t first_slice = static_cast<uint32_t>(range.begin),
                   slice_count = static_cast<uint32_t>(count);
    return packed_
               ? EndSlices(volume, index_, view_, first_slice, slice_count, frame, false, told,
                           stream)
               : DrawSlices(volume, index_, view_, first_slice, slice_count, frame, told, stream);
  });
}

absl::Status CudaPictures::Record(size_t event, cudaStream_t stream) {
  return device_.Run("cudaEventRecord", [&] { return cudaEventRecord(events_[event], stream); });
}

absl::Status CudaPictures::Await(size_t event, cudaStream_t stream) {
  return device_.Run("cudaStreamWaitEvent",
                     [&] { return cudaStreamWaitEvent(stream, events_[event]); });
}

// Queues one group after the other; or alternates between two streams, so that one group starts on
// multiprocessors that the group before has left. In the end the device's stream has waited for
// all.
absl::Status CudaPictures::QueueGroups(const VolumeView& volume, uint64_t frame,
                                       std::span<const Range> ranges, const Drawing& drawing,
                                       Stopwatch& stopwatch) {
  const size_t last = ranges.size() - 1;
  const bool by_turns = packed_ && drawing.apart && last > 0;
  absl::Status status;
  if (by_turns) {
    status = Record(kMostGroups, device_.stream());
    if (status.ok()) status = Await(kMostGroups, device_.beside());
  }
  for (size_t g = 0; g <= last && status.ok(); ++g) {
    const cudaStream_t stream = by_turns && g % 2 == 1 ? device_.beside() : device_.stream();
    if (packed_ || g == 0) status = drawing.queue(static_cast<uint32_t>(g), stream);
    if (status.ok() && !packed_ && g == 0) status = stopwatch.Set(Stopwatch::Mark::kAssembled);
    if (status.ok() && by_turns && g == last) status = Await(g - 1, stream);
    if (status.ok()) status = QueueSlices(volume, frame, ranges[g], g == last, stream);
    if (status.ok()) status = Record(g, stream);
  }
  if (status.ok() && by_turns) status = Await(last, device_.stream());
  return status.ok() ? stopwatch.Set(Stopwatch::Mark::kPacked) : status;
}

absl::Status CudaPictures::CopyGroups(std::span<const Range> ranges, FrameBuffer buffer,
                                      uint64_t buffer_holds) {
  for (size_t g = 0; g < ranges.size(); ++g) {
    absl::Status status =
        device_.Run("cudaEventSynchronize", [&] { return cudaEventSynchronize(events_[g]); });
    if (!status.ok()) return status;
    const size_t begin = ranges[g].begin * view_.sub_frames;
    status = CopyPictures(begin, ranges[g].end * view_.sub_frames - begin, buffer, buffer_holds);
    if (!status.ok()) return status;
  }
  return device_.Run("cudaStreamSynchronize",
                     [&] { return cudaStreamSynchronize(device_.copies()); });
}

absl::Status CudaPictures::Draw(const VolumeView& volume, uint64_t frame, FrameBuffer buffer,
                                uint64_t buffer_holds, bool together, const Drawing& drawing,
                                Stopwatch& stopwatch, FrameResult& result) {
  const std::vector<Range> ranges = RangesOf(together);
  absl::Status status = QueueGroups(volume, frame, ranges, drawing, stopwatch);
  if (status.ok()) status = CopyGroups(ranges, buffer, buffer_holds);
  if (!status.ok()) {
    cudaStreamSynchronize(device_.beside());
    cudaStreamSynchronize(device_.copies());
    return status;
  }
  result.tiles_drawn = counters_->tiles_drawn;
  result.pictures_drawn = counters_->slices_drawn * view_.sub_frames;
  result.changed = counters_->pictures_changed > 0;
  result.lit_voxels = counters_->lit_voxels;
  result.packed_as_drawn = packed_.has_value();
  return absl::OkStatus();
}

}  // namespace voxeld::gpu::cuda
