// Sequences of models.
#pragma once

#include <cstdint>
#include <future>
#include <memory>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "tools/voxelctl/import/import_options.h"
#include "tools/voxelctl/import/model.h"
#include "tools/voxelctl/process/interrupt.h"

namespace voxeld::voxelctl {

inline constexpr int64_t kMaxFrames = 1'000'000;  // per source

// Frames by number. Used by one thread at a time.
class FrameSource {
 public:
  virtual ~FrameSource() = default;
  virtual int64_t count() const = 0;  // at least 1
  virtual absl::StatusOr<Model> Read(int64_t frame) = 0;
};

// A source with one file of our own formats (IsOwnFormat) per frame.
class FileFrames final : public FrameSource {
 public:
  // `interrupt`, which may be null, must outlive the source.
  FileFrames(std::vector<std::string> paths, const ImportOptions& options, Interrupt* interrupt)
      : paths_(std::move(paths)), options_(options), interrupt_(interrupt) {}
  int64_t count() const override { return static_cast<int64_t>(paths_.size()); }
  absl::StatusOr<Model> Read(int64_t frame) override;

 private:
  const std::vector<std::string> paths_;
  const ImportOptions options_;
  Interrupt* const interrupt_;
};

// Returns whether a file name has a place for a number: "####" or "%04d". Returns false if a file
// of exactly that name exists.
bool IsSequence(const std::string& path);

// Returns the existing files, sorted by number. A number has as many digits as there are # (or as
// printf would write), or more without a leading 0. Errors: NotFound if none exist.
absl::StatusOr<std::vector<std::string>> FindSequence(const std::string& path);

// Reads one frame on a separate thread while another is shown.
class FrameAhead {
 public:
  // `source` must outlive it.
  explicit FrameAhead(FrameSource& source) : source_(source) {}
  // Starts reading the frame that the next Take returns.
  void Ask(int64_t frame);
  // Waits until the frame has been read.
  absl::StatusOr<Model> Take() { return next_.get(); }

 private:
  FrameSource& source_;
  std::future<absl::StatusOr<Model>> next_;
};

}  // namespace voxeld::voxelctl
