// Sessions of one side that means harm: which target, and with what input, is decided by the seed and the session's number alone.
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
  // "device": drivers and what they read, by devices; "peer": what clients, programs and pages send, by them. InvalidArgument if it is
  // another, NotFound where `corpora` has no seeds for a target.
  static absl::StatusOr<Sessions> Make(const std::string& side, uint64_t seed,
                                       const std::filesystem::path& corpora);

  // Runs it in this thread. What must hold and does not ends the process (tests/fuzz/expect.h).
  void Run(uint64_t session) const;
  // Of that session: the target's name and its input.
  struct Known {
    const char* target;
    Input input;
  };
  Known InputOf(uint64_t session) const;

 private:
  struct Attack {
    const char* target = nullptr;  // and its folder of corpora
    int (*run)(const uint8_t* data, size_t size) = nullptr;
    uint32_t weight = 0;  // sessions of that many of all
    int pieces = 0;       // inputs of the corpus in one
    size_t any_bytes =
        0;  // in three sessions of four so many at the most, in place of the corpus; 0: never
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
