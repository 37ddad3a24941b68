// Objects and limits that all services share.
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <string>

#include "daemon/access/access.h"
#include "daemon/access/audit.h"
#include "daemon/assets/asset_store.h"
#include "daemon/core/core.h"
#include "daemon/explain/explainer.h"
#include "daemon/listen/counters.h"
#include "daemon/listen/log_gate.h"
#include "daemon/local/local_socket.h"
#include "daemon/log/logger.h"
#include "daemon/services/active_calls.h"
#include "daemon/services/watch_slots.h"
#include "daemon/text/fonts.h"
#include "display/sync/clock.h"
#include "gpu/call_queue.h"

namespace voxeld::daemon::services {

struct StreamLimits {
  // How long a new stream waits for its Open.
  sync::TimeNs open_limit_ns = 5 * sync::kSecond;
  // How long a half-closed stream waits for pending outcomes, and how long an ending stream waits
  // for its client to read what is queued.
  sync::TimeNs drain_limit_ns = 5 * sync::kSecond;
  // Limits on answers that a client has not read. Beyond them its stream ends with
  // RESOURCE_EXHAUSTED.
  size_t max_queued_answers = 16384;
  size_t max_queued_bytes = 16u << 20;
  // How long a message of WatchScene may wait for its client before the watch ends.
  sync::TimeNs watch_write_limit_ns = 30 * sync::kSecond;
  // An upload that receives nothing for this long is ended; its bytes stay for a while.
  sync::TimeNs upload_silence_limit_ns = 30 * sync::kSecond;
};

// Outlives the services. The core, the clock and the assets must outlive it.
struct ServiceContext {
  Core& core;
  sync::Clock& clock;
  listen::Counters& counters;
  std::string version;
  Logger* log = nullptr;  // may be null
  StreamLimits limits;
  WatchSlots scene_watches{"the scene", "max_scene_watches", 64};
  // Watches that ended because their clients did not read. gRPC holds one message of each until
  // they do.
  WatchSlots stalled_watches{"the scene whose clients do not read", "max_scene_watches", 64};
  WatchSlots stats_watches{"the statistics", "max_stats_watches", 64};
  WatchSlots volume_watches{"volumes", "max_volume_watches", 16};
  const access::Access* access = nullptr;  // null: everybody has all scopes
  access::Audit* audit = nullptr;          // null: no audit log
  assets::AssetStore* assets = nullptr;    // null: uploads are rejected

  listen::LogGate turned_away_gate{clock, log};
  ActiveCalls calls;        // streams, watches, captures
  ActiveCalls short_calls;  // all others
  // Limit on open calls; the asset store limits how many of them have a running upload.
  static constexpr uint32_t kMostUploads = 32;
  std::atomic<uint32_t> uploads = 0;
  // Running captures, including those whose client has gone but that the core has not released yet.
  // Shared, because the core may hold them longer than the server exists.
  std::shared_ptr<std::atomic<uint32_t>> captures = std::make_shared<std::atomic<uint32_t>>(0);
  std::unique_ptr<local::LocalSocket> local;  // may be null
  text::Fonts fonts;
  // Shared, because the core may answer it after the server has been destroyed.
  static constexpr size_t kMostExplanationsWaiting = 8;
  std::shared_ptr<ExplainerThread> explainer =
      std::make_shared<ExplainerThread>(kMostExplanationsWaiting);
  // Writes uploaded pieces. Destroyed first, because its calls use all of this.
  std::unique_ptr<gpu::CallQueue> asset_calls =
      std::make_unique<gpu::CallQueue>(/*run_inline=*/false);
};

}  // namespace voxeld::daemon::services
