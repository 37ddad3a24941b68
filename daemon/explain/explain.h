// Why an entity is, or is not, to be seen on a display.
//
// Nothing is worked out by rules that could differ from what is shown: the scene is drawn by the CPU's
// engine, whole and in part, and the voxels and pictures are compared.
#pragma once

#include <cstdint>
#include <functional>
#include <string>

#include "absl/status/statusor.h"
#include "daemon/scene/bounds.h"
#include "daemon/scene/snapshot.h"
#include "gpu/engine.h"

namespace voxeld::daemon {

// The first of these that holds, in this order; kSeen if none does.
enum class Visibility : uint8_t {
  kSeen,
  kOutside,  // all of it lies outside the display's volume
  kNothing,  // it covers no voxel, though it lies there: too small, no inverse, nothing solid in it
  kBlack,    // it covers voxels, and lights none
  kClipped,  // the layer's clip or region leaves none of what it lights
  kMasked,   // the layer's mask leaves none
  kOwnerHidden,  // by an operator
  kLayerHidden,  // the layer is not visible
  kTransparent,  // the layer's opacity lets nothing through
  kCovered,      // others cover it, or look alike where it is
  kNoLight,  // the volume has it, no pixel of the display does: by the geometry, or by tone and dither
  kErases,  // it takes light away, and that is seen
};

struct Explanation {
  Visibility visibility = Visibility::kSeen;
  // Around it, in the display's voxels (voxel i is [i, i+1)); thickness left out.
  Bounds voxels;
  // Of the display's voxels: those it covers by itself, those of them that are not black, those that clip,
  // region and mask leave; those of the whole scene that differ by its being there.
  uint64_t covered = 0, lit = 0, left = 0, seen = 0;
  // kCovered: a layer above its own that does it, or its own; and of the latter an entity, if one alone can be
  // named.
  OwnedName by_layer;
  std::string by_entity;
};

// `scene`, drawn for `target`, as far as `layer`'s entity `id` is concerned. NotFound if there is none;
// Cancelled if `cancelled` (may be empty) says so, which is asked between drawings; else an engine's error.
// Draws the scene a few times, in the caller's thread, and holds the display's volume and pictures twice:
// ResourceExhausted above kMostExplainedVoxels.
absl::StatusOr<Explanation> Explain(const SnapshotPtr& scene, const OwnedName& layer,
                                    const std::string& id, const gpu::Target& target,
                                    const std::function<bool()>& cancelled = nullptr);

inline constexpr uint64_t kMostExplainedVoxels = uint64_t{1} << 28;

// "it is black", for people; the layers' names are escaped.
std::string Describe(const Explanation& explanation);

}  // namespace voxeld::daemon
