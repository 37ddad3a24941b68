#include "daemon/address/address.h"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <cstring>
#include <filesystem>
#include <system_error>
#include <utility>

#include "absl/strings/str_cat.h"
#include "daemon/address/descriptor.h"

namespace voxeld::daemon {
namespace {

constexpr std::string_view kUnixPrefix = "unix:";
constexpr std::string_view kTlsPrefix = "tls:";
constexpr size_t kPathBytes = sizeof(sockaddr_un::sun_path) - 1;

absl::string_view View(std::string_view text) { return {text.data(), text.size()}; }

absl::Status Wrong(std::string_view text, absl::string_view why) {
  return absl::InvalidArgumentError(
      absl::StrCat("the address \"", View(text), "\" ", why,
                   "; give HOST:PORT, tls:HOST:PORT or unix:PATH, such as "
                   "127.0.0.1:50551, tls:0.0.0.0:50552 or unix:/run/voxeld/voxeld.sock"));
}

absl::StatusOr<Address> ParseUnix(std::string_view text) {
  Address address;
  address.unix_socket = true;
  std::string_view path = text.substr(kUnixPrefix.size());
  if (path.starts_with("//")) path.remove_prefix(2);  // unix:///path
  if (path.empty() || path.front() != '/') return Wrong(text, "has no absolute path");
  while (path.starts_with("//")) path.remove_prefix(1);  // so that ToString can be parsed back
  if (path.size() > kPathBytes) {
    return Wrong(text, absl::StrCat("has a path of ", path.size(), " bytes, and ", kPathBytes,
                                    " is the most that a unix socket can have"));
  }
  if (path.find('\0') != std::string_view::npos) return Wrong(text, "has a zero byte");
  address.path = std::string(path);
  return address;
}

absl::Status PrepareUnix(const Address& address) {
  const std::filesystem::path folder = std::filesystem::path(address.path).parent_path();
  std::error_code error;
  if (!std::filesystem::exists(folder, error)) {
    std::filesystem::create_directory(folder, error);
    if (!error) {
      std::filesystem::permissions(folder, std::filesystem::perms::owner_all, error);
    }
    if (error) {
      return absl::ErrnoToStatus(
          error.value(), absl::StrCat("the folder ", folder.string(), " of ", address.ToString(),
                                      " cannot be made"));
    }
  }
  // Another user who owns the folder (in /tmp, for example) could replace its contents at any time.
  struct stat owner;
  if (stat(folder.c_str(), &owner) == 0 && owner.st_uid != geteuid() && owner.st_uid != 0) {
    return absl::PermissionDeniedError(absl::StrCat("the folder ", folder.string(), " of ",
                                                    address.ToString(), " belongs to user ",
                                                    owner.st_uid, "; it must be yours or root's"));
  }
  struct stat found;
  if (lstat(address.path.c_str(), &found) != 0) return absl::OkStatus();
  if (!S_ISSOCK(found.st_mode)) {
    return absl::AlreadyExistsError(absl::StrCat(
        address.path, " is there and is no socket; move it away, or listen elsewhere"));
  }
  const Descriptor probe(socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
  sockaddr_un name = {};
  name.sun_family = AF_UNIX;
  std::memcpy(name.sun_path, address.path.data(), address.path.size());
  // EPROTOTYPE means that a server listens, but not on a stream socket.
  if (connect(probe.get(), reinterpret_cast<const sockaddr*>(&name), sizeof(name)) == 0 ||
      errno == EAGAIN || errno == EINPROGRESS || errno == EPROTOTYPE) {
    return absl::AlreadyExistsError(
        absl::StrCat("somebody listens on ", address.ToString(),
                     " already; end that, or give another address with --listen"));
  }
  if (errno != ECONNREFUSED) {
    return absl::ErrnoToStatus(
        errno, absl::StrCat("whether somebody listens on ", address.ToString(), " is not known"));
  }
  if (unlink(address.path.c_str()) != 0) {
    return absl::ErrnoToStatus(
        errno, absl::StrCat("the left-over socket ", address.path, " cannot be removed"));
  }
  return absl::OkStatus();
}

}  // namespace

std::string Address::ToString() const {
  if (unix_socket) return absl::StrCat("unix:", path);
  const bool brackets = host.find(':') != std::string::npos;
  return absl::StrCat(tls ? View(kTlsPrefix) : "", brackets ? "[" : "", host, brackets ? "]:" : ":",
                      port);
}

bool Address::is_local() const {
  if (unix_socket || host == "localhost") return true;
  in_addr v4;
  if (inet_pton(AF_INET, host.c_str(), &v4) == 1) return (ntohl(v4.s_addr) >> 24) == 127;
  in6_addr v6;
  return inet_pton(AF_INET6, host.c_str(), &v6) == 1 && IN6_IS_ADDR_LOOPBACK(&v6);
}

absl::StatusOr<Address> ParseAddress(std::string_view text) {
  if (text.starts_with(kUnixPrefix)) return ParseUnix(text);
  const std::string_view whole = text;
  const bool tls = text.starts_with(kTlsPrefix);
  if (tls) text.remove_prefix(kTlsPrefix.size());
  const size_t colon = text.rfind(':');
  if (colon == std::string_view::npos) return Wrong(whole, "has no port");
  Address address;
  address.tls = tls;
  std::string_view host = text.substr(0, colon);
  if (host.starts_with('[') && host.ends_with(']')) {
    host = host.substr(1, host.size() - 2);
  } else if (host.find(':') != std::string_view::npos) {
    return Wrong(whole, "has more than one colon (write an IPv6 number as [::1]:50551)");
  }
  if (host.empty()) return Wrong(whole, "has no host");
  if (host.find_first_of(" \t\r\n/[]") != std::string_view::npos) {
    return Wrong(whole, "has a host that is none");
  }
  address.host = std::string(host);
  const std::string_view port = text.substr(colon + 1);
  const auto parsed = std::from_chars(port.data(), port.data() + port.size(), address.port);
  if (parsed.ec != std::errc() || parsed.ptr != port.data() + port.size()) {
    return Wrong(whole, absl::StrCat("has the port \"", View(port), "\", which is not 0 to 65535"));
  }
  return address;
}

absl::Status PrepareToListen(const Address& address) {
  return address.unix_socket ? PrepareUnix(address) : absl::OkStatus();
}

}  // namespace voxeld::daemon
