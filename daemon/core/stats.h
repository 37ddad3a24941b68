// The one struct of figures, printed alike to gRPC, JSON and Prometheus.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "display/api/outcome.h"
#include "display/sync/sweep_clock.h"

namespace voxeld::daemon {

// Quantiles over a sliding window: the last 10 s, at most the last 4096 values.
struct LatencyStats {
  uint64_t count = 0;
  int64_t p50_ns = 0, p99_ns = 0, max_ns = 0;
};

struct DisplayFigures {
  std::string name;
  display::DisplayState state = display::DisplayState::kStopped;
  std::string state_reason;
  std::string engine, engine_device, engine_reason;
  uint64_t lit_voxels = 0;
  uint64_t singular_drawables = 0;  // left out: the product of their transforms has no inverse
  uint64_t volumes_drawn = 0, volumes_unchanged = 0, volumes_presented = 0, volumes_replaced = 0,
           volumes_lost = 0;
  double volumes_per_second = 0;
  uint64_t bytes_out = 0, slices_sent = 0, slices_resent = 0, underruns = 0, attaches = 0;
  uint64_t transfers_failed = 0;  // overcome, or the device was lost
  std::string device_trouble;     // that it came back or transfers failed just now; empty: neither
  // Of the engine's part: drawing the volume; slicing it; copying pictures from the device. Where they
  // are packed as the volume is drawn there is no slicing.
  uint64_t volumes_late = 0;  // they missed the sweep before which their sending began
  // Of a display that tells of its sweeps, else as begun.
  sync::SweepLock sweeps;
  // Of a display in a genlock: rounds shown by all; dropped by all, put off, out of step.
  uint64_t genlock_volumes = 0, genlock_dropped = 0, genlock_postponed = 0, genlock_slips = 0;
  // Light that the daemon leaves the display, of 1, where its device has no brightness or power limit of its own;
  // what the display draws by its light, where it is measured; whether a limit is set that nobody keeps.
  double light = 1, power_w = 0;
  bool power_unlimited = false;
  LatencyStats commit_to_last_byte, commit_to_presented, assemble, slice, copy;
  bool packed_as_drawn = false;
  // Of commits presented: applied to drawing, sliced to transferred, transferred to shown.
  LatencyStats waiting, transferring, showing;
  std::string engine_degraded;  // empty: the engine is as was asked for; else what is not, and why
  bool volume_held = false;     // the engine was lost or failed, and nothing has been drawn since
  uint64_t engine_faults = 0, engine_returns = 0;
  uint64_t engine_out_of_memory = 0;  // times that its device had no memory, and the CPU took over
  uint64_t engine_mismatches =
      0;  // it came back with other bytes than the CPU's, and was sent away
  // From the beginning of the volume that the loss interrupted to the CPU's in its place; from the
  // loss to the engine's return. 0: not yet.
  int64_t takeover_last_ns = 0, takeover_max_ns = 0, return_last_ns = 0, return_max_ns = 0;
  int64_t redraw_last_ns = 0, redraw_max_ns = 0;  // of the takeover, from when the loss was known
  std::vector<std::string> pinned_entities;       // drawn by the CPU: they made the GPU fault
  // commits_owed = presented + unchanged + superseded + lost + not_shown + pending, always.
  uint64_t commits_owed = 0, commits_presented = 0, commits_unchanged = 0, commits_superseded = 0,
           commits_lost = 0, commits_not_shown = 0, commits_pending = 0;
};

// What is held for clients, in bytes: core/budget.h.
struct MemoryFigures {
  uint64_t limit = 0, scene = 0, staged = 0, waiting = 0, answers = 0, owed = 0, engines = 0,
           local = 0, arriving = 0;
};

// Connections over gRPC's addresses; the daemon's own (its probe) are in none of these.
struct ListenFigures {
  uint64_t open = 0, accepted = 0;
  // Closed at once: max_connections, max_connections_per_address.
  uint64_t refused_in_all = 0, refused_by_address = 0;
  uint64_t refused_after_cut = 0;  // one of the address was cut shortly before
  // By the guard: too many bytes, too long, before a call was answered; too many calls cancelled; no
  // beginning of a call; bytes without end that no call or message came of.
  uint64_t cut_for_bytes = 0, cut_for_time = 0, cut_for_cancelling = 0;
  uint64_t cut_for_greeting = 0, cut_for_flooding = 0;
  uint64_t cut_for_room = 0;     // unauthorised and idle, to make room for another one
  uint64_t accept_failures = 0;  // out of descriptors, say; tried again until it works
  uint64_t probe_failures = 0;   // of connections to itself
  // Calls whose callers may not make them; those ended since their callers may not any more.
  uint64_t calls_turned_away = 0, calls_revoked = 0;
  uint64_t tls_taken = 0,
           tls_refused = 0;  // certificate and key: times that they were read, and were wrong
  uint64_t audit_pending = 0, audit_lost = 0;  // entries of the audit log, not written yet and lost
  std::string unreachable;                     // empty: they work; else why they do not
  std::string accept_trouble;  // that none could be accepted just now, and why; empty: all is well
  std::string access_trouble;  // what is wrong with grants, certificate or key; empty: nothing
  std::string config_trouble;  // why the configuration was not taken when it was read again
};

// What is kept over the daemon's end.
struct StateFigures {
  uint64_t durable_snapshot = 0;  // that is on the disk; 0: nothing is kept
  uint64_t transactions = 0, rows = 0, bytes = 0, failures = 0;
  std::string trouble;  // why it cannot be kept, or what was put aside; empty: all is well
};

// Content by its hash.
struct AssetFigures {
  uint64_t count = 0;  // whole ones
  uint64_t bytes = 0;  // of these, of parts, and promised to uploads under way
  uint64_t uploaded = 0, evicted = 0, damaged = 0, bytes_in = 0;
  std::string trouble;  // why they are not kept where they should be; empty: all is well
};

// The process as a whole.
struct ProcessFigures {
  uint64_t heap_bytes = 0;        // allocated, as the C library counts
  uint64_t segments_refused = 0;  // memory for arrays and engines that the system did not have
  std::string trouble;            // that there was no memory just now; empty: all is well
  uint64_t pauses = 0;            // times that the process did not run for a second or more
  uint64_t clock_steps = 0;       // times that the wall clock stepped by half a second or more
  std::string time_trouble;       // of the last of these, if it was just now; empty: all is well
};

struct Stats {
  int64_t time_ns = 0;
  std::string version;
  int64_t uptime_ns = 0;
  uint64_t sessions = 0, owners = 0, layers = 0, entities = 0, objects = 0, scene_bytes = 0;
  uint64_t commits_accepted = 0, commits_refused = 0, operations_applied = 0,
           operations_refused = 0;
  uint64_t bytes_in = 0;
  uint64_t outcomes_undelivered = 0;
  uint64_t client_drops = 0;     // frames that clients dropped themselves, by their own word
  uint64_t streams_overrun = 0;  // ended because their client did not read
  uint64_t volume_watches_asleep =
      0;                        // that were sent no more volumes, since nobody took them: times
  uint64_t frames_dropped = 0;  // immediate frames given up by FlowPolicy
  uint64_t timed_pending = 0;   // commits that wait for their present_at
  uint64_t timed_dropped = 0;   // waiting still when their session ended
  uint64_t must_show_timeouts = 0;
  uint64_t sessions_dormant = 0;  // gone, can be resumed
  uint64_t sessions_resumed = 0;
  // By stage, of commits: sent to received, to decoded, to applied.
  LatencyStats sending, decoding, applying;
  MemoryFigures memory;
  ListenFigures connections;
  StateFigures state;
  AssetFigures assets;
  ProcessFigures process;
  std::vector<DisplayFigures> displays;
};

}  // namespace voxeld::daemon
