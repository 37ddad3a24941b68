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
  // Nothing: no http port. `http_asked`: it was asked for, so that a busy one is an error.
  std::optional<Address> http;
  bool http_asked = false;
  // Where producers on this machine hand over memory: "auto" (beside the first unix socket of
  // `listen`, with ".local" after its name), a path, or empty for nowhere.
  std::string local_socket = "auto";
  uint32_t max_local_memories = 256;  // of one session, held at once
  // That a client of Stream has not read. A commit's issues come at once: well above
  // max_issues_per_commit, or clients that do read may be ended.
  uint32_t max_queued_answers = 16384;
  uint64_t max_queued_bytes = 16u << 20;  // the same in bytes
  listen::ConnectionLimits connections;
  uint32_t max_calls_per_connection = 100;  // at once; further ones wait in the client
  uint32_t max_metadata_bytes = 8u << 10;   // of one call
  // From when a call has begun until gRPC has HTTP/2's settings.
  int64_t handshake_limit_ns = 2 * sync::kSecond;
  // A client that pings more often without data, so many times, is sent away.
  int64_t ping_interval_min_ns = 5 * sync::kSecond;
  uint32_t max_ping_strikes = 2;
  // A connection without calls is closed after it; one that is so old is asked to go, and closed
  // after the grace, with what is left on it. 0: never.
  int64_t connection_idle_limit_ns = 0;
  int64_t connection_age_limit_ns = 0;
  int64_t connection_age_grace_ns = 60 * sync::kSecond;
  uint32_t max_scene_watches = 64;   // WatchScene calls at once, of all connections
  uint32_t max_stats_watches = 64;   // WatchStats calls
  uint32_t max_volume_watches = 16;  // WatchVolume calls
  int64_t watch_write_limit_ns = 30 * sync::kSecond;
  int64_t upload_silence_limit_ns = 30 * sync::kSecond;
  uint64_t max_arriving_bytes = uint64_t{1} << 30;
  int64_t open_limit_ns = 5 * sync::kSecond;  // how long a new stream waits for its Open
  // How long a stream that its client has half-closed waits for outcomes, and an ending one for its
  // client to read what is queued.
  int64_t drain_limit_ns = 5 * sync::kSecond;
  // An idle connection is probed this often, and closed when no answer comes.
  int64_t keepalive_interval_ns = 20 * sync::kSecond;
  int64_t keepalive_timeout_ns = 10 * sync::kSecond;
  uint32_t max_http_connections = 64;
  int64_t http_idle_limit_ns = 10 * sync::kSecond;
  std::string http_hosts;    // names, between commas, that browsers may know this machine by
  bool http_control = true;  // a browser may be given control, by an address that serves once
  bool http_play = true;     // with control it may send files to be played
  uint64_t http_max_upload_bytes = 256u << 20;  // of one of them
};

struct EngineConfig {
  gpu::EngineKind kind = gpu::EngineKind::kAuto;
  uint32_t threads = 0;  // 0: one a core
  uint64_t staging_limit_bytes = uint64_t{4} << 30;
  uint32_t device = 0;  // which GPU
  // gpu::EngineOptions::index_bytes, of each display.
  uint64_t index_bytes = 0;
  // A CUDA engine always has a process of its own; the CPU's may have one too.
  bool in_worker = false;
  std::string worker;  // the program of that process; empty: voxeld-engine
  // NCCL's library, for displays with several GPUs: a path; empty: $VOXELD_NCCL, then where the loader
  // looks; "off": none.
  std::string nccl;
  // After which a process that does not answer is ended, and the CPU takes over.
  int64_t worker_deadline_ns = 2 * sync::kSecond;
};

struct LogConfig {
  std::string level = "info";           // trace, debug, info, warn, error, off
  std::string format = "text";          // text, json
  std::string audit;                    // a file for who did what; empty: the log
  bool audit_required = false;          // refuse control actions while `audit` cannot be written
  uint32_t max_lines_per_second = 100;  // of one event; 0: any number
};

struct StateConfig {
  std::string dir;  // where what outlives the daemon is kept; empty: nothing does
  int64_t interval_ns =
      100 * sync::kMillisecond;  // how long what nobody waits for may be unwritten
};

struct SecurityConfig {
  std::string grants;  // the file of tokens, certificates and users (access/grants.h); empty: none
  // PEM, for addresses that speak TLS: all three or none.
  access::TlsFiles tls;
  // What callers have that no grant names, as ParseScopes takes it. "auto": all, and none once there is
  // a grants file.
  std::string anonymous_scopes = "auto";
  std::string certificate_scopes = "none", unix_scopes = "all";
  // Addresses beyond this machine may be without TLS.
  bool allow_plain_beyond_loopback = false;
};

struct Config {
  std::string file;  // that was read; empty: none
  ServerConfig server;
  EngineConfig engine;
  LogConfig log;
  SecurityConfig security;
  StateConfig state;
  Limits limits;
  std::vector<DisplayConfig> displays;
};

// What the environment says: a variable's value, or nothing.
using Environment = std::function<std::optional<std::string>(const char* name)>;
Environment ProcessEnvironment();

// Returns: the addresses at which gRPC is served by default. voxelctl and the clients also try these by default.
std::vector<std::string> DefaultAddresses(const Environment& environment);

// Reads `path` over `config`. Every fault of the file is in the message, one a line, each as
// "path:line:column: key what was wrong, the value, what would be right". InvalidArgument, or
// NotFound if there is no such file.
absl::Status ReadConfigFile(const std::string& path, Config* config);

// The same for text; `name` stands for the path in messages.
absl::Status ReadConfigText(std::string_view text, const std::string& name, Config* config);

// Which file is read when none is named: $XDG_CONFIG_HOME/voxeld/voxeld.toml (~/.config without
// it), else /etc/voxeld/voxeld.toml, else none. `exists` says whether a file is there.
std::string FindConfigFile(const Environment& environment,
                           const std::function<bool(const std::string&)>& exists);

// Defaults, then the file: `file` if one is named, else the one that is found.
// Errors as of ReadConfigFile.
absl::StatusOr<Config> LoadConfig(const std::optional<std::string>& file,
                                  const Environment& environment);

// What the command line says goes over it. InvalidArgument is a usage error.
absl::Status ApplyCommandLine(const CommandLine& command_line, Config* config);

// Where the local socket is, by what is in force; nothing: there is none. InvalidArgument for what
// CheckLocalSocket refuses, and for an address of `listen`.
absl::StatusOr<std::optional<Address>> LocalSocketAddress(const ServerConfig& config);

// What is in force for callers. InvalidArgument for scopes that there are not.
absl::StatusOr<access::AccessOptions> AccessOf(const SecurityConfig& config);

// InvalidArgument if an address is not to be had as it is: beyond this machine without TLS, or TLS
// without its files.
absl::Status CheckSecurity(const Config& config);

// The same for one address, wherever it is from.
absl::Status CheckReach(const Address& address, const SecurityConfig& security);

// As a file that would read back the same.
std::string ToToml(const Config& config);

}  // namespace voxeld::daemon
