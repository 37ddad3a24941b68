// Reads the files of play, as models or as frames.
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "absl/status/statusor.h"
#include "tools/voxelctl/cli/options.h"
#include "tools/voxelctl/commands/choose_space.h"
#include "tools/voxelctl/commands/console.h"
#include "tools/voxelctl/import/frames.h"
#include "tools/voxelctl/import/model.h"
#include "tools/voxelctl/process/interrupt.h"

namespace voxeld::voxelctl {

// Reads all files, for a display with that room. Errors: InvalidArgument with all invalid files, or
// with an option that applies to none of them.
absl::StatusOr<std::vector<Model>> ReadFiles(const PlayOptions& options, const Room& room,
                                             Interrupt& interrupt, Console& console);

// Returns: InvalidArgument if an option was given (PlayOptions::given) that applies to none of the
// models.
absl::Status CheckOptions(const PlayOptions& options, std::span<const Model> models);

// Opens a sequence or an animation. Returns null if the files are static.
absl::StatusOr<std::unique_ptr<FrameSource>> OpenFrameSource(const PlayOptions& options,
                                                             const Room& room,
                                                             Interrupt& interrupt);

}  // namespace voxeld::voxelctl
