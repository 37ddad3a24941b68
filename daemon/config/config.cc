#include "daemon/config/config.h"

#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <set>
#include <sstream>
#include <system_error>
#include <utility>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "common/text/suggest.h"
#include "daemon/config/fields.h"

namespace voxeld::daemon {
namespace {

constexpr const char* kDefaultListen = "127.0.0.1:50551";
constexpr const char* kDefaultHttp = "127.0.0.1:8088";
constexpr const char* kSystemFile = "/etc/voxeld/voxeld.toml";
constexpr const char* kSystemRunFolder = "/run/voxeld";
constexpr const char* kLocalSuffix = ".local";
constexpr uintmax_t kGreatestFileBytes = 16u << 20;

std::string DefaultSocket(const Environment& environment) {
  const std::optional<std::string> folder = environment("XDG_RUNTIME_DIR");
  if (folder.has_value() && folder->starts_with('/')) return *folder + "/voxeld.sock";
  if (::access(kSystemRunFolder, W_OK | X_OK) == 0) {
    return absl::StrCat(kSystemRunFolder, "/voxeld.sock");
  }
  return absl::StrCat("/tmp/voxeld-", geteuid(), "/voxeld.sock");
}

}  // namespace

std::vector<std::string> DefaultAddresses(const Environment& environment) {
  return {kDefaultListen, absl::StrCat("unix:", DefaultSocket(environment))};
}

namespace {

absl::Status SetDefaults(const Environment& environment, Config* config) {
  for (const std::string& text : DefaultAddresses(environment)) {
    absl::StatusOr<Address> address = ParseAddress(text);
    if (!address.ok()) return address.status();
    config->server.listen.push_back(*std::move(address));
  }
  absl::StatusOr<Address> http = ParseAddress(kDefaultHttp);
  if (!http.ok()) return http.status();
  config->server.http = *std::move(http);
  config->displays.push_back({"sim", "simulated", {}, "the default"});
  return absl::OkStatus();
}

absl::Status ApplyAddresses(const CommandLine& command_line, Config* config) {
  if (!command_line.listen.empty()) config->server.listen.clear();
  for (const std::string& text : command_line.listen) {
    absl::StatusOr<Address> address = ParseAddress(text);
    if (!address.ok()) {
      return absl::InvalidArgumentError(absl::StrCat("--listen: ", address.status().message()));
    }
    config->server.listen.push_back(*std::move(address));
  }
  if (command_line.http.has_value()) {
    absl::StatusOr<std::optional<Address>> http = ParseHttp(*command_line.http);
    if (!http.ok()) {
      return absl::InvalidArgumentError(absl::StrCat("--http: ", http.status().message()));
    }
    config->server.http = *std::move(http);
    config->server.http_asked = true;
  }
  return absl::OkStatus();
}

absl::Status ApplyDisplays(const CommandLine& command_line, Config* config) {
  if (command_line.displays.empty()) return absl::OkStatus();
  config->displays.clear();
  std::set<std::string> names;
  for (const std::string& text : command_line.displays) {
    absl::StatusOr<DisplayConfig> display = ParseDisplayOption(text);
    if (!display.ok()) return display.status();
    if (!names.insert(display->name).second) {
      return absl::InvalidArgumentError(absl::StrCat("--display: there are two displays named \"",
                                                     display->name, "\"; give each its own name"));
    }
    config->displays.push_back(*std::move(display));
  }
  return absl::OkStatus();
}

// Sets a field that has a few possible values to a value of the command line.
struct ChoiceSetter {
  const char* key;  // section and field, as in "log.level"
  const std::optional<std::string>& value;
  const char* option;
  std::string section;
  absl::Status status;

