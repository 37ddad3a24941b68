// Libraries that are opened at run time, so that nothing is built or shipped with them.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "absl/status/statusor.h"

namespace voxeld::gpu::cuda {

// A function of a library, and the pointer to set to it.
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

// Opens the first of `places` (paths, or names that the loader knows) that can be opened and has
// all of `wanted`; returns which. The library stays open permanently, because it may have threads
// of its own. Errors: FailedPrecondition names `what` and all places that were tried, and the
// reasons; the pointers of `wanted` are then undefined.
absl::StatusOr<std::string> OpenLibrary(const char* what, const std::vector<std::string>& places,
                                        std::span<const WantedFunction> wanted);

// Returns a variable of this process's environment; empty if it is not set.
std::string Environment(const char* name);

}  // namespace voxeld::gpu::cuda
