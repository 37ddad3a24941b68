// The verdict of one case of a conformance suite.
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
  std::string section;         // kFailed: section of the protocol's page, if it is not the case's
  std::string reason;          // kNotApplicable
};

// Returns "passed", "failed" or "not applicable".
const char* VerdictName(Verdict::Kind kind);

// Records the first deviation: a case need not check after each step, but its loops must end when
// ok() becomes false.
class Check {
 public:
  bool ok() const { return verdict_.kind == Verdict::Kind::kPassed; }
  const Verdict& verdict() const { return verdict_; }

  void Fail(std::string expected, std::string seen, std::string section = "");
  // The device lacks the feature that the case tests.
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
