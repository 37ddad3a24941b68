// CUDA's compiler as a library, opened at run time: what is used of it, by declarations of our own, so that
// nothing is built or shipped with it. (The names and numbers are those of its documented interface,
// https://docs.nvidia.com/cuda/nvrtc.)
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

// A source that others include by name.
struct NamedSource {
  const char* name;
  const char* text;
};

// The library. Thread-safe.
class Nvrtc {
 public:
  // Where it is looked for, in order: $VOXELD_NVRTC, what the loader finds, where CUDA is installed as a rule.
  // Nowhere if that variable is "off". `environment`: a variable's value; empty if it is not set.
  static std::vector<std::string> Places(
      const std::function<std::string(const char*)>& environment);
  // The first that there is. FailedPrecondition names all that were tried, and why not.
  static absl::StatusOr<std::shared_ptr<const Nvrtc>> Open(const std::vector<std::string>& places);
  // The first of Places that compiles for devices of that compute capability.
  static absl::StatusOr<std::shared_ptr<const Nvrtc>> OpenFor(
      const std::vector<std::string>& places, int major, int minor);
  static absl::StatusOr<std::shared_ptr<const Nvrtc>> OpenFor(int major, int minor);
  ~Nvrtc();
  Nvrtc(const Nvrtc&) = delete;
  Nvrtc& operator=(const Nvrtc&) = delete;

  // FailedPrecondition if it compiles nothing for devices of that compute capability, as one that is older than the device may.
  absl::Status Supports(int major, int minor) const;
  const std::string& place() const { return place_; }
  // A module for devices of that compute capability, rounded as the engine's own kernels are. Takes tenths of
  // a second and more. InvalidArgument has what the compiler says of a source that it does not take.
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
