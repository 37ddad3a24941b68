// Combines many targets and hostile_exchanges in one program, which acts as the one by whose name
// it is called: what they have in common exists once. tests/fuzz/pack.py makes it, and the list of
// targets: TARGET(store, FuzzStore) for each.

#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>

extern "C" {
int HostileExchanges(int argc, char** argv);
int LLVMFuzzerInitialize(int* argc, char*** argv);
int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size);
#define TARGET(name, run) int run(const uint8_t* data, size_t size);
#include "packed_targets.inc"
#undef TARGET
}

namespace {

using Run = int (*)(const uint8_t* data, size_t size);
struct Target {
  const char* name;
  Run run;
};
constexpr Target kTargets[] = {
#define TARGET(name, run) {#name "_fuzz", run},
#include "packed_targets.inc"
#undef TARGET
};
Run chosen = nullptr;

}  // namespace

int LLVMFuzzerInitialize(int* argc, char*** argv) {
  const char* const path = (*argv)[0];
  const char* const slash = std::strrchr(path, '/');
  const char* const name = slash == nullptr ? path : slash + 1;
  if (std::strcmp(name, "hostile_exchanges") == 0) std::exit(HostileExchanges(*argc, *argv));
  for (const Target& target : kTargets) {
    if (std::strcmp(target.name, name) == 0) chosen = target.run;
  }
  if (chosen != nullptr) return 0;
  std::fprintf(stderr, "%s: there is no such target in it\n", path);
  std::exit(2);
}

int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) { return chosen(data, size); }
