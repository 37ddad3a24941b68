// A protocol's conformance suite: what a device must do, as independent cases that run in any
// order. A driver provides its own suite, and the devices that a display's options select as
// subjects.
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
  std::string title;    // what a passing device does
  std::string section;  // section of the protocol's page: "5.4"
  // Finds the device at rest, and reports its observations to the probe's check.
  std::function<void(Probe& probe)> run;
};

struct Suite {
  std::string protocol;  // "voxlink 1.0"
  std::string page;      // the page that it tests: "docs/protocols/voxlink.md"
  std::vector<Case> cases;
  // Brings the device, in whatever state it is, to rest: stopped and dark. Called before each case,
  // and at the end.
  std::function<absl::Status(Probe& probe)> rest;
};

struct Subject {
  std::string name;
  std::unique_ptr<UsbTransport> transport;  // closed
  Suite suite;
};

}  // namespace voxeld::display::conformance
