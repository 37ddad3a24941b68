// Libraries that are opened at run time, so that nothing is built or shipped with them.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "absl/status/statusor.h"

namespace voxeld::gpu::cuda {

// A function of a library, and the pointer that is to point to it.
class WantedFunction {
 public:
  template <typename Result, typename... Arguments>
  WantedFunction(const char* name, Result (*&function)(Arguments...))
      : name_(name), function_(&function) {
    static_assert(sizeof(function) == sizeof(void*));
  }
  const char* name() const { return name_; }
  void Set(void* found) const;

 private:
  const char* name_;
  void* function_;
};

// Opens the first of `places` (paths, or names that the loader knows) that can be and has all of `wanted`; says which. It stays
// open for good: it may have threads of its own. FailedPrecondition names `what` and all that were tried, and why not; what is wanted may
// then point anywhere.
absl::StatusOr<std::string> OpenLibrary(const char* what, const std::vector<std::string>& places,
                                        std::span<const WantedFunction> wanted);

// A variable of this process's environment; empty if it is not set.
std::string Environment(const char* name);

}  // namespace voxeld::gpu::cuda
