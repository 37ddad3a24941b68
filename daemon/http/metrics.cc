#include "daemon/http/metrics.h"

#include <prometheus/metric_family.h>
#include <prometheus/text_serializer.h>

#include <limits>
#include <utility>
#include <vector>

#include "display/api/outcome.h"

namespace voxeld::daemon::http {
namespace {

using prometheus::ClientMetric;
using prometheus::MetricFamily;
using prometheus::MetricType;

constexpr double kNsPerSecond = 1e9;

template <typename Owner>
struct Row {
  const char* name;
  uint64_t Owner::*figure;
  MetricType type;
  const char* help;
};

// Lists each metric once.
constexpr Row<Stats> kDaemonRows[] = {
    {"voxeld_sessions", &Stats::sessions, MetricType::Gauge, "Open sessions"},
    {"voxeld_owners", &Stats::owners, MetricType::Gauge, "Owners of layers or sessions"},
    {"voxeld_layers", &Stats::layers, MetricType::Gauge, "Layers"},
    {"voxeld_entities", &Stats::entities, MetricType::Gauge, "Entities retained"},
    {"voxeld_objects", &Stats::objects, MetricType::Gauge, "Objects defined"},
    {"voxeld_scene_bytes", &Stats::scene_bytes, MetricType::Gauge, "Retained payload"},
    {"voxeld_commits_accepted_total", &Stats::commits_accepted, MetricType::Counter,
     "Commits applied"},
    {"voxeld_commits_refused_total", &Stats::commits_refused, MetricType::Counter,
     "Commits refused whole"},
    {"voxeld_operations_applied_total", &Stats::operations_applied, MetricType::Counter,
     "Operations applied"},
    {"voxeld_operations_refused_total", &Stats::operations_refused, MetricType::Counter,
     "Operations refused, each with an issue"},
    {"voxeld_bytes_in_total", &Stats::bytes_in, MetricType::Counter, "Bytes of requests taken in"},
    {"voxeld_outcomes_undelivered_total", &Stats::outcomes_undelivered, MetricType::Counter,
     "Outcomes owed to clients that had gone"},
    {"voxeld_client_drops_total", &Stats::client_drops, MetricType::Counter,
     "Frames that clients dropped themselves, by their own word"},
    {"voxeld_streams_overrun_total", &Stats::streams_overrun, MetricType::Counter,
     "Streams ended because their client did not read"},
    {"voxeld_volume_watches_asleep_total", &Stats::volume_watches_asleep, MetricType::Counter,
     "Times that a watcher of volumes, a page say, took none for a second and was sent no more"},
    {"voxeld_frames_dropped_total", &Stats::frames_dropped, MetricType::Counter,
     "Immediate frames given up, as their clients' flow policy says"},
    {"voxeld_timed_commits_pending", &Stats::timed_pending, MetricType::Gauge,
     "Commits that wait for their time"},
    {"voxeld_timed_commits_dropped_total", &Stats::timed_dropped, MetricType::Counter,
     "Commits whose session ended before their time"},
    {"voxeld_must_show_timeouts_total", &Stats::must_show_timeouts, MetricType::Counter,
     "Commits that had to be shown, without an outcome in time"},
    {"voxeld_sessions_dormant", &Stats::sessions_dormant, MetricType::Gauge,
     "Sessions without a stream that can be taken up"},
    {"voxeld_sessions_resumed_total", &Stats::sessions_resumed, MetricType::Counter,
     "Sessions taken up"},
};

struct MemoryRow {
  const char* use;
  uint64_t MemoryFigures::*figure;
};

constexpr MemoryRow kMemoryRows[] = {
    {"scene", &MemoryFigures::scene},     {"staged", &MemoryFigures::staged},
    {"waiting", &MemoryFigures::waiting}, {"answers", &MemoryFigures::answers},
    {"owed", &MemoryFigures::owed},       {"engines", &MemoryFigures::engines},
    {"local", &MemoryFigures::local},     {"arriving", &MemoryFigures::arriving},
};

constexpr Row<ListenFigures> kConnectionRows[] = {
    {"voxeld_connections", &ListenFigures::open, MetricType::Gauge, "Open connections over gRPC"},
    {"voxeld_connections_accepted_total", &ListenFigures::accepted, MetricType::Counter,
     "Connections accepted"},
    {"voxeld_connections_refused_in_all_total", &ListenFigures::refused_in_all, MetricType::Counter,
     "Connections closed at once: max_connections were open"},
    {"voxeld_connections_refused_by_address_total", &ListenFigures::refused_by_address,
     MetricType::Counter, "Connections closed at once: max_connections_per_address were open"},
    {"voxeld_connections_cut_for_bytes_total", &ListenFigures::cut_for_bytes, MetricType::Counter,
     "Connections cut: too many bytes before a call was answered"},
    {"voxeld_connections_cut_for_time_total", &ListenFigures::cut_for_time, MetricType::Counter,
     "Connections cut: too long without an answered call"},
    {"voxeld_connections_cut_for_cancelling_total", &ListenFigures::cut_for_cancelling,
     MetricType::Counter, "Connections cut: too many cancelled calls within a second"},
    {"voxeld_connections_cut_for_greeting_total", &ListenFigures::cut_for_greeting,
     MetricType::Counter, "Connections cut: what came was not the beginning of a call"},
    {"voxeld_connections_cut_for_flooding_total", &ListenFigures::cut_for_flooding,
     MetricType::Counter, "Connections cut: bytes without end that no call or message came of"},
    {"voxeld_connections_cut_for_room_total", &ListenFigures::cut_for_room, MetricType::Counter,
     "Connections cut: unauthorised and idle, when another one needed the place"},
    {"voxeld_connections_refused_after_cut_total", &ListenFigures::refused_after_cut,
     MetricType::Counter, "Connections closed at once: one of the address was cut shortly before"},
    {"voxeld_accept_failures_total", &ListenFigures::accept_failures, MetricType::Counter,
     "Times that no connection could be accepted, out of descriptors say"},
    {"voxeld_probe_failures_total", &ListenFigures::probe_failures, MetricType::Counter,
     "Connections of the daemon to itself that failed"},
    {"voxeld_audit_entries_pending", &ListenFigures::audit_pending, MetricType::Gauge,
     "Audit entries that are not written yet"},
    {"voxeld_audit_entries_lost_total", &ListenFigures::audit_lost, MetricType::Counter,
     "Audit entries that were dropped because the file could not be written and the buffer was "
     "full"},
    {"voxeld_tls_files_taken_total", &ListenFigures::tls_taken, MetricType::Counter,
     "Times that certificate, key and clients' authority were read and taken, at the start too"},
    {"voxeld_tls_files_refused_total", &ListenFigures::tls_refused, MetricType::Counter,
     "Times that certificate, key or clients' authority were read and were wrong"},
    {"voxeld_calls_turned_away_total", &ListenFigures::calls_turned_away, MetricType::Counter,
     "Calls whose callers may not make them"},
    {"voxeld_calls_revoked_total", &ListenFigures::calls_revoked, MetricType::Counter,
     "Calls ended since their callers may not make them any more"},
};

constexpr Row<StateFigures> kStateRows[] = {
    {"voxeld_state_durable_snapshot", &StateFigures::durable_snapshot, MetricType::Gauge,
     "The newest snapshot that is on the disk; 0: nothing is kept"},
    {"voxeld_state_transactions_total", &StateFigures::transactions, MetricType::Counter,
     "Transactions that wrote what is kept"},
    {"voxeld_state_rows_total", &StateFigures::rows, MetricType::Counter,
     "Rows written or removed by them"},
    {"voxeld_state_bytes_total", &StateFigures::bytes, MetricType::Counter,
     "Bytes written by them"},
    {"voxeld_state_failures_total", &StateFigures::failures, MetricType::Counter,
     "Transactions that failed, and are tried again"},
};

constexpr Row<AssetFigures> kAssetRows[] = {
    {"voxeld_assets", &AssetFigures::count, MetricType::Gauge, "Whole assets that are here"},
    {"voxeld_asset_bytes", &AssetFigures::bytes, MetricType::Gauge,
     "Bytes of assets, of parts of them, and promised to uploads under way"},
    {"voxeld_assets_uploaded_total", &AssetFigures::uploaded, MetricType::Counter,
     "Assets that came whole"},
    {"voxeld_assets_evicted_total", &AssetFigures::evicted, MetricType::Counter,
     "Assets and parts of them that went for others"},
    {"voxeld_assets_damaged_total", &AssetFigures::damaged, MetricType::Counter,
     "Assets that had another hash on the disk than when they came"},
    {"voxeld_asset_bytes_in_total", &AssetFigures::bytes_in, MetricType::Counter,
     "Bytes of assets that came"},
};

constexpr Row<ProcessFigures> kProcessRows[] = {
    {"voxeld_process_heap_bytes", &ProcessFigures::heap_bytes, MetricType::Gauge,
     "Bytes that are allocated"},
    {"voxeld_process_segments_refused_total", &ProcessFigures::segments_refused,
     MetricType::Counter, "Times that the system had no memory for arrays or engines"},
    {"voxeld_process_pauses_total", &ProcessFigures::pauses, MetricType::Counter,
     "Times that the process did not run for a second or more: it or its machine was stopped"},
    {"voxeld_process_clock_steps_total", &ProcessFigures::clock_steps, MetricType::Counter,
     "Times that the wall clock stepped by half a second or more"},
};

constexpr Row<DisplayFigures> kDisplayRows[] = {
    {"voxeld_display_lit_voxels", &DisplayFigures::lit_voxels, MetricType::Gauge,
     "Voxels that are not black"},
    {"voxeld_display_singular_drawables", &DisplayFigures::singular_drawables, MetricType::Gauge,
     "Entities left out, because the product of their transforms has no inverse"},
    {"voxeld_display_volumes_drawn_total", &DisplayFigures::volumes_drawn, MetricType::Counter,
     "Volumes drawn by the engine"},
    {"voxeld_display_volumes_unchanged_total", &DisplayFigures::volumes_unchanged,
     MetricType::Counter, "Volumes drawn that looked like the one before, and were not sent"},
    {"voxeld_display_volumes_presented_total", &DisplayFigures::volumes_presented,
     MetricType::Counter, "Volumes shown whole"},
    {"voxeld_display_volumes_replaced_total", &DisplayFigures::volumes_replaced,
     MetricType::Counter, "Volumes whose place a newer one took before they were sent"},
    {"voxeld_display_volumes_lost_total", &DisplayFigures::volumes_lost, MetricType::Counter,
     "Volumes whose sending or showing failed"},
    {"voxeld_display_bytes_out_total", &DisplayFigures::bytes_out, MetricType::Counter,
     "Bytes handed to the transport"},
    {"voxeld_display_slices_sent_total", &DisplayFigures::slices_sent, MetricType::Counter,
     "Slices sent"},
    {"voxeld_display_slices_resent_total", &DisplayFigures::slices_resent, MetricType::Counter,
     "Slices sent again at the device's request"},
    {"voxeld_display_underruns_total", &DisplayFigures::underruns, MetricType::Counter,
     "Sweeps that repeated a volume while a newer was on its way"},
    {"voxeld_display_volumes_late_total", &DisplayFigures::volumes_late, MetricType::Counter,
     "Volumes that missed the sweep before which their sending began"},
    {"voxeld_display_genlock_volumes_total", &DisplayFigures::genlock_volumes, MetricType::Counter,
     "Volumes that all displays of the genlock have shown"},
    {"voxeld_display_genlock_dropped_total", &DisplayFigures::genlock_dropped, MetricType::Counter,
     "Volumes dropped by all displays of the genlock, since one could not have them"},
    {"voxeld_display_genlock_postponed_total", &DisplayFigures::genlock_postponed,
     MetricType::Counter, "Orders to show a volume that were put off"},
    {"voxeld_display_genlock_slips_total", &DisplayFigures::genlock_slips, MetricType::Counter,
     "Volumes that not all displays of the genlock have shown at one time"},
    {"voxeld_display_attaches_total", &DisplayFigures::attaches, MetricType::Counter,
     "Times that the device was set up"},
    {"voxeld_display_transfers_failed_total", &DisplayFigures::transfers_failed,
     MetricType::Counter, "Transfers that failed, and were overcome or lost the device"},
    {"voxeld_display_commits_owed_total", &DisplayFigures::commits_owed, MetricType::Counter,
     "Commits accepted while the display existed"},
    {"voxeld_display_commits_presented_total", &DisplayFigures::commits_presented,
     MetricType::Counter, "Commits shown"},
    {"voxeld_display_commits_unchanged_total", &DisplayFigures::commits_unchanged,
     MetricType::Counter, "Commits that changed nothing on the display"},
    {"voxeld_display_commits_superseded_total", &DisplayFigures::commits_superseded,
     MetricType::Counter, "Commits in whose volume a newer one of the same stream rode"},
    {"voxeld_display_commits_lost_total", &DisplayFigures::commits_lost, MetricType::Counter,
     "Commits whose volume was lost"},
    {"voxeld_display_commits_not_shown_total", &DisplayFigures::commits_not_shown,
     MetricType::Counter, "Commits on an absent or blanked display, or in hidden layers"},
    {"voxeld_display_engine_faults_total", &DisplayFigures::engine_faults, MetricType::Counter,
     "Times that the engine was lost, or faulted when it was tried again"},
    {"voxeld_display_engine_out_of_memory_total", &DisplayFigures::engine_out_of_memory,
     MetricType::Counter,
     "Times that its device had no memory for the scene, and the CPU took over"},
    {"voxeld_display_engine_returns_total", &DisplayFigures::engine_returns, MetricType::Counter,
     "Times that it came back"},
    {"voxeld_display_engine_mismatches_total", &DisplayFigures::engine_mismatches,
     MetricType::Counter, "Times that it drew other bytes than the CPU, and was sent away again"},
    {"voxeld_display_commits_pending", &DisplayFigures::commits_pending, MetricType::Gauge,
     "Commits that wait for their outcome"},
};

template <typename Owner>
struct LatencyRow {
  const char* name;
  LatencyStats Owner::*figure;
  const char* help;
};

constexpr LatencyRow<Stats> kDaemonLatencyRows[] = {
    {"voxeld_commit_sending_seconds", &Stats::sending,
     "From a commit's sending, by its client's word, to its receipt, over 10 s"},
    {"voxeld_commit_decoding_seconds", &Stats::decoding, "Of a commit's last message, over 10 s"},
    {"voxeld_commit_applying_seconds", &Stats::applying,
     "From decoded to its snapshot, its turn included, over 10 s"},
};

constexpr LatencyRow<DisplayFigures> kLatencyRows[] = {
    {"voxeld_display_waiting_seconds", &DisplayFigures::waiting,
     "From a commit's snapshot to the drawing of its volume, over 10 s"},
    {"voxeld_display_transferring_seconds", &DisplayFigures::transferring,
     "From a volume's slices to its last byte handed to the transport, over 10 s"},
    {"voxeld_display_showing_seconds", &DisplayFigures::showing,
     "From a volume's last byte to its presentation, over 10 s"},
    {"voxeld_display_commit_to_last_byte_seconds", &DisplayFigures::commit_to_last_byte,
     "From a commit to its last byte handed to the transport, over 10 s"},
    {"voxeld_display_commit_to_presented_seconds", &DisplayFigures::commit_to_presented,
     "From a commit to its presentation, over 10 s"},
    {"voxeld_display_assemble_seconds", &DisplayFigures::assemble,
     "The engine's blending of a frame, over 10 s"},
    {"voxeld_display_slice_seconds", &DisplayFigures::slice,
     "The engine's slicing of a frame, over 10 s"},
    {"voxeld_display_copy_seconds", &DisplayFigures::copy,
     "The engine's copying of a frame's pictures from its device, over 10 s"},
};

constexpr display::DisplayState kStates[] = {
    display::DisplayState::kStopped, display::DisplayState::kAttaching,
    display::DisplayState::kShowing, display::DisplayState::kBlanked, display::DisplayState::kLost};

using Labels = std::vector<std::pair<const char*, std::string>>;

void Add(MetricFamily* family, const Labels& labels, double value) {
  ClientMetric metric;
  for (const auto& [name, text] : labels) metric.label.push_back({name, text});
  if (family->type == MetricType::Counter) {
    metric.counter.value = value;
  } else {
    metric.gauge.value = value;
  }
  family->metric.push_back(std::move(metric));
}

class Families {
 public:
  MetricFamily* New(const char* name, MetricType type, const char* help) {
    all_.push_back({name, help, type, {}});
    return &all_.back();
  }
  void Gauge(const char* name, const char* help, const Labels& labels, double value) {
    Add(New(name, MetricType::Gauge, help), labels, value);
  }
  std::string Text() const { return prometheus::TextSerializer().Serialize(all_); }

