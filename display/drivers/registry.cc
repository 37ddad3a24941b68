#include "display/drivers/registry.h"

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "display/drivers/driver_list.h"

namespace voxeld::display {

absl::StatusOr<std::unique_ptr<Display>> CreateDisplay(const DisplayOptions& options,
                                                       const DriverContext& context) {
  for (const Driver& driver : DriverList()) {
    if (options.driver == driver.name) return driver.create(options, context);
  }
  return absl::InvalidArgumentError(
      absl::StrCat("display \"", options.name, "\": there is no driver \"", options.driver,
                   "\"; there are ", absl::StrJoin(DriverNames(), ", ")));
}

std::vector<std::string> DriverNames() {
  std::vector<std::string> names;
  for (const Driver& driver : DriverList()) names.emplace_back(driver.name);
  return names;
}

}  // namespace voxeld::display
