// The child process that reads a file (contained.h is the parent's side).
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "tools/voxelctl/import/contained.h"
#include "tools/voxelctl/import/frames.h"
#include "tools/voxelctl/import/model.h"
#include "tools/voxelctl/import/source_file.h"

namespace voxeld::voxelctl {

// The descriptor of a reader's socket. The reader writes its answers there (model_bytes.h), and one
// that serves frames reads their numbers from it.
inline constexpr int kAnswerDescriptor = 3;

// Exit statuses of a reader, besides 0 and 1.
inline constexpr int kNotConfined = 2, kNotStarted = 3;

using OpenFrames = std::function<absl::StatusOr<std::unique_ptr<FrameSource>>(SourceFile file)>;

// Confines this process permanently, as ReadContained describes. Existing `folders` stay readable,
// for data that libraries need. Returns: false if files cannot be confined and the file is
// untrusted, so it must not be read.
bool ConfineReader(const SourceFile& file, const std::vector<std::string>& folders = {});

// Returns a reader that confines itself and answers with the model that `read` returns. It releases
// the bytes of `file`, which must outlive the result, before it answers.
ReaderMain ReaderOf(SourceFile& file, std::function<absl::StatusOr<Model>()> read);

// Returns a reader that confines itself, opens a source and serves its frames.
ReaderMain FramesOf(SourceFile file, OpenFrames open);

// Returns a reader that is a program, which confines itself and then answers (AnswerModel) or
// serves (ServeFrames). `command[0]` is its path.
ReaderMain ProgramOf(std::vector<std::string> command);

// Reads once, answers, and exits the process.
[[noreturn]] void AnswerModel(const std::function<absl::StatusOr<Model>()>& read);

// Opens the source and answers with the number of its frames, or with the error. Then it answers
// each frame number that it receives (an i64) with the frame. Exits when the socket is closed.
[[noreturn]] void ServeFrames(
    const std::function<absl::StatusOr<std::unique_ptr<FrameSource>>()>& open);

}  // namespace voxeld::voxelctl
