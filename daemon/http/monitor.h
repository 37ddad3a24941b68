// What the http port answers: /healthz and /metrics.
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <vector>

#include "daemon/core/core.h"
#include "daemon/http/http_server.h"

namespace voxeld::daemon::http {

// Whether clients can connect: before, the http port is there already.
enum class Phase : uint8_t { kStarting /* and so when it is made */, kServing, kEnding };

// 200 while every display is there and is drawn for and the daemon serves, else 503:
// {"status":"failing","reasons":[{"display":"sim","what":"lost","why":"…"}]}. A display that is
// being looked for for the first time fails nothing. An engine that is not as was asked for, while
// the CPU draws in its place, and what went wrong within the last minute, is 200 and "degraded"; 503 and "degraded" while it has not drawn yet
// and the last volume is held.
Response HealthResponse(const std::vector<DisplayDescription>& displays, const Stats& stats,
                        Phase phase);

// The handler for Server. `core` outlives every call of it; `phase` is looked at with each.
Handler MonitorHandler(Core& core, std::shared_ptr<const std::atomic<Phase>> phase);

}  // namespace voxeld::daemon::http
