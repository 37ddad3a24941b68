// Reads files in a process of its own, which a damaged or hostile file may crash, slow down or take over.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>

#include "absl/status/statusor.h"
#include "tools/voxelctl/import/frames.h"
#include "tools/voxelctl/import/model.h"
#include "tools/voxelctl/import/source_file.h"
#include "tools/voxelctl/process/interrupt.h"

namespace voxeld::voxelctl {

// Runs in a child of this process, whose descriptors are the standard streams, which lead nowhere, and that of reader_process.h.
using ReaderMain = std::function<void()>;

// What a reader may use for its answer: a model, the number of frames, or a frame. Its memory is limited where it confines itself.
struct ReaderLimits {
  double processor_s = 120;  // of processor time
  double reading_s = 600;    // from the question to the end of the answer
  uint64_t model_bytes = uint64_t{5}
                         << 30;  // more than the largest model (kMaxModelVertices and the others)
  uint64_t frame_bytes = uint64_t{1} << 30;
};

// Returns the model that `reader` answers with (ReaderOf, ProgramOf). The reader has limits and a sandbox (sandbox.h): 4 GiB of memory beside
// the program's own and four times the file, 64 descriptors, and `limits`; of files it can open those that file.other_files allows. It ends
// with this process. The bytes of `file` are the reader's alone then: they are released here.
// Errors: those of the reader; InvalidArgument if it crashed or went beyond a limit; Cancelled if `interrupt` (may be null) was requested;
// FailedPrecondition if file.other_files is kNone, as for a stranger's file, and this system has no Landlock, or if the reader is a program
// of another release.
absl::StatusOr<Model> ReadContained(SourceFile& file, const ReaderMain& reader,
                                    Interrupt* interrupt = nullptr,
                                    const ReaderLimits& limits = {});

// Returns a source of the frames that `reader` serves (FramesOf, ProgramOf), which lives as long as the result. The limits of
// time hold for opening, and for each frame. Call it on a thread that lives as long as the result.
// Errors: as above; also of each frame.
absl::StatusOr<std::unique_ptr<FrameSource>> OpenContained(SourceFile file,
                                                           const ReaderMain& reader,
                                                           Interrupt* interrupt = nullptr,
                                                           const ReaderLimits& limits = {});

}  // namespace voxeld::voxelctl
