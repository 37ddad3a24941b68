// Reads files in a separate process, which a damaged or hostile file may crash, slow down or take
// over.
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

// Runs in a child of this process. Its only descriptors are the standard streams, which are
// connected to nothing, and that of reader_process.h.
using ReaderMain = std::function<void()>;

// The resources that a reader may use for its answer: a model, the number of frames, or a frame.
// The reader limits its own memory when it confines itself.
struct ReaderLimits {
  double processor_s = 120;  // of CPU time
  double reading_s = 600;    // from the request to the end of the answer
  uint64_t model_bytes = uint64_t{5}
                         << 30;  // more than the largest model (kMaxModelVertices and the others)
  uint64_t frame_bytes = uint64_t{1} << 30;
};

// Returns the model that `reader` (ReaderOf, ProgramOf) answers with. The reader has limits and a
// sandbox (sandbox.h): 4 GiB of memory in addition to the program's own and four times the file, 64
// descriptors, and `limits`. It can open the files that file.other_files allows. It ends with this
// process. Only the reader keeps the bytes of `file`: they are released here. Errors: those of the
// reader; InvalidArgument if it crashed or exceeded a limit; Cancelled if `interrupt` (may be null)
// was requested; FailedPrecondition if file.other_files is kNone, as for an untrusted file, and
// this system has no Landlock, or if the reader is a program of another release.
absl::StatusOr<Model> ReadContained(SourceFile& file, const ReaderMain& reader,
                                    Interrupt* interrupt = nullptr,
                                    const ReaderLimits& limits = {});

// Returns a source of the frames that `reader` (FramesOf, ProgramOf) serves; the reader lives as
// long as the result. The time limits apply to opening and to each frame. Requires: called on a
// thread that lives as long as the result. Errors: as above; also for each frame.
absl::StatusOr<std::unique_ptr<FrameSource>> OpenContained(SourceFile file,
                                                           const ReaderMain& reader,
                                                           Interrupt* interrupt = nullptr,
                                                           const ReaderLimits& limits = {});

}  // namespace voxeld::voxelctl
