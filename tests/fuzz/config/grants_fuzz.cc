// The grants file, and the callers that it identifies.

#include <cstdint>
#include <set>
#include <string>
#include <string_view>

#include "absl/strings/match.h"
#include "absl/strings/str_split.h"
#include "daemon/access/grants.h"
#include "daemon/access/scopes.h"
#include "tests/fuzz/expect.h"

namespace voxeld::fuzz {
namespace {

using namespace voxeld::daemon::access;  // NOLINT(google-build-using-namespace)

void CheckGrant(const Grant& grant) {
  EXPECT_THAT_HOLDS(!grant.name.empty() && grant.name.size() <= kLongestName);
  const absl::StatusOr<Scopes> again = ParseScopes(grant.scopes.ToString());
  EXPECT_THAT_HOLDS(again.ok() && *again == grant.scopes);
  EXPECT_THAT_HOLDS(!grant.scopes.Sentence().empty());
}

}  // namespace
}  // namespace voxeld::fuzz

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace voxeld;                  // NOLINT(google-build-using-namespace)
  using namespace voxeld::daemon::access;  // NOLINT(google-build-using-namespace)
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  const std::string hash = HashOf(text);  // as if a caller presented the text as its token
  EXPECT_THAT_HOLDS(
      hash.size() == 64 && hash.find_first_not_of("0123456789abcdef") == std::string::npos, hash);
  const absl::StatusOr<Scopes> scopes = ParseScopes(text);
  if (scopes.ok()) {
    EXPECT_THAT_HOLDS(*ParseScopes(scopes->ToString()) == *scopes);
  } else {
    fuzz::ExpectSays(scopes.status());
  }
  const absl::StatusOr<Grants> grants = ParseGrants(text, "file");
  if (!grants.ok()) {
    fuzz::ExpectSays(grants.status());
    for (const absl::string_view line : absl::StrSplit(grants.status().message(), '\n')) {
      EXPECT_THAT_HOLDS(!line.empty(), "an empty line among the faults");
    }
    return 0;
  }
  for (const auto& [hash, grant] : grants->tokens) {
    EXPECT_THAT_HOLDS(hash.size() == 64, hash);
    for (const char c : hash) EXPECT_THAT_HOLDS((c >= '0' && c <= '9') || (c >= 'a' && c <= 'f'));
    fuzz::CheckGrant(grant);
  }
  for (const auto& [subject, grant] : grants->certificates) {
    EXPECT_THAT_HOLDS(!subject.empty());
    fuzz::CheckGrant(grant);
  }
  for (const auto& [user, grant] : grants->users) fuzz::CheckGrant(grant);
  return 0;
}