  void Section(const char* name) { section = name; }
  void Choice(const char* name, std::string& out, std::initializer_list<const char*> values) {
    if (section + "." + name != key || !value.has_value()) return;
    const std::vector<std::string> known(values.begin(), values.end());
    for (const std::string& candidate : known) {
      if (candidate == *value) {
        out = *value;
        return;
      }
    }
    status = absl::InvalidArgumentError(
        absl::StrCat(option, " is \"", *value, "\"", Suggestion(*value, known)));
  }
  void Listen(const char*, std::vector<Address>&) {}
  void Http(const char*, std::optional<Address>&, bool&) {}
  void LocalSocket(const char*, std::string&) {}
  void Program(const char*, std::string&) {}
  void Engine(const char*, gpu::EngineKind&) {}
  template <typename T>
  void Integer(const char*, T&, int64_t, int64_t) {}
  void Real(const char*, double&, double, double) {}
  void Flag(const char*, bool&) {}
  void Text(const char*, std::string&) {}
  void Scopes(const char*, std::string&, bool) {}
};

absl::Status ApplyChoice(const char* key, const char* option,
                         const std::optional<std::string>& value, Config* config) {
  ChoiceSetter setter{key, value, option, {}, {}};
  VisitFields(*config, setter);
  return setter.status;
}

}  // namespace

absl::StatusOr<gpu::EngineKind> ParseEngineKind(std::string_view text) {
  std::vector<std::string> known;
  for (const gpu::EngineKind kind :
       {gpu::EngineKind::kAuto, gpu::EngineKind::kCpu, gpu::EngineKind::kCuda}) {
    known.push_back(EngineKindText(kind));
    if (known.back() == text) return kind;
  }
  // By letter distance alone, "gpu" would be similar to "cpu".
  const std::string suggestion = absl::EqualsIgnoreCase({text.data(), text.size()}, "gpu")
                                     ? "; did you mean cuda?"
                                     : Suggestion(text, known);
  return absl::InvalidArgumentError(
      absl::StrCat("is \"", absl::string_view(text.data(), text.size()), "\"", suggestion));
}

std::string EngineKindText(gpu::EngineKind kind) {
  switch (kind) {
    case gpu::EngineKind::kAuto:
      return "auto";
    case gpu::EngineKind::kCpu:
      return "cpu";
    case gpu::EngineKind::kCuda:
      return "cuda";
  }
  return {};
}

absl::StatusOr<std::optional<Address>> ParseHttp(std::string_view text) {
  if (text == "off") return std::optional<Address>();
  absl::StatusOr<Address> address = ParseAddress(text);
  if (!address.ok()) {
    return absl::InvalidArgumentError(
        absl::StrCat(address.status().message(), "; or \"off\" for none"));
  }
  return std::optional<Address>(*std::move(address));
}

absl::StatusOr<std::optional<Address>> LocalSocketAddress(const ServerConfig& config) {
  if (config.local_socket.empty()) return std::optional<Address>();
  if (config.local_socket != "auto") {
    const bool prefixed = config.local_socket.starts_with("unix:");
    if (!prefixed && !config.local_socket.starts_with('/')) {
      return absl::InvalidArgumentError(absl::StrCat(
          "\"", config.local_socket,
          "\" is no path of a unix socket; give an absolute path, \"auto\" (beside the "
          "unix socket of listen), or \"\" for none"));
    }
    absl::StatusOr<Address> address =
        ParseAddress(absl::StrCat(prefixed ? "" : "unix:", config.local_socket));
    if (!address.ok()) return address.status();
    for (const Address& listen : config.listen) {
      if (listen != *address) continue;
      return absl::InvalidArgumentError(absl::StrCat("local_socket is ", address->ToString(),
                                                     ", and so is one of listen; each needs its "
                                                     "own"));
    }
    return std::optional<Address>(*std::move(address));
  }
  for (const Address& listen : config.listen) {
    if (!listen.unix_socket) continue;
    // If the path plus suffix is too long there is no local socket, because nobody requested one
    // explicitly.
    absl::StatusOr<Address> address = ParseAddress(absl::StrCat(listen.ToString(), kLocalSuffix));
    if (address.ok()) return std::optional<Address>(*std::move(address));
  }
  return std::optional<Address>();
}

absl::Status CheckScopes(std::string_view text, bool auto_too) {
  return auto_too && text == "auto" ? absl::OkStatus() : access::ParseScopes(text).status();
}

absl::StatusOr<access::AccessOptions> AccessOf(const SecurityConfig& config) {
  access::AccessOptions options{.grants = config.grants};
  const bool by_default = config.anonymous_scopes == "auto";
  const std::string anonymous = !by_default             ? config.anonymous_scopes
                                : config.grants.empty() ? "all"
                                                        : "none";
  for (const auto& [text, scopes] : {std::pair(&anonymous, &options.anonymous),
                                     {&config.certificate_scopes, &options.certificate},
                                     {&config.unix_scopes, &options.unix_users}}) {
    const absl::StatusOr<access::Scopes> parsed = access::ParseScopes(*text);
    if (!parsed.ok()) return parsed.status();
    *scopes = *parsed;
  }
  return options;
}

namespace {

bool IsReachedInPlain(const Address& address, const SecurityConfig& security) {
  return !address.tls && !address.is_local() && !security.allow_plain_beyond_loopback;
}

}  // namespace

absl::Status CheckReach(const Address& address, const SecurityConfig& security) {
  if (!IsReachedInPlain(address, security)) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrCat(
      address.ToString(),
      " may be reached from other machines, and all that goes over it could be read and changed; "
      "give tls:",
      address.ToString(),
      " with tls_certificate, tls_key and tls_client_ca, an "
      "address of this machine, or security.allow_plain_beyond_loopback = true"));
}

