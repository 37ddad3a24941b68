// Upper bounds that a frame's time is compared with: the least time that the machine needs for the
// same bytes, and reference implementations that draw the same lines. Each is timed alternately
// with the frames.
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
  // Runs the reference once.
  virtual absl::Status Run() = 0;
};

// Returns the number of bytes that a frame of `scene` must read and write, added together, as its
// Traffic says.
size_t BytesCopied(const Scene& scene);

// Measures memcpy of `bytes` on `threads` threads.
std::unique_ptr<Ceiling> CopyCeiling(size_t bytes, int threads);

// Measures a plain loop on `threads` threads that clears a volume and draws the scene's lines into
// it: without bins, priorities and slices.
std::unique_ptr<Ceiling> PlainLinesPeer(const Scene& scene, int threads);

}  // namespace voxeld::bench::frame
