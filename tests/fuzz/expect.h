// Conditions that must hold for every input: EXPECT_THAT_HOLDS(count == 3, "count is ", count). If
// one does not, the program terminates as if it had crashed, which is what fuzzers look for.
#pragma once

#include <cstdio>
#include <cstdlib>
#include <string>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"

namespace voxeld::fuzz {

[[noreturn]] inline void Broken(const char* file, int line, const char* what,
                                const std::string& more) {
  std::fprintf(stderr, "%s:%d: does not hold: %s %s\n", file, line, what, more.c_str());
  std::abort();
}

}  // namespace voxeld::fuzz

#define EXPECT_THAT_HOLDS(condition, ...)                                    \
  do {                                                                       \
    if (!(condition)) {                                                      \
      ::voxeld::fuzz::Broken(__FILE__, __LINE__, #condition,                 \
                             ::absl::StrCat("" __VA_OPT__(, ) __VA_ARGS__)); \
    }                                                                        \
  } while (false)

namespace voxeld::fuzz {

// Checks that an error has a message, in printable text.
inline void ExpectSays(const absl::Status& status) {
  if (status.ok()) return;
  EXPECT_THAT_HOLDS(!status.message().empty());
  for (const char c : status.message()) {
    EXPECT_THAT_HOLDS(c == '\n' || static_cast<unsigned char>(c) >= 32, status.ToString());
  }
}

}  // namespace voxeld::fuzz
