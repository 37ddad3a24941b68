// Reads glTF 2.0: text (.gltf) and binary (.glb).
//
// tinygltf reads the JSON: it is the reader from the format's own ecosystem in Debian, keeps every
// member as it is in the file, and is a header whose only dependency is nlohmann-json. It gets
// neither buffers nor pictures and cannot open files: gltf_check.h has loaded and checked them, and
// accessors are read from there, so a large file is in memory only once.
//
// The following are not shown but counted: cameras, lights, normal, occlusion, metal and roughness
// maps, transparency, emission over a picture, further extensions of materials, and pictures that
// are neither PNG nor JPEG. Draco and meshopt compression are refused. tinygltf loses animation
// channels without a node (KHR_animation_pointer), so these are counted from the JSON.
#pragma once

#include <array>
#include <cstddef>
#include <memory>
#include <string>
#include <unordered_map>
#include <vector>

#include "absl/status/statusor.h"
#include "tools/voxelctl/import/frames.h"
#include "tools/voxelctl/import/model.h"
#include "tools/voxelctl/import/source_file.h"

namespace voxeld::voxelctl {

// Reads a model. With `attributes`, keeps scalar vertex attributes whose names begin with _.
// Errors: InvalidArgument with what is wrong with the file and what was expected.
absl::StatusOr<Model> ReadGltfModel(const SourceFile& file, bool attributes = false);

// Opens animation `number`, from 1, with frames at `fps` per second. Errors: InvalidArgument if
// the animation does not exist, with the names of the existing ones.
absl::StatusOr<std::unique_ptr<FrameSource>> OpenGltfAnimation(SourceFile file, size_t number,
                                                               double fps);

// The declarations below are internal to these two functions.

enum class GltfPath { kTranslation, kRotation, kScale, kWeights };
enum class GltfInterpolation { kLinear, kStep, kCubicSpline };

// One property of one node over time.
struct GltfChannel {
  int node = 0;
  GltfPath path = GltfPath::kTranslation;
  GltfInterpolation interpolation = GltfInterpolation::kLinear;
  size_t width = 3;           // numbers per value
  std::vector<double> times;  // ascending; not empty
  // `width` per time; three times as many (in-tangent, value, out-tangent) for a cubic spline.
  std::vector<double> values;
};

// The values that replace the file's values in a frame.
struct GltfPose {
  std::unordered_map<int, std::array<double, 3>> translations, scales;
  std::unordered_map<int, std::array<double, 4>> rotations;
  std::unordered_map<int, std::vector<double>> weights;
};

class GltfScene {
 public:
  // Reads and checks everything except numbers in buffers, which ModelAt reads. `file` must outlive
  // it.
  static absl::StatusOr<std::unique_ptr<GltfScene>> Load(const SourceFile& file);
  virtual ~GltfScene() = default;

  virtual std::vector<std::string> AnimationNames() const = 0;
  // `number` counts from 0. Channels that cannot be played are counted in `left_out`.
  virtual absl::StatusOr<std::vector<GltfChannel>> ChannelsOf(size_t number, Model* left_out) = 0;
  // Returns the scene in `pose`, or at rest if `pose` is null.
  virtual absl::StatusOr<Model> ModelAt(const GltfPose* pose, bool attributes) = 0;
};

}  // namespace voxeld::voxelctl
