// The daemon's configuration in force: defaults, then a TOML file, then the command line.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "daemon/access/access.h"
#include "daemon/access/tls_store.h"
#include "daemon/address/address.h"
#include "daemon/config/command_line.h"
#include "daemon/config/display_config.h"
#include "daemon/listen/limits.h"
#include "daemon/scene/operation.h"
#include "display/sync/clock.h"
#include "gpu/engine.h"

namespace voxeld::daemon {

struct ServerConfig {
  std::vector<Address> listen;
  // Nothing: no HTTP port. `http_asked`: it was requested explicitly, so that a busy port is an
  // error.
  std::optional<Address> http;
  bool http_asked = false;
  // Path of the local socket, at which producers on this machine hand over memory: "auto" (the
  // first unix socket of `listen` with ".local" appended), a path, or empty for none.
  std::string local_socket = "auto";
  uint32_t max_local_memories = 256;  // of one session, held at the same time
  // Limit on answers that a client of Stream has not read yet. A commit's issues arrive all at
  // once, so keep this well above max_issues_per_commit. Otherwise streams of clients that do read
  // may be ended.
  uint32_t max_queued_answers = 16384;
  uint64_t max_queued_bytes = 16u << 20;  // the same in bytes
  listen::ConnectionLimits connections;
  uint32_t max_calls_per_connection = 100;  // at the same time; the client queues further ones
  uint32_t max_metadata_bytes = 8u << 10;   // of one call
  // From the beginning of a call until gRPC has the HTTP/2 settings.
  int64_t handshake_limit_ns = 2 * sync::kSecond;
  // A client that pings more often than this without data, max_ping_strikes times, is disconnected.
  int64_t ping_interval_min_ns = 5 * sync::kSecond;
  uint32_t max_ping_strikes = 2;
  // A connection without calls is closed after the idle limit. A connection that reaches the age
  // limit is asked to close, and closed after the grace period together with its remaining calls.
  // 0: never.
  int64_t connection_idle_limit_ns = 0;
  int64_t connection_age_limit_ns = 0;
  int64_t connection_age_grace_ns = 60 * sync::kSecond;
  uint32_t max_scene_watches = 64;   // concurrent WatchScene calls of all connections
  uint32_t max_stats_watches = 64;   // WatchStats calls
  uint32_t max_volume_watches = 16;  // WatchVolume calls
  int64_t watch_write_limit_ns = 30 * sync::kSecond;
  int64_t upload_silence_limit_ns = 30 * sync::kSecond;
  uint64_t max_arriving_bytes = uint64_t{1} << 30;
  int64_t open_limit_ns = 5 * sync::kSecond;  // how long a new stream waits for its Open
  // How long a half-closed stream waits for outcomes, and how long an ending stream waits for its
  // client to read the queued messages.
  int64_t drain_limit_ns = 5 * sync::kSecond;
  // How often an idle connection is probed. It is closed if no answer arrives.
  int64_t keepalive_interval_ns = 20 * sync::kSecond;
  int64_t keepalive_timeout_ns = 10 * sync::kSecond;
  uint32_t max_http_connections = 64;
  int64_t http_idle_limit_ns = 10 * sync::kSecond;
  std::string http_hosts;    // comma-separated names by which browsers may address this machine
  bool http_control = true;  // allow a browser control through a one-time address
  bool http_play = true;     // allow a browser with control to upload files to play
  uint64_t http_max_upload_bytes = 256u << 20;  // of one uploaded file
};

struct EngineConfig {
  gpu::EngineKind kind = gpu::EngineKind::kAuto;
  uint32_t threads = 0;  // 0: one per core
  uint64_t staging_limit_bytes = uint64_t{4} << 30;
  uint32_t device = 0;  // index of the GPU
  // gpu::EngineOptions::index_bytes of each display.
  uint64_t index_bytes = 0;
  // A CUDA engine always runs in a separate process; a CPU engine may.
  bool in_worker = false;
  std::string worker;  // program of that process; empty: voxeld-engine
  // Path of the NCCL library, for displays with several GPUs. Empty: $VOXELD_NCCL, then the
  // loader's search path. "off": none.
  std::string nccl;
  // A process that does not respond within this time is terminated, and the CPU takes over.
  int64_t worker_deadline_ns = 2 * sync::kSecond;
};

struct LogConfig {
  std::string level = "info";           // trace, debug, info, warn, error, off
  std::string format = "text";          // text, json
  std::string audit;                    // path of the audit log; empty: the log
  bool audit_required = false;          // reject control actions while `audit` cannot be written
  uint32_t max_lines_per_second = 100;  // of one event; 0: unlimited
};

struct StateConfig {
  std::string dir;  // folder for persistent state; empty: nothing is persistent
  // Longest delay before changes that no client waits for are written.
  int64_t interval_ns = 100 * sync::kMillisecond;
};

struct SecurityConfig {
  // Path of the file of tokens, certificates and users (access/grants.h). Empty: none.
  std::string grants;
  // PEM files for addresses that use TLS. Set all three or none.
  access::TlsFiles tls;
  // Scopes of callers that no grant names, in the syntax of ParseScopes. "auto": all, or none if
  // there is a grants file.
  std::string anonymous_scopes = "auto";
  std::string certificate_scopes = "none", unix_scopes = "all";
  // Allow addresses that other machines can reach without TLS.
  bool allow_plain_beyond_loopback = false;
};

struct Config {
  std::string file;  // path of the file that was read; empty: none
  ServerConfig server;
  EngineConfig engine;
  LogConfig log;
  SecurityConfig security;
  StateConfig state;
  Limits limits;
  std::vector<DisplayConfig> displays;
};

// Returns: the value of an environment variable, or nothing.
using Environment = std::function<std::optional<std::string>(const char* name)>;
Environment ProcessEnvironment();

// Returns: the addresses at which gRPC is served by default. voxelctl and the clients also try these by default.
std::vector<std::string> DefaultAddresses(const Environment& environment);

// Reads `path` and overrides `config`. The error message lists every fault of the file, one per
// line, each as "path:line:column: key", what is wrong, the value and the remedy. Errors:
// InvalidArgument, or NotFound if the file does not exist.
absl::Status ReadConfigFile(const std::string& path, Config* config);

// Does the same for text. `name` replaces the path in messages.
absl::Status ReadConfigText(std::string_view text, const std::string& name, Config* config);

// Returns: the file to read if none is named: $XDG_CONFIG_HOME/voxeld/voxeld.toml (~/.config if it
// is unset), else /etc/voxeld/voxeld.toml, else nothing. `exists` reports whether a file exists.
std::string FindConfigFile(const Environment& environment,
                           const std::function<bool(const std::string&)>& exists);

// Returns: the defaults overridden by `file`, or by the file that FindConfigFile returns. Errors:
// as for ReadConfigFile.
absl::StatusOr<Config> LoadConfig(const std::optional<std::string>& file,
                                  const Environment& environment);

// Overrides the configuration with the command line. Errors: InvalidArgument for a usage error.
absl::Status ApplyCommandLine(const CommandLine& command_line, Config* config);

// Returns: the address of the local socket, or nothing if it is off. Errors: InvalidArgument
// for a value that CheckLocalSocket rejects, and for an address that `listen` contains.
absl::StatusOr<std::optional<Address>> LocalSocketAddress(const ServerConfig& config);

// Returns: the access options in force. Errors: InvalidArgument for unknown scopes.
absl::StatusOr<access::AccessOptions> AccessOf(const SecurityConfig& config);

// Errors: InvalidArgument if other machines can reach an address without TLS, or if an address uses
// TLS without its files.
absl::Status CheckSecurity(const Config& config);

// Checks one address from any source in the same way.
absl::Status CheckReach(const Address& address, const SecurityConfig& security);

// Returns: TOML text that parses back to the same configuration.
std::string ToToml(const Config& config);

}  // namespace voxeld::daemon
