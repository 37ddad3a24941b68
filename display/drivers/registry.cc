#include "display/drivers/registry.h"

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "display/drivers/driver_list.h"

namespace voxeld::display {
namespace {

absl::StatusOr<const Driver*> FindDriver(const DisplayOptions& options) {
  for (const Driver& driver : DriverList()) {
    if (options.driver == driver.name) return &driver;
  }
  return absl::InvalidArgumentError(
      absl::StrCat("display \"", options.name, "\": there is no driver \"", options.driver,
                   "\"; there are ", absl::StrJoin(DriverNames(), ", ")));
}

}  // namespace

absl::StatusOr<std::unique_ptr<Display>> CreateDisplay(const DisplayOptions& options,
                                                       const DriverContext& context) {
  const absl::StatusOr<const Driver*> driver = FindDriver(options);
  if (!driver.ok()) return driver.status();
  return (*driver)->create(options, context);
}

absl::StatusOr<std::vector<conformance::Subject>> VerifySubjects(const DisplayOptions& options,
                                                                 const DriverContext& context) {
  const absl::StatusOr<const Driver*> driver = FindDriver(options);
  if (!driver.ok()) return driver.status();
  return (*driver)->verify(options, context);
}

std::vector<std::string> DriverNames() {
  std::vector<std::string> names;
  for (const Driver& driver : DriverList()) names.emplace_back(driver.name);
  return names;
}

}  // namespace voxeld::display
