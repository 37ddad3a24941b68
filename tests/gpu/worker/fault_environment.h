// Sets the environment of a faulty worker (faults.h, liar.h) as long as this lives.
#pragma once

#include <cstdlib>
#include <string>

namespace voxeld::gpu {

class FaultEnvironment {
 public:
  struct Fault {
    std::string frame, color, kind, lie;  // empty: not set
  };
  explicit FaultEnvironment(const Fault& fault) {
    setenv("VOXELD_FAULT_FRAME", fault.frame.c_str(), 1);
    setenv("VOXELD_FAULT_COLOR", fault.color.c_str(), 1);
    setenv("VOXELD_FAULT_KIND", fault.kind.c_str(), 1);
    setenv("VOXELD_FAULT_LIE", fault.lie.c_str(), 1);
  }
  ~FaultEnvironment() {
    for (const char* name :
         {"VOXELD_FAULT_FRAME", "VOXELD_FAULT_COLOR", "VOXELD_FAULT_KIND", "VOXELD_FAULT_LIE"}) {
      unsetenv(name);
    }
  }
  FaultEnvironment(const FaultEnvironment&) = delete;
  FaultEnvironment& operator=(const FaultEnvironment&) = delete;
};

}  // namespace voxeld::gpu
