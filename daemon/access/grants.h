// The grants file lists who may do what. It is TOML, written by hand and by `voxelctl token`.
//
//   [[token]]                     # a bearer token; only its hash is stored
//   name = "stage-left"           # the principal, which owns everything that this token draws
//   sha256 = "9f86…"              # hash of the token's text, 64 digits
//   scopes = ["view", "draw"]
//   expires = 2027-01-31T00:00:00Z    # optional
//
//   [[certificate]]               # a client certificate signed by tls_client_ca
//   name = "cube-room"
//   subject = "cube-room.example" # its common name
//   scopes = ["view"]
//
//   [[user]]                      # a local user, as the kernel reports it for a unix socket
//   name = "alice"                # a name that the system knows, or a number
//   scopes = ["view", "draw"]
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>

#include "absl/status/statusor.h"
#include "daemon/access/scopes.h"

namespace voxeld::daemon::access {

struct Grant {
  std::string name;
  Scopes scopes;
  std::optional<int64_t> expires_s;  // Unix time
};

struct Grants {
  std::map<std::string, Grant, std::less<>> tokens;        // by hash, in lower case
  std::map<std::string, Grant, std::less<>> certificates;  // by common name
  std::map<uint32_t, Grant> users;                         // by user id
};

// Limits on the size of the file and the length of a name.
inline constexpr uintmax_t kGreatestGrantsBytes = 4u << 20;
inline constexpr size_t kLongestName = 128;

// Errors: a message that lists every fault of the file, one per line, each with its line number and
// the remedy.
absl::StatusOr<Grants> ParseGrants(std::string_view text, const std::string& name);

// Reads the file. Errors include FailedPrecondition if users other than its owner and root can
// write it.
absl::StatusOr<Grants> ReadGrants(const std::string& path);

// Returns: the SHA-256 as 64 hexadecimal digits.
std::string HashOf(std::string_view token);

}  // namespace voxeld::daemon::access
