// The scenes whose frames are measured, the same for one seed on every machine.
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

// A geometry and the one drawable that puts it into a layer; of `record` the id and the counts are
// whoever's who writes it into a delta.
struct Content {
  gpu::GeometryRecord record;
  std::vector<float> positions;
  std::vector<uint32_t> indices, colors;
  uint64_t layer = 1;
  uint32_t priority = 0, erase = 0;
  gpu::Affine transform;
};

// What the frame's time is compared with, besides.
enum class Traffic {
  kPictures,  // a copy of the frame's bytes
  kVolumeAndPictures,  // a copy that reads and writes as many bytes as the volume and the pictures have together
};

// In voxel coordinates: the view is the identity.
struct Scene {
  std::string name;  // of the row: "lines1g", "moving, 5 % of the lines"
  gpu::Target target;
  std::vector<gpu::LayerRecord> layers;
  std::vector<Content> contents;
  // Not empty: in every frame the one takes the other's place. Else every layer moves by one voxel along x, there
  // and back, and nothing leaves the volume: the draw list is the same, and all of it is drawn anew.
  std::array<std::vector<Content>, 2> changing;
  // That a frame draws, each as often as something covers it: of `changing` alone where that is not empty.
  // 0: not to be counted from outside; the engine's count of those that came out lit stands for it.
  uint64_t voxels = 0;
  uint64_t scene_voxels = 0;      // of all
  double volumes_per_second = 0;  // that the display shows; 0: as fast as may be
  bool slicing_only = false;      // what is measured is slice_ns
  Traffic traffic = Traffic::kPictures;
  bool in_device =
      false;  // on a GPU that copy is within its memory; else of the pictures to the host
  bool plain_peer = false;  // measured beside a plain loop over the same lines
};

// Made when it is its turn: some are large. An error: a description that it is made of cannot be read.
using MakeScene = std::function<absl::StatusOr<Scene>()>;

// "lines1g", …
std::vector<std::string> SceneNames();

// The rows of a scene of SceneNames(). `share`, above 0 and up to 1: of its primitives.
std::vector<MakeScene> ScenesOf(const std::string& name, uint64_t seed, double share);

}  // namespace voxeld::bench::frame
