// The scenes whose frames are measured; they are the same for one seed on every machine.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "gpu/delta.h"
#include "gpu/engine.h"

namespace voxeld::bench::frame {

// A geometry and the one drawable that puts it into a layer. The code that writes it into a delta
// sets the id and the counts of `record`.
struct Content {
  gpu::GeometryRecord record;
  std::vector<float> positions;
  std::vector<uint32_t> indices, colors;
  uint64_t layer = 1;
  uint32_t priority = 0, erase = 0;
  gpu::Affine transform;
};

// The traffic that the frame's time is also compared with.
enum class Traffic {
  // A copy that reads and writes as many bytes as the volume and the slice images together.
  kPictures,  // a copy of the frame's bytes
  kVolumeAndPictures,
};

// A scene in voxel coordinates: its view is the identity.
struct Scene {
  std::string name;  // of the row: "lines1g", "moving, 5 % of the lines"
  gpu::Target target;
  std::vector<gpu::LayerRecord> layers;
  std::vector<Content> contents;
  // If not empty, every frame replaces one of the two by the other. Otherwise every layer moves by
  // one voxel along x, there and back, and nothing leaves the volume: the draw list stays the same,
  // and all of it is drawn again.
  std::array<std::vector<Content>, 2> changing;
  // Voxels that a frame draws, each counted as often as something covers it; those of `changing`
  // alone if that is not empty. 0 if they cannot be counted from outside: the engine's count of lit
  // voxels is used instead.
  uint64_t voxels = 0;
  uint64_t scene_voxels = 0;      // of the whole scene
  double volumes_per_second = 0;  // the display's rate; 0: as fast as possible
  bool slicing_only = false;      // slice_ns is what is measured
  Traffic traffic = Traffic::kPictures;
  bool in_device =
      false;  // on a GPU, copy within its memory; otherwise copy the slice images to the host
  bool plain_peer = false;  // also measured against a plain loop over the same lines
};

// Makes a scene when its turn comes, because some are large. Fails if a description that it needs
// cannot be read.
using MakeScene = std::function<absl::StatusOr<Scene>()>;

// Returns the names of all scenes: "lines1g", …
std::vector<std::string> SceneNames();

// Returns the rows of a scene of SceneNames(). `share`, above 0 and up to 1, is the share of its
// primitives to keep.
std::vector<MakeScene> ScenesOf(const std::string& name, uint64_t seed, double share);

}  // namespace voxeld::bench::frame
