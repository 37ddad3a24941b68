#include "voxeld/address.h"

#include <sys/stat.h>
#include <unistd.h>

#include <cstdlib>

#include "absl/strings/str_cat.h"
#include "daemon/address/address.h"

namespace voxeld::client {
namespace {

constexpr char kServiceSocket[] = "/run/voxeld/voxeld.sock";

// A socket that another user put into a shared directory must not be trusted. Only root can create
// the service's own directory, whichever user the service runs as.
bool IsTrustedSocket(const std::string& path) {
  struct stat info {};
  return ::lstat(path.c_str(), &info) == 0 && S_ISSOCK(info.st_mode) &&
         (info.st_uid == ::geteuid() || info.st_uid == 0 || path == kServiceSocket) &&
         ::access(path.c_str(), R_OK | W_OK) == 0;
}

}  // namespace

std::string DefaultAddress(const Environment& environment) {
  if (std::string variable = environment("VOXELD_SERVER"); !variable.empty()) return variable;
  const std::string folder = environment("XDG_RUNTIME_DIR");
  const std::string candidates[] = {folder.starts_with("/") ? folder + "/voxeld.sock" : "",
                                    kServiceSocket,
                                    absl::StrCat("/tmp/voxeld-", ::geteuid(), "/voxeld.sock")};
  for (const std::string& path : candidates) {
    if (!path.empty() && IsTrustedSocket(path)) return "unix:" + path;
  }
  return std::string(kDefaultTcpAddress);
}

std::string DefaultAddress() {
  return DefaultAddress([](const char* name) -> std::string {
    const char* value = std::getenv(name);
    return value == nullptr ? "" : value;
  });
}

absl::StatusOr<std::string> ServerTarget(std::string_view address) {
  const absl::StatusOr<daemon::Address> parsed = daemon::ParseAddress(address);
  if (!parsed.ok()) return parsed.status();
  if (parsed->unix_socket) return parsed->ToString();
  if (parsed->port == 0) {
    return absl::InvalidArgumentError(
        absl::StrCat("the address \"", std::string(address),
                     "\" has the port 0; give HOST:PORT or unix:PATH, the port 1 to 65535"));
  }
  daemon::Address plain = *parsed;
  plain.tls = false;
  return absl::StrCat("dns:///", plain.ToString());
}

}  // namespace voxeld::client
