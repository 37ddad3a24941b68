// Connects the parts of voxeld; has no logic of its own.
#include <pthread.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <csignal>
#include <cstdio>
#include <exception>
#include <future>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "absl/algorithm/container.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_split.h"
#include "common/memory/out_of_memory.h"
#include "common/text/printable.h"
#include "daemon/access/security.h"
#include "daemon/access/ticker.h"
#include "daemon/assets/asset_store.h"
#include "daemon/config/config.h"
#include "daemon/config/display_view.h"
#include "daemon/core/core.h"
#include "daemon/http/http_server.h"
#include "daemon/http/monitor.h"
#include "daemon/listen/counters.h"
#include "daemon/listen/socket.h"
#include "daemon/local/local_socket.h"
#include "daemon/log/logger.h"
#include "daemon/pipeline/genlock.h"
#include "daemon/pipeline/view.h"
#include "daemon/play/setup.h"
#include "daemon/process/end_limit.h"
#include "daemon/process/process.h"
#include "daemon/process/process_watch.h"
#include "daemon/process/supervisor.h"
#include "daemon/reload/reloader.h"
#include "daemon/services/health_watch.h"
#include "daemon/services/server.h"
#include "daemon/state/kept_state.h"
#include "daemon/usage/standard_output.h"
#include "daemon/version/version.h"
#include "daemon/viewer/viewer.h"
#include "display/drivers/registry.h"
#include "display/sync/clock.h"
#include "display/usb/libusb/libusb_bus.h"
#include "gpu/worker/worker_pool.h"

