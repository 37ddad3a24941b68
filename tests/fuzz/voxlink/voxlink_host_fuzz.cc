// The driver, and a device that lies: a script determines its description of itself, its events,
// its statuses and how transfers end.

#include <cstdint>

#include "tests/fuzz/script.h"
#include "tests/fuzz/voxlink/host_session.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  voxeld::fuzz::Script script(data, size);
  voxeld::fuzz::HostSession(script).Run();
  return 0;
}
