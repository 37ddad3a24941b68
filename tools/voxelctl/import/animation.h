// Meshes and skeletons that move.
#pragma once

#include <cstddef>
#include <memory>
#include <string>

#include "absl/status/statusor.h"
#include "tools/voxelctl/import/frames.h"
#include "tools/voxelctl/import/source_file.h"
#include "tools/voxelctl/process/interrupt.h"

namespace voxeld::voxelctl {

// Animation `number`, from 1 on, of a file that assimp reads (glTF, FBX, COLLADA, BVH, …), in frames of `fps` a second from its
// beginning to its end. Meshes follow their bones; without meshes the bones are lines. InvalidArgument if there is no such
// animation, with the names of those there are; without VOXELD_IMPORTERS always.
// It is read in a process of its own (OpenContained).
absl::StatusOr<std::unique_ptr<FrameSource>> OpenAnimation(
    const std::string& path, size_t number, double fps, OtherFiles other_files = OtherFiles::kBelow,
    Interrupt* interrupt = nullptr);

}  // namespace voxeld::voxelctl