namespace voxeld::daemon {
namespace {

constexpr int kUsageError = 2;
// Together with half a second for the player this stays below the promised 5 s.
constexpr sync::TimeNs kServerLimit = 2 * sync::kSecond;
// For the server and the core together.
constexpr sync::TimeNs kStopLimit = 4500 * sync::kMillisecond;
constexpr sync::TimeNs kEndLimit = 5 * sync::kSecond;

int Fail(int code, const absl::Status& status) {
  std::fprintf(stderr, "voxeld: %s\n", EscapeLines(status.message()).c_str());
  return code;
}

struct WantedDisplay {
  std::unique_ptr<display::Display> display;
  DisplaySetup setup;
  std::vector<int> gpus;
};
using Displays = std::vector<WantedDisplay>;

absl::StatusOr<Displays> MakeDisplays(const Config& config, const display::DriverContext& context) {
  Displays displays;
  for (const DisplayConfig& wanted : config.displays) {
    const auto wrong = [&](const absl::Status& status) {
      return absl::Status(status.code(), absl::StrCat(wanted.source, ": ", status.message()));
    };
    const absl::StatusOr<DisplayOptions> options = SplitDisplayOptions(wanted);
    if (!options.ok()) return wrong(options.status());
    absl::StatusOr<std::unique_ptr<display::Display>> made = display::CreateDisplay(
        {.name = wanted.name, .driver = wanted.driver, .options = options->driver}, context);
    if (!made.ok()) return wrong(made.status());
    const absl::StatusOr<gpu::Affine> map =
        SceneToVoxel(options->setup.view, (*made)->info().geometry.grid);
    if (!map.ok()) return wrong(map.status());
    if (absl::Status status =
            CheckGpus(options->gpus, config.engine.kind, (*made)->info().layout.slices);
        !status.ok()) {
      return wrong(status);
    }
    if (const std::string& genlock = options->setup.genlock; !genlock.empty()) {
      const auto other = std::find_if(displays.begin(), displays.end(),
                                      [&](const auto& d) { return d.setup.genlock == genlock; });
      const display::DisplayInfo* info =
          other == displays.end() ? nullptr : &other->display->info();
      if (absl::Status status = CheckGenlock(genlock, **made, info); !status.ok()) {
        return wrong(status);
      }
    }
    displays.push_back({*std::move(made), options->setup, options->gpus});
  }
  return displays;
}

// Returns: the engine options of a display. A display that names its GPUs uses them.
gpu::EngineOptions EngineOf(gpu::EngineOptions engine, const std::vector<int>& gpus) {
  if (gpus.empty()) return engine;
  engine.kind = gpu::EngineKind::kCuda;
  engine.device = gpus.front();
  engine.devices = gpus;
  // Ranks terminate together, so they share their processes with no other display.
  if (gpus.size() > 1) engine.workers = nullptr;
  return engine;
}

absl::StatusOr<std::unique_ptr<http::Server>> StartHttp(
    const ServerConfig& config, Core& core, std::shared_ptr<const std::atomic<http::Phase>> phase,
    viewer::Viewer& viewer, std::function<void(const std::string&)> accept_failed, Logger& log) {
  if (!config.http.has_value()) return nullptr;
  absl::StatusOr<std::unique_ptr<http::Server>> server =
      http::Server::Start({.listen = *config.http,
                           .max_connections = config.max_http_connections,
                           .reserved_paths = {"/healthz", "/metrics"},
                           .idle_limit_ns = config.http_idle_limit_ns,
                           .accept_failed = std::move(accept_failed)},
                          viewer.Handler(http::MonitorHandler(core, std::move(phase))),
                          viewer.Upgrade(), viewer.Receive());
  if (server.ok() || config.http_asked || !absl::IsAlreadyExists(server.status())) return server;
  log.Warn("no http port", {{"why", std::string(server.status().message())}});
  return nullptr;
}

void LogDisplays(Core& core, Logger& log) {
  std::promise<absl::StatusOr<Stats>> promise;
  core.GetStats([&promise](absl::StatusOr<Stats> stats) { promise.set_value(std::move(stats)); });
  const absl::StatusOr<Stats> stats = promise.get_future().get();
  if (!stats.ok()) {
    return log.Error("no figures", {{"why", std::string(stats.status().message())}});
  }
  for (const DisplayFigures& display : stats->displays) {
    log.Info("display", {{"name", display.name},
                         {"state", DisplayStateName(display.state)},
                         {"state_why", display.state_reason},
                         {"engine", display.engine},
                         {"device", display.engine_device},
                         {"engine_why", display.engine_reason}});
  }
}

// Prints the address that grants control only to a terminal, so that saved output never contains
// it.
bool TellsControl(const Config& config) {
  return config.log.format == "text" && isatty(STDOUT_FILENO) != 0;  // programs read JSON
}

// Returns: "--server ADDR " with the first address that is served, or nothing if voxelctl tries one of them by default.
std::string OptionForClients(const std::vector<std::string>& addresses) {
  const std::vector<std::string> known = DefaultAddresses(ProcessEnvironment());
  const bool is_known = absl::c_any_of(addresses, [&known](const std::string& address) {
    return absl::c_linear_search(known, address);
  });
  return addresses.empty() || is_known ? "" : absl::StrCat("--server ", addresses.front(), " ");
}

// Prints where to look, what to try and what draws, for a user who started the daemon by hand. `server`: as OptionForClients returns it.
void Welcome(Core& core, const http::Server* http, const viewer::Viewer& viewer, bool tells_control,
             const std::string& server) {
  if (http != nullptr && !http->address().unix_socket) {
    const std::string page = viewer::Viewer::PageAddress(http->address());
    const std::string control = viewer.ControlAddress(http->address());
    if (!viewer::Viewer::HasPage()) {
      std::printf(
          "see:    no page: this voxeld was built without it; run tools/setup, configure with "
          "-DVOXELD_PAGE=ON and build again\n");
    } else if (tells_control && !control.empty()) {
      std::printf("see:    %s   (to look; with control, once: %s)\n", page.c_str(),
                  control.c_str());
    } else {
      std::printf("see:    %s\n", page.c_str());
    }
  } else {
    std::printf("see:    voxelctl %ssnapshot picture.png (no http port)\n", server.c_str());
  }
  std::printf("try:    voxelctl %sdemo\n", server.c_str());
  std::promise<absl::StatusOr<Stats>> promise;
  core.GetStats([&promise](absl::StatusOr<Stats> stats) { promise.set_value(std::move(stats)); });
  const absl::StatusOr<Stats> stats = promise.get_future().get();
  if (!stats.ok() || stats->displays.empty()) {
    std::printf("engine: none: there is no display\n");
  } else {
    const DisplayFigures& first = stats->displays.front();
    std::printf("engine: %s, %s%s%s\n", first.engine.c_str(), first.engine_device.c_str(),
                first.engine_reason.empty() ? "" : ": ", first.engine_reason.c_str());
  }
  std::fflush(stdout);
}

// Adopts sockets that the process that started the daemon has opened. Those named "tls" are served
// over TLS.
absl::StatusOr<std::vector<listen::ListeningSocket>> AdoptSockets(const Config& config,
                                                                  Supervisor& supervisor) {
  std::vector<listen::ListeningSocket> sockets;
  for (InheritedSocket& inherited : supervisor.TakeSockets()) {
    const bool tls = inherited.name == "tls";
    absl::StatusOr<listen::ListeningSocket> socket =
        listen::ListeningSocket::Adopt(std::move(inherited.descriptor), tls);
    if (!socket.ok()) return socket.status();
    if (absl::Status status = CheckReach(socket->address(), config.security); !status.ok()) {
      return status;
    }
    if (tls && !config.security.tls.any()) {
      return absl::InvalidArgumentError(
          "a socket that the daemon was given is to speak TLS, and security.tls_certificate, "
          "tls_key and tls_client_ca are not given");
    }
    sockets.push_back(*std::move(socket));
  }
  return sockets;
}

// Notifies the supervisor's watchdog if the core responds and the daemon is reachable.
void FeedWatchdog(Core& core, const Supervisor& supervisor) {
  core.GetStats([&supervisor](const absl::StatusOr<Stats>& stats) {
    if (stats.ok() && stats->connections.unreachable.empty()) supervisor.Alive();
  });
}

// Returns: EngineOptions::cpu_index_bytes. Items and lists of tiles are counted only after they
// have been drawn, so the CPU engines of all displays together get at most half of max_memory_bytes
// for both.
uint64_t CpuIndexBytes(uint64_t max_memory_bytes, size_t displays) {
  const uint64_t share = max_memory_bytes / 2 / std::max<size_t>(1, displays);
  return std::clamp(share / 5 * 4, uint64_t{1}, uint64_t{4} << 30);
}

int Serve(const Config& config, const CommandLine& command_line, Displays displays,
          const sigset_t& signals, sync::Clock& clock, Supervisor& supervisor, Logger& log) {
  std::optional<EndLimit> end_limit;  // covers everything below, up to the last destructor
  ProcessWatch process(clock, log);
  access::Ticker turns(clock, TimeWatch::kTurn, [&process] { process.LookAtTime(); });
  const absl::StatusOr<access::AccessOptions> access_options = AccessOf(config.security);
  if (!access_options.ok()) return Fail(1, access_options.status());
  absl::StatusOr<std::unique_ptr<access::Security>> opened = access::Security::Open(
      *access_options, config.security.tls,
      {.path = config.log.audit, .required = config.log.audit_required}, log);
  if (!opened.ok()) return Fail(1, opened.status());
  const std::unique_ptr<access::Security> security = *std::move(opened);
  std::unique_ptr<state::KeptState> kept;  // null: no persistent state
  if (!config.state.dir.empty()) {
    absl::StatusOr<std::unique_ptr<state::KeptState>> state =
        state::KeptState::Open(config.state.dir, config.state.interval_ns, clock, log);
    if (!state.ok()) return Fail(1, state.status());
    kept = *std::move(state);
  }
  std::unique_ptr<assets::AssetStore> assets;  // null: uploads are rejected
  if (config.limits.max_assets_bytes > 0) {
    assets = assets::AssetStore::Open(
        config.state.dir.empty() ? "" : absl::StrCat(config.state.dir, "/assets"),
        {.max_asset_bytes = config.limits.max_asset_bytes,
         .max_bytes = config.limits.max_assets_bytes,
         .max_assets = config.limits.max_assets},
        clock, &log);
  }
  services::HealthWatch watch(log);
  std::atomic<reload::Reloader*> reloads = nullptr;  // set after the core exists
  const auto counters = std::make_shared<listen::Counters>();
  Core core({.limits = config.limits,
             .version = Version(),
             .engine_event = [&watch](const EngineEvent& event) { watch.OnEngine(event); },
             .state_event =
                 [&watch](const std::string& display, display::DisplayState state,
                          const std::string& reason) { watch.OnDisplay(display, state, reason); },
             .transfers_event = [&watch](const auto& display,
                                         uint64_t n) { watch.OnTransfers(display, n); },
             .state = kept == nullptr ? nullptr : kept->sink(),
             .state_figures =
                 [kept = kept.get()] { return kept == nullptr ? StateFigures() : kept->figures(); },
             .asset_figures =
                 [assets = assets.get()] {
                   return assets == nullptr ? AssetFigures() : assets->figures();
                 },
             .process_figures = [&process] { return process.figures(); },
             .connections =
                 [counters, security = security.get(), &reloads, &clock] {
                   ListenFigures figures = counters->Read(clock.Now());
                   figures.access_trouble = security->trouble();
                   const access::AuditStats audit = security->audit().stats();
                   figures.audit_pending = audit.pending, figures.audit_lost = audit.lost;
                   const access::TlsStore::Counts tls = security->tls_counts();
                   figures.tls_taken = tls.taken, figures.tls_refused = tls.refused;
                   const reload::Reloader* reloader = reloads;
                   if (reloader != nullptr) figures.config_trouble = reloader->trouble();
                   return figures;
                 }},
            clock);
  const gpu::EngineOptions engine{
      .kind = config.engine.kind,
      .threads = static_cast<int>(config.engine.threads),
      .device = static_cast<int>(config.engine.device),
      .nccl = config.engine.nccl,
      .in_worker = config.engine.in_worker,
      .worker = config.engine.worker,
      .workers = std::make_shared<gpu::WorkerPool>(),
      .worker_deadline_ns = config.engine.worker_deadline_ns,
      .staging_limit_bytes = config.engine.staging_limit_bytes,
      .index_bytes = config.engine.index_bytes,
      .cpu_index_bytes = CpuIndexBytes(config.limits.max_memory_bytes, displays.size())};
  const size_t core_displays = displays.size();
  for (auto& [display, setup, gpus] : displays) {
    if (absl::Status status = core.AddDisplay(std::move(display), EngineOf(engine, gpus), setup);
        !status.ok()) {
      return Fail(1, status);
    }
  }
  if (kept != nullptr) {
    if (absl::Status status = kept->Restore(core); !status.ok()) return Fail(1, status);
  }
  if (absl::Status status = core.Start(); !status.ok()) return Fail(1, status);

  play::PlaySetup play;
  if (!config.server.http_play) {
    play.why_not = "this voxeld plays no files of pages: server.http_play is false";
  } else if (config.server.http.has_value() && config.server.http_control && TellsControl(config)) {
    play = play::SetUpPlaying(config.server.listen);
  }
  const auto phase = std::make_shared<std::atomic<http::Phase>>();
  absl::StatusOr<std::unique_ptr<viewer::Viewer>> viewer = viewer::Viewer::Make(
      core, clock,
      {.version = Version(),
       .hosts = absl::StrSplit(config.server.http_hosts, absl::ByAnyChar(", "), absl::SkipEmpty()),
       .control = config.server.http_control,
       .audit = &security->audit(),
       .play = {.player = play.player.get(),
                .why_not = play.why_not,
                .max_bytes = config.server.http_max_upload_bytes}});
  if (!viewer.ok()) return Fail(1, viewer.status());
  absl::StatusOr<std::unique_ptr<http::Server>> http =
      StartHttp(config.server, core, phase, **viewer, counters->Noting(clock, log), log);
  if (!http.ok()) return Fail(1, http.status());
  const absl::StatusOr<std::optional<Address>> local_address = LocalSocketAddress(config.server);
  if (!local_address.ok()) return Fail(1, local_address.status());
  std::optional<local::LocalSocketOptions> local;
  if (local_address->has_value()) {
    local = {.listen = **local_address,
             .limits = {.max_memories = config.server.max_local_memories,
                        .max_bytes = config.limits.max_local_bytes},
             .log = &log};
  }
  absl::StatusOr<std::vector<listen::ListeningSocket>> inherited = AdoptSockets(config, supervisor);
  if (!inherited.ok()) return Fail(1, inherited.status());
  std::vector<Address> listen = config.server.listen;
  if (play.listen.has_value()) listen.push_back(*play.listen);
  absl::StatusOr<std::unique_ptr<services::Server>> server = services::Server::Start(
      core, clock,
      {.listen = listen,
       .version = Version(),
       .streams = {.open_limit_ns = config.server.open_limit_ns,
                   .drain_limit_ns = config.server.drain_limit_ns,
                   .max_queued_answers = config.server.max_queued_answers,
                   .max_queued_bytes = config.server.max_queued_bytes,
                   .watch_write_limit_ns = config.server.watch_write_limit_ns,
                   .upload_silence_limit_ns = config.server.upload_silence_limit_ns},
       .max_arriving_bytes = config.server.max_arriving_bytes,
       .connections = config.server.connections,
       .counters = counters,
       .max_calls_per_connection = config.server.max_calls_per_connection,
       .max_metadata_bytes = config.server.max_metadata_bytes,
       .handshake_limit_ns = config.server.handshake_limit_ns,
       .ping_interval_min_ns = config.server.ping_interval_min_ns,
       .max_ping_strikes = config.server.max_ping_strikes,
       .connection_idle_limit_ns = config.server.connection_idle_limit_ns,
       .connection_age_limit_ns = config.server.connection_age_limit_ns,
       .connection_age_grace_ns = config.server.connection_age_grace_ns,
       .max_scene_watches = config.server.max_scene_watches,
       .max_stats_watches = config.server.max_stats_watches,
       .max_volume_watches = config.server.max_volume_watches,
       .keepalive_interval_ns = config.server.keepalive_interval_ns,
       .keepalive_timeout_ns = config.server.keepalive_timeout_ns,
       .local = local,
       .access = &security->access(),
       .tls = security->tls(),
       .audit = &security->audit(),
       .assets = assets.get(),
       .log = &log},
      *std::move(inherited));
  if (!server.ok()) return Fail(1, server.status());
  security->access().SetOnChange([server = server->get(), &log] {
    const size_t ended = server->EndRevoked();
    if (ended > 0)
      log.Info("calls ended: their callers may not make them any more",
               {{"calls", absl::StrCat(ended)}});
  });
  auto ticker = std::make_unique<access::Ticker>(clock, access::Security::kLookInterval, [&] {
    security->Look();
    const uint64_t peak = core.budget()->TakePeakBytes();
    if (process.Look(core.budget()->used_bytes(), peak)) core.bulk().GiveBackUnused();
  });
  watch.Tell([server = server->get()](bool serving) { server->SetServing(serving); });
  *phase = http::Phase::kServing;

  log.Info("voxeld",
           {{"version", Version()}, {"config", config.file.empty() ? "defaults" : config.file}});
  LogDisplays(core, log);
  std::vector<std::string> addresses;
  for (const Address& address : (*server)->addresses()) {
    if (address != play.listen) addresses.push_back(address.ToString());
  }
  log.Info("ready", {{"listen", absl::StrJoin(addresses, " ")},
                     {"local", local.has_value() ? local->listen.ToString() : "off"},
                     {"http", *http == nullptr ? "off" : (*http)->address().ToString()}});

  // Programs read JSON and may read both outputs as one.
  if (config.log.format == "text") {
    Welcome(core, http->get(), **viewer, TellsControl(config), OptionForClients(addresses));
  }

  const std::string displays_text =
      absl::StrCat(core_displays, core_displays == 1 ? " display" : " displays");
  supervisor.Ready(displays_text);
  std::unique_ptr<access::Ticker> watchdog;
  if (supervisor.watchdog_ns() > 0) {
    watchdog =
        std::make_unique<access::Ticker>(clock, supervisor.watchdog_ns() / 3,
                                         [&core, &supervisor] { FeedWatchdog(core, supervisor); });
  }

  reload::Reloader reloader(config, command_line, ProcessEnvironment(),
                            {.access = security->access(), .core = core, .log = log});
  reloads = &reloader;
  int signal = 0;
  while (sigwait(&signals, &signal) != 0 || signal == SIGHUP) {
    if (signal != SIGHUP) continue;
    log.Info("asked to read its files again");
    supervisor.Reloading();
    (void)reloader.Reload();  // logs the result
    security->Reload();
    supervisor.Ready(displays_text);
    signal = 0;
  }
  end_limit.emplace(kEndLimit);
  const sync::TimeNs stop_by = clock.Now() + kStopLimit;
  reloads = nullptr;
  watchdog.reset();
  supervisor.Stopping();
  ticker.reset();
  security->access().SetOnChange(nullptr);
  log.Info("shutting down", {{"signal", signal == SIGTERM ? "SIGTERM" : "SIGINT"}});
  *phase = http::Phase::kEnding;
  watch.Tell(nullptr);
  if (play.player != nullptr) play.player->End();
  (*server)->Shutdown(kServerLimit);
  const absl::Status stopped = core.Stop(stop_by - clock.Now());
  if (kept != nullptr) kept->Stop();
  http->reset();
  if (!stopped.ok()) {
    log.Error("not all ended", {{"why", std::string(stopped.message())}});
    // A display's thread still uses objects that the destructors would free.
    _exit(1);
  }
  log.Info("stopped");
  return 0;
}

int Main(int argc, char** argv) {
  absl::StatusOr<CommandLine> command_line = ParseCommandLine(argc, argv, Version());
  if (!command_line.ok()) return Fail(kUsageError, command_line.status());
  if (!command_line->print_and_exit.empty()) {
    std::fputs(command_line->print_and_exit.c_str(), stdout);
    return usage::CheckedExit("voxeld", 0);
  }
  absl::StatusOr<Config> config = LoadConfig(command_line->config, ProcessEnvironment());
  if (!config.ok()) return Fail(1, config.status());
  if (absl::Status status = ApplyCommandLine(*command_line, &*config); !status.ok()) {
    return Fail(kUsageError, status);
  }
  if (absl::Status status = CheckSecurity(*config); !status.ok()) return Fail(1, status);
  const absl::StatusOr<Logger::Level> level = Logger::ParseLevel(config->log.level);
  const absl::StatusOr<Logger::Format> format = Logger::ParseFormat(config->log.format);
  if (!level.ok() || !format.ok()) return Fail(1, level.ok() ? format.status() : level.status());

  // Take the sockets before other descriptors and threads exist.
  Supervisor supervisor = Supervisor::OfProcess();
  RaiseDescriptorLimit();
  TuneProcess();
  umask(0007);  // the user and the group can use new sockets from the moment they exist
  std::signal(SIGPIPE, SIG_IGN);
  sigset_t signals;
  sigemptyset(&signals);
  sigaddset(&signals, SIGTERM);
  sigaddset(&signals, SIGINT);
  sigaddset(&signals, SIGHUP);
  pthread_sigmask(SIG_BLOCK, &signals, nullptr);  // before displays start threads: only main waits

  sync::SystemClock clock;
  std::unique_ptr<display::LibusbBus> usb;  // created for the first display that needs it
  const auto shared_usb = [&]() -> absl::StatusOr<display::UsbBus*> {
    if (usb == nullptr) {
      absl::StatusOr<std::unique_ptr<display::LibusbBus>> made = display::LibusbBus::Make(clock);
      if (!made.ok()) return made.status();
      usb = *std::move(made);
    }
    return usb.get();
  };
  absl::StatusOr<Displays> displays = MakeDisplays(*config, {clock, shared_usb});
  if (!displays.ok()) {
    return Fail(command_line->displays.empty() ? 1 : kUsageError, displays.status());
  }
  if (command_line->check_config) {
    std::fputs(ToToml(*config).c_str(), stdout);
    return usage::CheckedExit("voxeld", 0);
  }

  Logger log(*level, *format);
  log.LimitEach(config->log.max_lines_per_second, clock);
  return Serve(*config, *command_line, *std::move(displays), signals, clock, supervisor, log);
}

}  // namespace
}  // namespace voxeld::daemon

int main(int argc, char** argv) {
  voxeld::ExitWhenOutOfMemory();
  try {
    return voxeld::daemon::Main(argc, argv);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "voxeld: cannot go on: %s\n", voxeld::daemon::WhyItEnds(error).c_str());
    return 1;
  }
}
