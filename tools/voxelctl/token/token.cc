#include "tools/voxelctl/token/token.h"

#include <fcntl.h>
#include <sys/random.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_split.h"
#include "absl/time/clock.h"
#include "absl/time/time.h"
#include "daemon/access/grants.h"
#include "daemon/access/scopes.h"
#include "daemon/address/descriptor.h"

namespace voxeld::voxelctl {
namespace {

namespace access = daemon::access;

constexpr size_t kTokenBytes = 32;

absl::StatusOr<std::string> NewToken() {
  std::array<char, kTokenBytes> bytes;
  if (getrandom(bytes.data(), bytes.size(), 0) != static_cast<ssize_t>(bytes.size())) {
    return absl::ErrnoToStatus(errno, "the system gave no random bytes");
  }
  std::string text = absl::WebSafeBase64Escape(absl::string_view(bytes.data(), bytes.size()));
  return absl::StrCat("vx_", text);
}

// Appends the entry. Returns how many tokens of that name existed before.
absl::StatusOr<size_t> Append(const std::string& path, const std::string& name,
                              const std::string& text) {
  struct stat found;
  size_t of_that_name = 0;
  if (stat(path.c_str(), &found) == 0) {
    const absl::StatusOr<access::Grants> grants = access::ReadGrants(path);
    if (!grants.ok()) return grants.status();
    for (const auto& [hash, grant] : grants->tokens) of_that_name += grant.name == name ? 1 : 0;
  }
  const daemon::Descriptor file(
      open(path.c_str(), O_WRONLY | O_APPEND | O_CREAT | O_CLOEXEC | O_NOFOLLOW, 0600));
  if (!file.ok()) return absl::ErrnoToStatus(errno, path);
  // Written in one call, so that a concurrent reader sees all of it or nothing.
  if (write(file.get(), text.data(), text.size()) != static_cast<ssize_t>(text.size()) ||
      fsync(file.get()) != 0) {
    return absl::ErrnoToStatus(errno, absl::StrCat(path, " could not be written whole"));
  }
  return of_that_name;
}

}  // namespace

absl::Status MakeToken(const TokenOptions& options, Console& console) {
  const absl::StatusOr<access::Scopes> scopes = access::ParseScopes(options.scopes);
  if (!scopes.ok()) {
    return absl::InvalidArgumentError(absl::StrCat("--scopes: ", scopes.status().message()));
  }
  const absl::StatusOr<std::string> token = NewToken();
  if (!token.ok()) return token.status();
  std::vector<std::string> quoted;
  for (const absl::string_view scope : absl::StrSplit(scopes->ToString(), ' ')) {
    quoted.push_back(absl::StrCat("\"", scope, "\""));
  }
  std::string entry =
      absl::StrCat("[[token]]\nname = \"", absl::CHexEscape(options.name), "\"\nsha256 = \"",
                   access::HashOf(*token), "\"\nscopes = [", absl::StrJoin(quoted, ", "), "]\n");
  if (options.days > 0) {
    const absl::Time end = absl::Now() + absl::Hours(24) * options.days;
    absl::StrAppend(&entry,
                    "expires = ", absl::FormatTime("%Y-%m-%dT%H:%M:%SZ", end, absl::UTCTimeZone()),
                    "\n");
  }
  // Checked as the daemon will read it.
  if (absl::Status status = access::ParseGrants(entry, "the token").status(); !status.ok()) {
    return absl::InvalidArgumentError(status.message());
  }
  absl::StatusOr<size_t> before = size_t{0};
  if (!options.grants.empty()) before = Append(options.grants, options.name, "\n" + entry);
  if (!before.ok()) return before.status();
  if (console.json()) {
    console.Data(nlohmann::ordered_json{{"token", *token}, {"entry", entry}}.dump() + "\n");
    return absl::OkStatus();
  }
  console.Data(*token + "\n");
  console.Say(options.grants.empty()
                  ? absl::StrCat("for the file that security.grants names:\n\n", entry)
                  : absl::StrCat("added to ", options.grants, "; it is valid within a second"));
  if (*before > 0) {
    console.Say(absl::StrCat("tokens of the name ", options.name, " that were there stay valid: ",
                             *before, "; take their entries out when nobody uses them"));
  }
  return absl::OkStatus();
}

}  // namespace voxeld::voxelctl
