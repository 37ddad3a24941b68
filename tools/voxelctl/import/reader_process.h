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

// Descriptors of a reader: where it writes models (WriteModel), and the socket of one that serves frames.
inline constexpr int kModelDescriptor = 3, kChannelDescriptor = 4;

// Exit statuses of a reader, beside 0 and 1.
inline constexpr int kNotConfined = 2, kNotStarted = 3;

// Limits of a reader: processor time of one file or frame, and time from its start to its end or from frame to frame; in seconds.
inline constexpr unsigned kMostProcessorSeconds = 120, kMostReadingSeconds = 600;

using OpenFrames = std::function<absl::StatusOr<std::unique_ptr<FrameSource>>(SourceFile file)>;

// One model, or as many frames as are asked for.
enum class Answers : uint8_t { kModel, kFrames };

// Confines this process permanently, as ReadContained describes, before it sends `answers`. Those `folders` that exist stay readable, for data
// that libraries need. Returns: false if files cannot be confined and the file is a stranger's, so that it must not be read.
bool ConfineReader(const SourceFile& file, Answers answers,
                   const std::vector<std::string>& folders = {});

// A reader that confines itself and answers with the model that `read` returns.
ReaderMain ReaderOf(const SourceFile& file, std::function<absl::StatusOr<Model>()> read);

// A reader that confines itself, opens a source and serves its frames.
ReaderMain FramesOf(SourceFile file, OpenFrames open);

// A reader that is a program, which confines itself and then answers (AnswerModel) or serves (ServeFrames). `command[0]` is its path.
ReaderMain ProgramOf(std::vector<std::string> command);

// Reads once, and ends the process.
[[noreturn]] void AnswerModel(const std::function<absl::StatusOr<Model>()>& read);

// Opens the source and answers with the number of its frames; on an error, writes that with WriteModel and answers -1. Then, for each
// frame number that it receives, writes the frame and answers 0. Exits when the channel is closed.
[[noreturn]] void ServeFrames(
    const std::function<absl::StatusOr<std::unique_ptr<FrameSource>>()>& open);

}  // namespace voxeld::voxelctl
