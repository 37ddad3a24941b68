#include "gpu/cuda/opened_library.h"

#include <dlfcn.h>

#include <cstdlib>
#include <cstring>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"

namespace voxeld::gpu::cuda {
namespace {

// Returns the name of a missing function; null if none is missing.
const char* Find(void* library, std::span<const WantedFunction> wanted) {
  for (const WantedFunction& function : wanted) {
    void* const found = dlsym(library, function.name());
    if (found == nullptr) return function.name();
    function.Set(found);
  }
  return nullptr;
}

}  // namespace

void WantedFunction::Set(void* found) const { std::memcpy(function_, &found, sizeof(found)); }

absl::StatusOr<std::string> OpenLibrary(const char* what, const std::vector<std::string>& places,
                                        std::span<const WantedFunction> wanted) {
  std::vector<std::string> why;
  for (const std::string& place : places) {
    void* const library = dlopen(place.c_str(), RTLD_NOW | RTLD_LOCAL);
    if (library == nullptr) {
      const char* const error = dlerror();  // begins with the name
      why.push_back(error != nullptr ? error : absl::StrCat(place, ": cannot be opened"));
      continue;
    }
    const char* const missing = Find(library, wanted);
    if (missing == nullptr) return place;
    dlclose(library);
    why.push_back(absl::StrCat(place, ": has no ", missing));
  }
  return absl::FailedPreconditionError(
      absl::StrCat(what, " is not to be had; tried ", absl::StrJoin(why, "; ")));
}

std::string Environment(const char* name) {
  const char* const value = std::getenv(name);
  return value != nullptr ? value : "";
}

}  // namespace voxeld::gpu::cuda
