// Explains why an entity is visible or invisible on a display.
//
// The explanation cannot differ from what is shown: the CPU engine draws the scene, whole and in
// part, and the voxels and slice images are compared.
#pragma once

#include <cstdint>
#include <functional>
#include <string>

#include "absl/status/statusor.h"
#include "daemon/scene/bounds.h"
#include "daemon/scene/snapshot.h"
#include "gpu/engine.h"

namespace voxeld::daemon {

// The first of these that applies, in this order; kSeen if none does.
enum class Visibility : uint8_t {
  kSeen,
  kOutside,  // lies entirely outside the display's volume
  // Covers no voxel although it lies inside: it is too small, its transform has no inverse, or it
  // contains nothing solid.
  kNothing,
  kBlack,        // covers voxels but lights none
  kClipped,      // the layer's clip or region removes everything it lights
  kMasked,       // the layer's mask removes everything it lights
  kOwnerHidden,  // hidden by an operator
  kLayerHidden,  // the layer is invisible
  kTransparent,  // the layer's opacity is 0
  kCovered,      // others cover it, or look the same in its place
  // Changes voxels but no pixel of the display, because of the geometry, or of tone and dither.
  kNoLight,
  kErases,  // removes light, visibly
};

struct Explanation {
  Visibility visibility = Visibility::kSeen;
  // Bounds in the display's voxels (voxel i is [i, i+1)), without thickness.
  Bounds voxels;
  // Numbers of voxels of the display: covered by the entity alone; of these, not black; left by
  // clip, region and mask; and changed by the entity in the whole scene.
  uint64_t covered = 0, lit = 0, left = 0, seen = 0;
  // For kCovered: the layer that covers the entity. If it is the entity's own layer, `by_entity`
  // names the covering entity, if a single one covers it.
  OwnedName by_layer;
  std::string by_entity;
};

// Explains entity `id` of `layer` in `scene`, drawn for `target`. Draws the scene several times in
// the caller's thread, and holds the display's volume and slice images twice. `cancelled` may be
// empty; it is called between drawings. Errors: NotFound if the entity does not exist; Cancelled if
// `cancelled` returns true; ResourceExhausted above kMostExplainedVoxels; else the engine's error.
absl::StatusOr<Explanation> Explain(const SnapshotPtr& scene, const OwnedName& layer,
                                    const std::string& id, const gpu::Target& target,
                                    const std::function<bool()>& cancelled = nullptr);

inline constexpr uint64_t kMostExplainedVoxels = uint64_t{1} << 28;

// Returns: a sentence for people, such as "it is black". Layer names are escaped.
std::string Describe(const Explanation& explanation);

}  // namespace voxeld::daemon