absl::Status CheckSecurity(const Config& config) {
  if (config.server.http.has_value()) {
    if (config.server.http->tls) {
      return absl::InvalidArgumentError(
          absl::StrCat("http is ", config.server.http->ToString(),
                       "; /healthz and /metrics are served without TLS: give HOST:PORT, and let a "
                       "proxy add it"));
    }
    if (IsReachedInPlain(*config.server.http, config.security)) {
      return absl::InvalidArgumentError(
          absl::StrCat("http, ", config.server.http->ToString(),
                       ", may be reached from other machines, and has no TLS: give an address of "
                       "this machine, before which a proxy can add it, or "
                       "security.allow_plain_beyond_loopback = true"));
    }
  }
  bool tls = false;
  for (const Address& address : config.server.listen) {
    tls = tls || address.tls;
    if (absl::Status status = CheckReach(address, config.security); !status.ok()) return status;
  }
  if (tls && !config.security.tls.any()) {
    return absl::InvalidArgumentError(
        "an address of listen speaks TLS, and security.tls_certificate, tls_key and tls_client_ca "
        "are not given");
  }
  return absl::OkStatus();
}

absl::Status CheckLocalSocket(std::string_view text) {
  ServerConfig config;
  config.local_socket = std::string(text);
  return LocalSocketAddress(config).status();
}

Environment ProcessEnvironment() {
  return [](const char* name) -> std::optional<std::string> {
    const char* value = std::getenv(name);
    if (value == nullptr || *value == '\0') return {};
    return std::string(value);
  };
}

absl::Status ReadConfigFile(const std::string& path, Config* config) {
  std::error_code error;
  const std::filesystem::file_type type = std::filesystem::status(path, error).type();
  if (type == std::filesystem::file_type::directory) error.assign(EISDIR, std::system_category());
  if (error) {
    return absl::ErrnoToStatus(error.value(), absl::StrCat("the configuration file ", path));
  }
  // Read the file as a stream, because the file behind a shell's <(…) has no size.
  std::ifstream file(path, std::ios::binary);
  std::string text;
  std::array<char, 1 << 16> piece;
  while (file && text.size() <= kGreatestFileBytes) {
    file.read(piece.data(), piece.size());
    text.append(piece.data(), static_cast<size_t>(file.gcount()));
  }
  if (text.size() > kGreatestFileBytes) {
    return absl::InvalidArgumentError(
        absl::StrCat(path, " has more than the ", kGreatestFileBytes, " bytes of a configuration"));
  }
  if (!file.eof()) {
    return absl::ErrnoToStatus(errno, absl::StrCat("the configuration file ", path));
  }
  if (text.empty() && type == std::filesystem::file_type::fifo) {
    return absl::InvalidArgumentError(absl::StrCat(
        "the configuration file ", path,
        " is a pipe with nothing in it; what was read from one does not come again, so name a "
        "regular file where the configuration is to be read anew"));
  }
  return ReadConfigText(text, path, config);
}

std::string FindConfigFile(const Environment& environment,
                           const std::function<bool(const std::string&)>& exists) {
  std::optional<std::string> folder = environment("XDG_CONFIG_HOME");
  if (!folder.has_value() || !folder->starts_with('/')) {
    folder = environment("HOME");
    if (folder.has_value()) *folder += "/.config";
  }
  if (folder.has_value()) {
    const std::string own = *folder + "/voxeld/voxeld.toml";
    if (exists(own)) return own;
  }
  return exists(kSystemFile) ? kSystemFile : "";
}

absl::StatusOr<Config> LoadConfig(const std::optional<std::string>& file,
                                  const Environment& environment) {
  Config config;
  if (absl::Status status = SetDefaults(environment, &config); !status.ok()) return status;
  const auto exists = [](const std::string& path) {
    std::error_code error;
    return std::filesystem::exists(path, error);
  };
  const std::string path = file.has_value() ? *file : FindConfigFile(environment, exists);
  if (path.empty()) return config;
  if (absl::Status status = ReadConfigFile(path, &config); !status.ok()) return status;
  return config;
}

absl::Status ApplyCommandLine(const CommandLine& command_line, Config* config) {
  if (absl::Status status = ApplyAddresses(command_line, config); !status.ok()) return status;
  if (absl::Status status = ApplyDisplays(command_line, config); !status.ok()) return status;
  if (command_line.engine.has_value()) {
    const absl::StatusOr<gpu::EngineKind> kind = ParseEngineKind(*command_line.engine);
    if (!kind.ok()) {
      return absl::InvalidArgumentError(absl::StrCat("--engine ", kind.status().message()));
    }
    config->engine.kind = *kind;
  }
  if (command_line.state_dir.has_value()) config->state.dir = *command_line.state_dir;
  if (absl::Status status = ApplyChoice("log.level", "--log-level", command_line.log_level, config);
      !status.ok()) {
    return status;
  }
  return ApplyChoice("log.format", "--log-format", command_line.log_format, config);
}

}  // namespace voxeld::daemon
