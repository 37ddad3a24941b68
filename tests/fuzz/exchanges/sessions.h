// Sessions with one malicious side: the seed and the session's number alone determine the target
// and its input.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "tests/fuzz/exchanges/mutate.h"

namespace voxeld::fuzz {

class Sessions {
 public:
  // `side` is "device" (drivers and what they read, attacked by devices) or "peer" (clients,
  // programs and pages).
  // Errors: InvalidArgument for another side, NotFound if `corpora` has no seeds for a target.
  static absl::StatusOr<Sessions> Make(const std::string& side, uint64_t seed,
                                       const std::filesystem::path& corpora);

  // Runs a session in this thread. If something that must hold does not, the process is terminated
  // (tests/fuzz/expect.h).
  void Run(uint64_t session) const;
  // The target's name and the input of a session.
  struct Known {
    const char* target;
    Input input;
  };
  Known InputOf(uint64_t session) const;

 private:
  struct Attack {
    const char* target = nullptr;  // and the folder of its corpora
    int (*run)(const uint8_t* data, size_t size) = nullptr;
    uint32_t weight = 0;  // the number of sessions, out of all
    int pieces = 0;       // inputs of the corpus in one session
    size_t any_bytes =
        0;  // in three sessions of four, up to that many random bytes in place of the corpus; 0:
            // never
    std::vector<Input> corpus = {};
  };
  struct Chosen {
    const Attack* attack;
    Input input;
  };

  Chosen Choose(uint64_t session) const;

  uint64_t seed_ = 0;
  std::vector<Attack> attacks_;
  uint32_t weights_ = 0;
};

}  // namespace voxeld::fuzz
