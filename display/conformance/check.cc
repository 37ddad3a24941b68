#include "display/conformance/check.h"

#include <utility>

namespace voxeld::display::conformance {

const char* VerdictName(Verdict::Kind kind) {
  switch (kind) {
    case Verdict::Kind::kPassed:
      return "passed";
    case Verdict::Kind::kFailed:
      return "failed";
    case Verdict::Kind::kNotApplicable:
      return "not applicable";
  }
  return "unknown";
}

void Check::Fail(std::string expected, std::string seen, std::string section) {
  if (!ok()) return;
  verdict_ = {.kind = Verdict::Kind::kFailed,
              .expected = std::move(expected),
              .seen = std::move(seen),
              .section = std::move(section)};
}

void Check::NotApplicable(std::string reason) {
  if (!ok()) return;
  verdict_ = {.kind = Verdict::Kind::kNotApplicable, .reason = std::move(reason)};
}

}  // namespace voxeld::display::conformance
