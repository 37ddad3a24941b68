// A protocol's conformance suite: what a device must do, case by case, each by itself and in any
// order. A driver brings its own and gives the devices that a display's options mean as subjects.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "display/conformance/probe.h"
#include "display/usb/usb_transport.h"

namespace voxeld::display::conformance {

struct Case {
  std::string id;       // "volume.whole": unique in its suite, never changed once published
  std::string title;    // what the device does that passes
  std::string section;  // of the protocol's page: "5.4"
  // Finds the device at rest, and says what it saw to the probe's check.
  std::function<void(Probe& probe)> run;
};

struct Suite {
  std::string protocol;  // "voxlink 1.0"
  std::string page;      // of what it is held to: "docs/protocols/voxlink.md"
  std::vector<Case> cases;
  // Brings the device, whatever state it is in, to rest: stopped and dark. Before each case, and at
  // the end.
  std::function<absl::Status(Probe& probe)> rest;
};

struct Subject {
  std::string name;
  std::unique_ptr<UsbTransport> transport;  // closed
  Suite suite;
};

}  // namespace voxeld::display::conformance
