// The arrays of deltas, and their places on the device.
#include <algorithm>
#include <bit>
#include <optional>
#include <utility>
#include <variant>

#include "gpu/assemble/delta_plan.h"
#include "gpu/cuda/cuda_volume.h"
#include "gpu/cuda/line_kernels.h"
#include "gpu/cuda/triangle_kernels.h"
#include "gpu/cuda/upload_plan.h"
#include "gpu/primitives/samples.h"

namespace voxeld::gpu::cuda {
namespace {

// The host itself computes the bounds of up to this many vertices.
constexpr size_t kFewVertices = 1024;

// Returns the same array at its place in device memory, which the host must not read.
template <typename T>
std::span<const T> Moved(std::span<const T> array, const std::byte* host, std::byte* device) {
  if (array.empty()) return array;
  const auto offset = reinterpret_cast<const std::byte*>(array.data()) - host;
  return {reinterpret_cast<const T*>(device + offset), array.size()};
}

GeometryBounds BoundsOfFew(const GeometryView& g) {
  const std::span<const float> p = g.positions;
  GeometryBounds bounds;
  for (size_t a = 0; a < 3; ++a) {
    bounds.lo[a] = bounds.hi[a] = static_cast<double>(p[a]);
    for (size_t i = a; i < p.size(); i += 3) {
      bounds.lo[a] = std::min(bounds.lo[a], static_cast<double>(p[i]));
      bounds.hi[a] = std::max(bounds.hi[a], static_cast<double>(p[i]));
    }
  }
  if (g.record.kind != PrimitiveKind::kTriangles) return bounds;
  const size_t corners = g.indices.empty() ? p.size() / 3 : g.indices.size();
  for (size_t first = 0; first + 3 <= corners; first += 3) {
    for (size_t a = 0; a < 3; ++a) {
      double at[3];
      for (size_t c = 0; c < 3; ++c) {
        const size_t vertex = g.indices.empty() ? first + c : g.indices[first + c];
        at[c] = static_cast<double>(p[vertex * 3 + a]);
      }
      const auto [low, high] = std::minmax({at[0], at[1], at[2]});
      bounds.extent[a] = std::max(bounds.extent[a], high - low);
    }
  }
  return bounds;
}

// Several geometries may use the same positions in bulk memory: notes the data that any of them
// needs.
void NoteBounds(absl::flat_hash_map<const float*, GeometryBounds>& all, const float* positions,
                const GeometryBounds& bounds) {
  const auto [it, fresh] = all.emplace(positions, bounds);
  if (fresh) return;
  for (int a = 0; a < 3; ++a) {
    it->second.lo[a] = std::min(it->second.lo[a], bounds.lo[a]);
    it->second.hi[a] = std::max(it->second.hi[a], bounds.hi[a]);
    it->second.extent[a] = std::max(it->second.extent[a], bounds.extent[a]);
  }
}

}  // namespace

absl::Status CudaVolume::Apply(std::span<const std::byte> delta, BulkSource* bulk) {
  std::vector<std::unique_ptr<Drawable>> gone;
  const absl::Status status = scene_.Apply(delta, bulk, *this, gone);
  arrays_ = nullptr;
  scene_.MapClips(view_, false);
  bulk_.clear();
  bounds_.clear();
  return status;
}

// Copies the arrays of all geometries into one piece of memory.
absl::Status CudaVolume::OnPlan(const DeltaPlan& plan) {
  UploadPlan uploads;
  for (const DeltaStep& step : plan.steps) {
    const auto* geometry = std::get_if<GeometryView>(&step);
    if (geometry == nullptr || geometry->record.drawn_by == DrawnBy::kCpu ||
        !geometry->HasArrays() || geometry->bulk != nullptr) {
      continue;
    }
    uploads.AddInline(*geometry);
  }
  arrays_begin_ = uploads.inline_begin();
  for (const DeltaStep& step : plan.steps) {
    const auto* geometry = std::get_if<GeometryView>(&step);
    if (geometry == nullptr || geometry->record.drawn_by == DrawnBy::kCpu ||
        !geometry->HasArrays() || geometry->bulk == nullptr) {
      continue;
    }
    const float* const positions = geometry->positions.data();
    if (!bulk_.contains(positions)) bulk_[positions] = uploads.AddBulk(*geometry);
  }
  if (uploads.size() == 0) return FindGeometryBounds(plan);
  absl::StatusOr<Block> block = uploader_.Upload(uploads);
  if (!block.ok()) return block.status();
  arrays_ = std::make_shared<Block>(*std::move(block));
  const absl::Status status = FindGeometryBounds(plan);
  // The delta's memory is released when Apply returns, and bulk memory may be as well.
  const absl::Status waited = uploader_.Wait();
  return status.ok() ? waited : status;
}

CudaVolume::IndexedBy CudaVolume::IndexFor(const GeometryRecord& record) {
  if (record.drawn_by == DrawnBy::kCpu || IsCells(record)) return IndexedBy::kPairs;
  if (record.kind == PrimitiveKind::kTriangles && record.texture_width == 0 &&
      record.thickness == 0) {
    return IndexedBy::kTriangles;
  }
  if (record.thickness != 0) return IndexedBy::kPairs;
  if (record.kind == PrimitiveKind::kPoints) return IndexedBy::kPoints;
  const bool line =
      record.kind == PrimitiveKind::kSegments && record.sampling != LineSampling::kCover;
  return line ? IndexedBy::kLines : IndexedBy::kPairs;
}

// Finds the bounds and sizes of all geometries whose items may be thin lines, points or small
// triangles. For large geometries the device does it.
absl::Status CudaVolume::FindGeometryBounds(const DeltaPlan& plan) {
  std::vector<const GeometryView*> large;
  for (const DeltaStep& step : plan.steps) {
    const auto* geometry = std::get_if<GeometryView>(&step);
    if (geometry == nullptr || geometry->positions.empty() ||
        geometry->record.drawn_by == DrawnBy::kCpu ||
        (IndexFor(geometry->record) == IndexedBy::kPairs &&
         geometry->record.kind != PrimitiveKind::kFilled)) {
      continue;
    }
    if (geometry->positions.size() > 3 * kFewVertices || geometry->indices.size() > kFewVertices) {
      large.push_back(geometry);
    } else {
      NoteBounds(bounds_, geometry->positions.data(), BoundsOfFew(*geometry));
    }
  }
  if (large.empty()) return absl::OkStatus();
  constexpr size_t kWords = 9;  // least and greatest by axis, and extents
  std::vector<uint32_t> bits;
  for (size_t i = 0; i < large.size(); ++i) {
    bits.insert(bits.end(), {~0u, ~0u, ~0u, 0u, 0u, 0u, 0u, 0u, 0u});
  }
  const absl::StatusOr<Block> found = device_.Upload(bits.data(), bits.size());
  if (!found.ok()) return found.status();
  for (size_t i = 0; i < large.size(); ++i) {
    const GeometryView& g = *large[i];
    const float* const positions = OnDevice(g, g.positions).data();
    uint32_t* const at = found->as<uint32_t>() + i * kWords;
    absl::Status status = device_.Run("FindBounds", [&] {
      return FindBounds(positions, static_cast<uint32_t>(g.positions.size() / 3), at,
                        device_.stream());
    });
    if (status.ok() && g.record.kind == PrimitiveKind::kTriangles) {
      const bool indexed = !g.indices.empty();
      const size_t corners = indexed ? g.indices.size() : g.positions.size() / 3;
      status = device_.Run("FindExtents", [&] {
        return FindExtents(positions, indexed ? OnDevice(g, g.indices).data() : nullptr,
                           static_cast<uint32_t>(corners / 3), at + 6, device_.stream());
      });
    }
    if (!status.ok()) return status;
  }
  absl::Status status =
      device_.ToHost(bits.data(), found->as<uint32_t>(), bits.size() * sizeof(uint32_t));
  if (status.ok()) status = device_.Wait();
  if (!status.ok()) return status;
  for (size_t i = 0; i < large.size(); ++i) {
    GeometryBounds bounds;
    for (size_t a = 0; a < 3; ++a) {
      const uint32_t* const at = &bits[i * kWords + a];
      bounds.lo[a] = static_cast<double>(FromOrderedBits(at[0]));
      bounds.hi[a] = static_cast<double>(FromOrderedBits(at[3]));
      bounds.extent[a] = static_cast<double>(std::bit_cast<float>(at[6]));
    }
    NoteBounds(bounds_, large[i]->positions.data(), bounds);
  }
  return absl::OkStatus();
}

// Returns an array of a geometry of the current delta, at its place on the device.
template <typename T>
std::span<const T> CudaVolume::OnDevice(const GeometryView& view, std::span<const T> array) const {
  if (view.bulk == nullptr) return Moved(array, arrays_begin_, arrays_->as<std::byte>());
  return Moved(array, reinterpret_cast<const std::byte*>(view.positions.data()),
               arrays_->as<std::byte>() + bulk_.at(view.positions.data()));
}

namespace {

// Copies the data of a geometry that the host reads. Bulk memory is copied too, because its owner
// may reuse it once the delta has been applied.
RetainedGeometry CopyOf(const GeometryView& view) {
  GeometryView copied = view;
  copied.bulk = nullptr;
  if (view.record.kind == PrimitiveKind::kSamples) {
    copied.indices = view.indices.first(kSampleHeadWords);
  }
  return KeepOnHost(copied);
}

// Returns whether the host reads the data of such geometries as well.
bool IsWorkedOutOnHost(PrimitiveKind kind) {
  return kind == PrimitiveKind::kImplicit || kind == PrimitiveKind::kSamples || IsCurved(kind);
}

}  // namespace

RetainedGeometry CudaVolume::Retain(const GeometryView& view) {
  if (view.record.drawn_by == DrawnBy::kCpu) return KeepOnHost(view);
  RetainedGeometry kept{view, nullptr};
  kept.view.bulk = nullptr;
  if (!view.HasArrays()) return kept;
  kept.view.positions = OnDevice(view, view.positions);
  kept.view.indices = OnDevice(view, view.indices);
  kept.view.colors = OnDevice(view, view.colors);
  const auto bounds = bounds_.find(view.positions.data());
  kept.memory = std::make_shared<DeviceArrays>(
      arrays_, bounds == bounds_.end() ? std::nullopt : std::optional(bounds->second),
      IsWorkedOutOnHost(view.record.kind) ? std::optional(CopyOf(view)) : std::nullopt);
  return kept;
}

// Returns a geometry whose arrays the host can read, for kinds that the host processes.
const GeometryView& CudaVolume::OnHost(const Drawable& drawable) {
  const RetainedGeometry& geometry = *drawable.geometry;
  const auto* const arrays = static_cast<const DeviceArrays*>(geometry.memory.get());
  // The arrays of geometries that the CPU draws are in the host's memory.
  if (geometry.view.record.drawn_by == DrawnBy::kCpu || arrays == nullptr) return geometry.view;
  return arrays->on_host->view;
}

void CudaVolume::OnLeave(Drawable& drawable) {
  Disperse(drawable.layer);
  if (pending_.erase(&drawable) > 0) return;
  const auto it = slot_of_.find(&drawable);
  if (it == slot_of_.end()) return;
  const uint32_t slot = it->second;
  slot_of_.erase(it);
  if (drawable.layer->drawn) marks_.push_back(slot);
  left_.push_back(slot);
  kept_.push_back(drawable.geometry);
  singular_ -= slots_[slot].singular ? 1 : 0;
}

void CudaVolume::OnEnter(Drawable& drawable) {
  Disperse(drawable.layer);
  pending_.insert(&drawable);
}

void CudaVolume::OnLayerLook(Layer& layer, const LayerRecord& next) {
  const LayerRecord& now = layer.record;
  if (LooksSame(now, next) || (!layer.drawn && next.visible == 0)) return;
  // It was not visible, and is added again.
  if (!layer.drawn && !(now.transform == next.transform)) return;
  if (const auto it = crowds_.find(&layer); it != crowds_.end()) {
    it->second.marks = true;
    return;
  }
  for (const Drawable* drawable : layer.drawables) {
    const auto it = slot_of_.find(drawable);
    if (it != slot_of_.end()) marks_.push_back(it->second);
  }
}

}  // namespace voxeld::gpu::cuda
