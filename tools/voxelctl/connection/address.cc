#include "tools/voxelctl/connection/address.h"

#include <sys/stat.h>
#include <unistd.h>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "daemon/address/address.h"
#include "tools/voxelctl/text/escape.h"

namespace voxeld::voxelctl {
namespace {

constexpr char kServiceSocket[] = "/run/voxeld/voxeld.sock";

// A socket that somebody else put into a shared directory is not to be trusted. The service's own
// folder only root can make, for whatever user the service runs as.
bool IsTrustedSocket(const std::string& path) {
  struct stat info {};
  return ::lstat(path.c_str(), &info) == 0 && S_ISSOCK(info.st_mode) &&
         (info.st_uid == ::geteuid() || info.st_uid == 0 || path == kServiceSocket) &&
         ::access(path.c_str(), R_OK | W_OK) == 0;
}

}  // namespace

std::string ChooseServer(const std::string& option, const Environment& environment) {
  if (!option.empty()) return option;
  if (std::string variable = environment("VOXELD_SERVER"); !variable.empty()) return variable;
  const std::string folder = environment("XDG_RUNTIME_DIR");
  const std::string candidates[] = {
      absl::StartsWith(folder, "/") ? absl::StrCat(folder, "/voxeld.sock") : "", kServiceSocket,
      absl::StrCat("/tmp/voxeld-", ::geteuid(), "/voxeld.sock")};
  for (const std::string& path : candidates) {
    if (!path.empty() && IsTrustedSocket(path)) return absl::StrCat("unix:", path);
  }
  return std::string(kDefaultTcpAddress);
}

absl::StatusOr<std::string> ServerTarget(absl::string_view address) {
  const absl::StatusOr<daemon::Address> parsed =
      daemon::ParseAddress({address.data(), address.size()});
  if (!parsed.ok()) {
    return absl::Status(parsed.status().code(), EscapeForTerminal(parsed.status().message()));
  }
  if (parsed->unix_socket) return parsed->ToString();
  if (parsed->port == 0) {
    return absl::InvalidArgumentError(
        absl::StrCat("the address \"", EscapeForTerminal(address),
                     "\" has the port 0; give HOST:PORT or unix:PATH, the port 1 to "
                     "65535"));
  }
  return absl::StrCat("dns:///", parsed->ToString());
}

}  // namespace voxeld::voxelctl
