#include "tools/voxelctl/text/not_built.h"

#include "absl/strings/str_cat.h"

namespace voxeld::voxelctl {

absl::Status NotBuilt(absl::string_view subject, absl::string_view state, absl::string_view option,
                      absl::string_view wanted) {
  return absl::UnimplementedError(absl::StrCat(subject, ": this build ", state,
                                               "; configure with -D", option, "=ON",
                                               wanted.empty() ? "" : " for ", wanted));
}

}  // namespace voxeld::voxelctl
