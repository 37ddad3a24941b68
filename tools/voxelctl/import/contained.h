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

// Runs in a child of this process, whose descriptors are the standard streams, which lead nowhere, and those of reader_process.h.
using ReaderMain = std::function<void()>;

// Returns the model that `reader` answers with (ReaderOf, ProgramOf). The reader has limits and a sandbox (sandbox.h): 4 GiB of memory beside
// the program's own and four times the file, 120 s of processor time, 10 minutes, 64 descriptors; of files it can open those that
// file.other_files allows. It ends with this process.
// Errors: those of the reader; InvalidArgument if it crashed or went beyond a limit; Cancelled if `interrupt` (may be null) was requested;
// FailedPrecondition if file.other_files is kNone, as for a stranger's file, and this system has no Landlock.
absl::StatusOr<Model> ReadContained(const SourceFile& file, const ReaderMain& reader,
                                    Interrupt* interrupt = nullptr);

// Returns a source of the frames that `reader` serves (FramesOf, ProgramOf), which lives as long as the result. The limits of
// time hold for opening, and for each frame. Call it on a thread that lives as long as the result.
// Errors: as above; also of each frame.
absl::StatusOr<std::unique_ptr<FrameSource>> OpenContained(SourceFile file,
                                                           const ReaderMain& reader,
                                                           Interrupt* interrupt = nullptr);

}  // namespace voxeld::voxelctl
