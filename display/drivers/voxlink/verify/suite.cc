#include "display/drivers/voxlink/verify/suite.h"

#include <utility>

#include "display/drivers/voxlink/verify/cases.h"
#include "display/drivers/voxlink/verify/session.h"

namespace voxeld::display::voxlink {

conformance::Suite MakeSuite(const Configured* configured) {
  conformance::Suite suite{.protocol = "voxlink 1.0",
                           .page = "docs/protocols/voxlink.md",
                           .cases = {},
                           .rest = &BringToRest};
  AddUsbCases(suite.cases);
  AddRequestCases(suite.cases);
  if (configured != nullptr) {
    suite.cases.push_back(ConfiguredCase(*configured));
  }
  AddSessionCases(suite.cases);
  AddStreamCases(suite.cases);
  AddBeginCases(suite.cases);
  AddSliceCases(suite.cases);
  AddVolumeCases(suite.cases);
  AddHoldCases(suite.cases);
  AddEventCases(suite.cases);
  AddLightCases(suite.cases);
  return suite;
}

}  // namespace voxeld::display::voxlink
