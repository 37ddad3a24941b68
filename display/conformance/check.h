// What becomes of one case of a conformance suite.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "absl/strings/str_cat.h"

namespace voxeld::display::conformance {

struct Verdict {
  enum class Kind : uint8_t { kPassed, kFailed, kNotApplicable };
  Kind kind = Kind::kPassed;
  std::string expected, seen;  // kFailed
  std::string section;         // kFailed: of the protocol's page, where it is not the case's
  std::string reason;          // kNotApplicable
};

// "passed", "failed", "not applicable".
const char* VerdictName(Verdict::Kind kind);

// Remembers the first thing that was not as it should be: a case need not look after each step, but
// its loops end when ok() does not hold any more.
class Check {
 public:
  bool ok() const { return verdict_.kind == Verdict::Kind::kPassed; }
  const Verdict& verdict() const { return verdict_; }

  void Fail(std::string expected, std::string seen, std::string section = "");
  // The device does not have what the case is about.
  void NotApplicable(std::string reason);

  void Expect(bool holds, std::string_view expected, std::string_view seen) {
    if (!holds) Fail(std::string(expected), std::string(seen));
  }
  template <typename T>
  void Equal(std::string_view what, const T& want, const T& got) {
    if (want == got) return;
    const absl::string_view name(what.data(), what.size());
    Fail(absl::StrCat(name, " ", want), absl::StrCat(name, " ", got));
  }

 private:
  Verdict verdict_;
};

}  // namespace voxeld::display::conformance
