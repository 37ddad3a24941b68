// Reads files in a process of its own, which a damaged or hostile file may crash, slow down or take over.
#pragma once

#include <functional>
#include <memory>

#include "absl/status/statusor.h"
#include "tools/voxelctl/import/frames.h"
#include "tools/voxelctl/import/model.h"
#include "tools/voxelctl/import/source_file.h"
#include "tools/voxelctl/process/interrupt.h"

namespace voxeld::voxelctl {

// Returns what `read` returns in a copy of this process that has limits and a sandbox (sandbox.h): 4 GiB of memory beside this
// process's own and four times the file, 120 s of processor time, 10 minutes, 64 descriptors; of files it can open those that
// file.other_files allows. The copy ends with this process.
// Errors: those of `read`; InvalidArgument if it crashed or went beyond a limit; Cancelled if `interrupt` (may be null) was requested;
// FailedPrecondition if file.other_files is kNone, as for a stranger's file, and this system has no Landlock.
absl::StatusOr<Model> ReadContained(const SourceFile& file,
                                    const std::function<absl::StatusOr<Model>()>& read,
                                    Interrupt* interrupt = nullptr);

using OpenFrames = std::function<absl::StatusOr<std::unique_ptr<FrameSource>>(SourceFile file)>;

// Returns a source of frames that `open` opens, and reads, in such a copy of this process, which lives as long as the result. The limits of
// time hold for opening, and for each frame. Call it on a thread that lives as long as the result.
// Errors: those of `open`, and as above; also of each frame.
absl::StatusOr<std::unique_ptr<FrameSource>> OpenContained(SourceFile file, const OpenFrames& open,
                                                           Interrupt* interrupt = nullptr);

}  // namespace voxeld::voxelctl
