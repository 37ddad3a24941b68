// A delta read and checked against the scene, before anything of it is applied.
#pragma once

#include <cstdint>
#include <deque>
#include <memory>
#include <span>
#include <variant>
#include <vector>

#include "absl/status/statusor.h"
#include "gpu/assemble/scene.h"
#include "gpu/delta.h"

namespace voxeld::gpu {

struct DropStep {
  Op op;
  uint64_t id;
};
struct ResetStep {};
// Layers' records are several times as large as all others, and few.
using LayerStep = std::unique_ptr<const LayerRecord>;
using DeltaStep = std::variant<GeometryView, DrawableRecord, LayerStep, DropStep, ResetStep>;

struct DeltaPlan {
  std::deque<DeltaStep> steps;  // up to millions; a deque does not copy them as it grows
  // Dropped, and not put again later in the delta. They have no users at its end.
  std::vector<uint64_t> geometries_to_erase, layers_to_erase;
};

// InvalidArgument for what ReadDelta refuses, for an id that is not new where it must be or does
// not exist where it must, and for drawables left without their geometry or layer.
absl::StatusOr<DeltaPlan> PlanDelta(std::span<const std::byte> delta, const Scene& scene,
                                    BulkSource* bulk);

}  // namespace voxeld::gpu
