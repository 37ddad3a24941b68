// The file of who may what: TOML, made by hand and by `voxelctl token`.
//
//   [[token]]                     # a bearer token, of which only the hash is kept
//   name = "stage-left"           # the principal: what it draws belongs to this name
//   sha256 = "9f86…"              # of the token's text, 64 digits
//   scopes = ["view", "draw"]
//   expires = 2027-01-31T00:00:00Z    # or not at all
//
//   [[certificate]]               # a client certificate that tls_client_ca has signed
//   name = "cube-room"
//   subject = "cube-room.example" # its common name
//   scopes = ["view"]
//
//   [[user]]                      # of this machine, over a unix socket, by the kernel's word
//   name = "alice"                # as the system knows it, or a number
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
  std::map<std::string, Grant, std::less<>> tokens;        // by hash, lower case
  std::map<std::string, Grant, std::less<>> certificates;  // by common name
  std::map<uint32_t, Grant> users;                         // by number
};

// Greatest file, and longest name.
inline constexpr uintmax_t kGreatestGrantsBytes = 4u << 20;
inline constexpr size_t kLongestName = 128;

// Every fault of the file is in the message, one a line, each with its line and what would be right.
absl::StatusOr<Grants> ParseGrants(std::string_view text, const std::string& name);

// Reads the file. FailedPrecondition if others than its owner and root may write it.
absl::StatusOr<Grants> ReadGrants(const std::string& path);

// SHA-256 in 64 digits.
std::string HashOf(std::string_view token);

}  // namespace voxeld::daemon::access
