// The cases of voxlink's conformance suite, by the sections of docs/protocols/voxlink.md.
#pragma once

#include <vector>

#include "display/conformance/suite.h"
#include "display/drivers/voxlink/verify/suite.h"

namespace voxeld::display::voxlink {

using Cases = std::vector<conformance::Case>;

// Checks that the device can be driven as a display's options say.
conformance::Case ConfiguredCase(const Configured& configured);

void AddUsbCases(Cases& cases);      // §3
void AddRequestCases(Cases& cases);  // §4.1 to §4.4
void AddSessionCases(Cases& cases);  // §4.5
void AddStreamCases(Cases& cases);   // §5.1
void AddBeginCases(Cases& cases);    // §5.2
void AddSliceCases(Cases& cases);    // §5.3
void AddVolumeCases(Cases& cases);   // §5.4
void AddHoldCases(Cases& cases);     // §5.5
void AddEventCases(Cases& cases);    // §6, §7
void AddLightCases(Cases& cases);    // §4 and §8: brightness, blank, watchdog

}  // namespace voxeld::display::voxlink
