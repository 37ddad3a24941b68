#include "tools/voxelctl/connection/address.h"

#include <sys/stat.h>
#include <unistd.h>

#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/strip.h"
#include "tools/voxelctl/text/escape.h"

namespace voxeld::voxelctl {
namespace {

// A socket that somebody else put into a shared directory is not to be trusted.
bool IsTrustedSocket(const std::string& path) {
  struct stat info {};
  return ::lstat(path.c_str(), &info) == 0 && S_ISSOCK(info.st_mode) &&
         (info.st_uid == ::geteuid() || info.st_uid == 0);
}

}  // namespace

std::string ChooseServer(const std::string& option, const Environment& environment) {
  if (!option.empty()) return option;
  if (std::string variable = environment("VOXELD_SERVER"); !variable.empty()) return variable;
  const std::string folder = environment("XDG_RUNTIME_DIR");
  const std::string candidates[] = {
      absl::StartsWith(folder, "/") ? absl::StrCat(folder, "/voxeld.sock") : "",
      "/run/voxeld/voxeld.sock", absl::StrCat("/tmp/voxeld-", ::geteuid(), "/voxeld.sock")};
  for (const std::string& path : candidates) {
    if (!path.empty() && IsTrustedSocket(path)) return absl::StrCat("unix:", path);
  }
  return std::string(kDefaultTcpAddress);
}

absl::StatusOr<std::string> ServerTarget(absl::string_view address) {
  const auto wrong = [&](absl::string_view what) {
    return absl::InvalidArgumentError(
        absl::StrCat("the server's address \"", EscapeForTerminal(address), "\" ", what,
                     "; HOST:PORT or unix:PATH is expected, such as ", kDefaultTcpAddress,
                     " or unix:/run/voxeld/voxeld.sock"));
  };
  absl::string_view rest = address;
  if (absl::ConsumePrefix(&rest, "unix:")) {
    if (rest.empty()) return wrong("has no path");
    return std::string(address);
  }
  const size_t colon = rest.rfind(':');
  if (colon == absl::string_view::npos || colon == 0) return wrong("has no host or no port");
  const absl::string_view host = rest.substr(0, colon);
  const absl::string_view digits = rest.substr(colon + 1);
  int port = 0;
  if (!absl::SimpleAtoi(digits, &port) || port < 1 || port > 65535)
    return wrong("has no port from 1 to 65535");
  const bool bracketed = absl::StartsWith(host, "[") && absl::EndsWith(host, "]");
  if (absl::StrContains(host, ":") && !bracketed)
    return wrong("is an IPv6 number without brackets");
  if (absl::StrContains(host, "/")) return wrong("has a slash in its host");
  return absl::StrCat("dns:///", host, ":", port);
}

}  // namespace voxeld::voxelctl
