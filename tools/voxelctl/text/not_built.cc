#include "tools/voxelctl/text/not_built.h"

#include "absl/strings/str_cat.h"

namespace voxeld::voxelctl {

absl::Status NotBuilt(absl::string_view subject, absl::string_view state, absl::string_view part,
                      absl::string_view option) {
  // Only the importers need packages that the default tier of tools/setup does not install.
  const absl::string_view packages = option == "VOXELD_IMPORTERS" ? "tools/setup --import && " : "";
  return absl::UnimplementedError(absl::StrCat(
      subject, ": this build ", state, "; to add ", part, ", run in the source tree: ", packages,
      "cmake --preset demo -D", option, "=ON && cmake --build --preset demo -j $(tools/jobs)"));
}

}  // namespace voxeld::voxelctl
