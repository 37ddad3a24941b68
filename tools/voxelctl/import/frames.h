// Models that follow one another.
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

inline constexpr int64_t kMaxFrames = 1'000'000;  // of a source

// Frames by their number. Used by one thread at a time.
class FrameSource {
 public:
  virtual ~FrameSource() = default;
  virtual int64_t count() const = 0;  // at least 1
  virtual absl::StatusOr<Model> Read(int64_t frame) = 0;
};

// A file of an own format for each (IsOwnFormat).
class FileFrames final : public FrameSource {
 public:
  // `interrupt`, which may be null, outlives it.
  FileFrames(std::vector<std::string> paths, const ImportOptions& options, Interrupt* interrupt)
      : paths_(std::move(paths)), options_(options), interrupt_(interrupt) {}
  int64_t count() const override { return static_cast<int64_t>(paths_.size()); }
  absl::StatusOr<Model> Read(int64_t frame) override;

 private:
  const std::vector<std::string> paths_;
  const ImportOptions options_;
  Interrupt* const interrupt_;
};

// Whether the name of a file has a place for a number: "####" or "%04d". A file of just that name is none.
bool IsSequence(const std::string& path);

// The files that there are, in the order of their numbers. A number has as many digits as there are # (or as printf would
// write), or more without a 0 at the front. NotFound if there is none.
absl::StatusOr<std::vector<std::string>> FindSequence(const std::string& path);

// Has one frame read on a thread of its own while another is up.
class FrameAhead {
 public:
  // `source` must outlive it.
  explicit FrameAhead(FrameSource& source) : source_(source) {}
  // The frame that the next Take gives; it is read from now on.
  void Ask(int64_t frame);
  // Waits until it is there.
  absl::StatusOr<Model> Take() { return next_.get(); }

 private:
  FrameSource& source_;
  std::future<absl::StatusOr<Model>> next_;
};

}  // namespace voxeld::voxelctl
