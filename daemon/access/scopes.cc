#include "daemon/access/scopes.h"

#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_split.h"
#include "common/text/printable.h"

namespace voxeld::daemon::access {
namespace {

constexpr Scope kScopes[] = {Scope::kView, Scope::kDraw, Scope::kControl};

}  // namespace

const char* ScopeName(Scope scope) {
  switch (scope) {
    case Scope::kView:
      return "view";
    case Scope::kDraw:
      return "draw";
    case Scope::kControl:
      return "control";
  }
  return "";
}

std::string Scopes::ToString() const {
  std::vector<const char*> names;
  for (const Scope scope : kScopes) {
    if (Has(scope)) names.push_back(ScopeName(scope));
  }
  return names.empty() ? "none" : absl::StrJoin(names, " ");
}

std::string Scopes::Sentence() const {
  std::string text;
  int left = 0;
  for (const Scope scope : kScopes) left += Has(scope) ? 1 : 0;
  if (left == 0) return "none";
  for (const Scope scope : kScopes) {
    if (!Has(scope)) continue;
    absl::StrAppend(&text, ScopeName(scope), left > 2 ? ", " : left == 2 ? " and " : "");
    --left;
  }
  return text;
}

absl::StatusOr<Scopes> ParseScopes(std::string_view text) {
  const absl::string_view view(text.data(), text.size());
  if (view == "all") return Scopes::All();
  Scopes scopes;
  if (view == "none") return scopes;
  for (const absl::string_view word :
       absl::StrSplit(view, absl::ByAnyChar(", "), absl::SkipEmpty())) {
    bool known = false;
    for (const Scope scope : kScopes) {
      if (word != ScopeName(scope)) continue;
      scopes.Add(scope);
      known = true;
    }
    if (!known) {
      return absl::InvalidArgumentError(
          absl::StrCat("the scope \"", EscapeQuoted(word),
                       "\" is none; there are view, draw, control, and all or none alone"));
    }
  }
  if (scopes.empty()) {
    return absl::InvalidArgumentError(
        "no scope is given; there are view, draw, control, and all or none alone");
  }
  return scopes;
}

}  // namespace voxeld::daemon::access