 private:
  std::vector<MetricFamily> all_;
};

void AddLatency(MetricFamily* family, const Labels& labels, const LatencyStats& latency) {
  // Gauges for recent values. The numbers of a summary cover the time since the start.
  for (const auto& [stat, ns] :
       {std::pair("p50", latency.p50_ns), {"p99", latency.p99_ns}, {"max", latency.max_ns}}) {
    Labels all = labels;
    all.emplace_back("stat", stat);
    Add(family, all,
        latency.count == 0 ? std::numeric_limits<double>::quiet_NaN()
                           : static_cast<double>(ns) / kNsPerSecond);
  }
}

void AddSweeps(const std::vector<DisplayFigures>& displays, Families* out) {
  MetricFamily* lock = out->New("voxeld_display_sweep_locked", MetricType::Gauge,
                                "1 while the display's sweeps are known well, else 0");
  MetricFamily* losses = out->New("voxeld_display_sweep_losses_total", MetricType::Counter,
                                  "Times that the lock to the sweeps was lost");
  MetricFamily* drift = out->New("voxeld_display_sweep_drift_ppm", MetricType::Gauge,
                                 "Of the rate of sweeps against the nominal one");
  MetricFamily* light = out->New("voxeld_display_light", MetricType::Gauge,
                                 "That the daemon leaves the picture, 0 to 1");
  MetricFamily* power = out->New("voxeld_display_power_watts", MetricType::Gauge,
                                 "By the picture's light, where the daemon keeps the power limit");
  MetricFamily* unlimited =
      out->New("voxeld_display_power_unlimited", MetricType::Gauge,
               "1 while a power limit is set that neither the device nor the daemon keeps, else 0");
  for (const DisplayFigures& display : displays) {
    Add(unlimited, {{"display", display.name}}, display.power_unlimited ? 1 : 0);
    const bool locked = display.sweeps.state == sync::SweepLock::State::kLocked;
    Add(lock, {{"display", display.name}}, locked ? 1 : 0);
    Add(losses, {{"display", display.name}}, static_cast<double>(display.sweeps.losses));
    Add(drift, {{"display", display.name}}, display.sweeps.drift_ppm);
    Add(light, {{"display", display.name}}, display.light);
    Add(power, {{"display", display.name}}, display.power_w);
  }
}

void AddDisplays(const std::vector<DisplayFigures>& displays, Families* out) {
  for (const auto& row : kDisplayRows) {
    MetricFamily* family = out->New(row.name, row.type, row.help);
    for (const DisplayFigures& display : displays) {
      Add(family, {{"display", display.name}}, static_cast<double>(display.*row.figure));
    }
  }
  for (const auto& row : kLatencyRows) {
    MetricFamily* family = out->New(row.name, MetricType::Gauge, row.help);
    for (const DisplayFigures& display : displays) {
      AddLatency(family, {{"display", display.name}}, display.*row.figure);
    }
  }
  MetricFamily* rate = out->New("voxeld_display_volumes_per_second", MetricType::Gauge,
                                "Volumes presented, over 2 s");
  for (const DisplayFigures& display : displays) {
    Add(rate, {{"display", display.name}}, display.volumes_per_second);
  }
  AddSweeps(displays, out);
  MetricFamily* degraded =
      out->New("voxeld_display_engine_degraded", MetricType::Gauge,
               "1 while the engine is not as was asked for; 2 while the last volume is held");
  for (const DisplayFigures& display : displays) {
    Add(degraded, {{"display", display.name}},
        display.volume_held               ? 2
        : display.engine_degraded.empty() ? 0
                                          : 1);
  }
  MetricFamily* packed = out->New("voxeld_display_packed_as_drawn", MetricType::Gauge,
                                  "1 where pictures are packed as the volume is drawn, else 0");
  for (const DisplayFigures& display : displays) {
    Add(packed, {{"display", display.name}}, display.packed_as_drawn ? 1 : 0);
  }
  MetricFamily* times = out->New("voxeld_display_engine_recovery_seconds", MetricType::Gauge,
                                 "Of the last loss of the engine: until the CPU had drawn in its "
                                 "place (redraw: from when the loss was known), and until it came "
                                 "back; 0: not yet");
  for (const DisplayFigures& display : displays) {
    for (const auto& [what, ns] : {std::pair("takeover", display.takeover_last_ns),
                                   {"redraw", display.redraw_last_ns},
                                   {"return", display.return_last_ns}}) {
      Add(times, {{"display", display.name}, {"what", what}},
          static_cast<double>(ns) / kNsPerSecond);
    }
  }
  MetricFamily* states =
      out->New("voxeld_display_state", MetricType::Gauge, "1 for the state that the display is in");
  for (const DisplayFigures& display : displays) {
    for (const display::DisplayState state : kStates) {
      Add(states, {{"display", display.name}, {"state", DisplayStateName(state)}},
          display.state == state ? 1 : 0);
    }
  }
  MetricFamily* engines =
      out->New("voxeld_display_engine_info", MetricType::Gauge, "1; which engine, and why");
  for (const DisplayFigures& display : displays) {
    Add(engines,
        {{"display", display.name},
         {"engine", display.engine},
         {"device", display.engine_device},
         {"reason", display.engine_reason}},
        1);
  }
}

}  // namespace

std::string MetricsText(const Stats& stats) {
  Families families;
  families.Gauge("voxeld_info", "1; which version", {{"version", stats.version}}, 1);
  families.Gauge("voxeld_uptime_seconds", "Since the daemon started", {},
                 static_cast<double>(stats.uptime_ns) / kNsPerSecond);
  for (const auto& row : kDaemonRows) {
    Add(families.New(row.name, row.type, row.help), {}, static_cast<double>(stats.*row.figure));
  }
  for (const auto& row : kDaemonLatencyRows) {
    AddLatency(families.New(row.name, MetricType::Gauge, row.help), {}, stats.*row.figure);
  }
  families.Gauge("voxeld_memory_limit_bytes", "What may be held for clients, together", {},
                 static_cast<double>(stats.memory.limit));
  MetricFamily* memory = families.New("voxeld_memory_bytes", MetricType::Gauge,
                                      "What is held for clients, by what it is for");
  for (const MemoryRow& row : kMemoryRows) {
    Add(memory, {{"use", row.use}}, static_cast<double>(stats.memory.*row.figure));
  }
  for (const auto& row : kConnectionRows) {
    Add(families.New(row.name, row.type, row.help), {},
        static_cast<double>(stats.connections.*row.figure));
  }
  for (const auto& row : kStateRows) {
    Add(families.New(row.name, row.type, row.help), {},
        static_cast<double>(stats.state.*row.figure));
  }
  for (const auto& row : kAssetRows) {
    Add(families.New(row.name, row.type, row.help), {},
        static_cast<double>(stats.assets.*row.figure));
  }
  for (const auto& row : kProcessRows) {
    Add(families.New(row.name, row.type, row.help), {},
        static_cast<double>(stats.process.*row.figure));
  }
  AddDisplays(stats.displays, &families);
  return families.Text();
}

}  // namespace voxeld::daemon::http
