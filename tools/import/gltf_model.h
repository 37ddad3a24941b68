// glTF 2.0: text (.gltf) and binary (.glb).
//
// tinygltf reads the JSON: it is the reader of the format's own ecosystem in Debian, keeps every member as the file has it, and is a header without
// dependencies but nlohmann-json. It gets neither buffers nor pictures, and cannot open files: gltf_check.h has loaded and checked them, and
// accessors are read from there, so that a large file is in memory once.
//
// Not shown, and counted: cameras, lights, normal, occlusion, metal and roughness maps, transparency, emission over a picture, materials' further
// extensions, pictures that are neither PNG nor JPEG. Draco and meshopt compression are refused. tinygltf loses animation channels without a
// node (KHR_animation_pointer), which are counted from the JSON.
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

// `attributes`: keep vertices' attributes of one number, whose names begin with _. InvalidArgument: what is wrong with the file, and
// what is expected.
absl::StatusOr<Model> ReadGltfModel(const SourceFile& file, bool attributes = false);

// Animation `number`, from 1 on, in frames of `fps` a second. InvalidArgument if there is no such animation, with the names of those there are.
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
  size_t width = 3;           // numbers of one value
  std::vector<double> times;  // ascending; at least one
  std::vector<double>
      values;  // `width` a time; three times as many (tangent in, value, tangent out) for a cubic spline
};

// What replaces the file's values in a frame.
struct GltfPose {
  std::unordered_map<int, std::array<double, 3>> translations, scales;
  std::unordered_map<int, std::array<double, 4>> rotations;
  std::unordered_map<int, std::vector<double>> weights;
};

class GltfScene {
 public:
  // Reads and checks all but numbers in buffers, which ModelAt reads. `file` must outlive it.
  static absl::StatusOr<std::unique_ptr<GltfScene>> Load(const SourceFile& file);
  virtual ~GltfScene() = default;

  virtual std::vector<std::string> AnimationNames() const = 0;
  // `number` is from 0 on. Channels that cannot be played are counted in `left_out`.
  virtual absl::StatusOr<std::vector<GltfChannel>> ChannelsOf(size_t number, Model* left_out) = 0;
  // The scene at rest (null), or in a pose.
  virtual absl::StatusOr<Model> ModelAt(const GltfPose* pose, bool attributes) = 0;
};

}  // namespace voxeld::voxelctl
