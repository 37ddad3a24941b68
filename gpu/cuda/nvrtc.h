// CUDA's compiler as a library, opened at run time: the functions that are used, with our own
// declarations, so that nothing is built or shipped with it. (The names and numbers are those of
// its documented interface, https://docs.nvidia.com/cuda/nvrtc.)
#pragma once

#include <functional>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

namespace voxeld::gpu::cuda {

// A source that other sources include by name.
struct NamedSource {
  const char* name;
  const char* text;
};

// The library. Thread-safe.
class Nvrtc {
 public:
  // Returns the places to try, in order: $VOXELD_NVRTC, the loader's path, CUDA's usual
  // installation folders. No places if that variable is "off". `environment` returns a variable's
  // value; empty if it is not set.
  static std::vector<std::string> Places(
      const std::function<std::string(const char*)>& environment);
  // Opens the first place that works. Errors: FailedPrecondition names all places that were tried,
  // and the reasons.
  static absl::StatusOr<std::shared_ptr<const Nvrtc>> Open(const std::vector<std::string>& places);
  // Opens the first of Places that can compile for devices of that compute capability.
  static absl::StatusOr<std::shared_ptr<const Nvrtc>> OpenFor(
      const std::vector<std::string>& places, int major, int minor);
  static absl::StatusOr<std::shared_ptr<const Nvrtc>> OpenFor(int major, int minor);
  ~Nvrtc();
  Nvrtc(const Nvrtc&) = delete;
  Nvrtc& operator=(const Nvrtc&) = delete;

  // Errors: FailedPrecondition if it cannot compile for devices of that compute capability, which
  // is possible if it is older than the device.
  absl::Status Supports(int major, int minor) const;
  const std::string& place() const { return place_; }
  // Returns a module for devices of that compute capability, with the same rounding as the engine's
  // own kernels. Takes tenths of a second or more. Errors: InvalidArgument with the compiler's
  // messages for an invalid source.
  absl::StatusOr<std::string> Compile(const std::string& source,
                                      std::span<const NamedSource> sources, int major,
                                      int minor) const;

 private:
  struct Functions;
  Nvrtc();

  std::string place_;
  const std::unique_ptr<Functions> functions_;
};

}  // namespace voxeld::gpu::cuda
