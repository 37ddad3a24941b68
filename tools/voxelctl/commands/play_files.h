// What play is given, as models or as frames.
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

// Of all files, for a display with such room. InvalidArgument names all files that are wrong, or an option that none of them has a use for.
absl::StatusOr<std::vector<Model>> ReadFiles(const PlayOptions& options, const Room& room,
                                             Interrupt& interrupt, Console& console);

// Returns: InvalidArgument if an option was given (PlayOptions::given) that none of the models has a use for.
absl::Status CheckOptions(const PlayOptions& options, std::span<const Model> models);

// Of a sequence or an animation. Null if all that there is stays as it is.
absl::StatusOr<std::unique_ptr<FrameSource>> OpenFrameSource(const PlayOptions& options,
                                                             const Room& room,
                                                             Interrupt& interrupt);

}  // namespace voxeld::voxelctl
