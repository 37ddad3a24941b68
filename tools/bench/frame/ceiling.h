// What a frame's time is held against: the least that its machine needs for the same bytes, and peers that draw the
// same lines. Each is timed in turns with the frames.
#pragma once

#include <cstddef>
#include <memory>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "tools/bench/frame/scene.h"

namespace voxeld::bench::frame {

class Ceiling {
 public:
  virtual ~Ceiling() = default;
  virtual std::string name() const = 0;
  // Once.
  virtual absl::Status Run() = 0;
};

// Of bytes that a frame of `scene` must read and write: read + written, as Traffic says.
size_t BytesCopied(const Scene& scene);

// memcpy on that many threads.
std::unique_ptr<Ceiling> CopyCeiling(size_t bytes, int threads);

// A volume cleared and the scene's lines drawn into it by a plain loop, on that many threads: no bins, no
// priorities, no slices.
std::unique_ptr<Ceiling> PlainLinesPeer(const Scene& scene, int threads);

}  // namespace voxeld::bench::frame
