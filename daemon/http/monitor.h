// Serves /healthz and /metrics on the HTTP port.
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <vector>

#include "daemon/core/core.h"
#include "daemon/http/http_server.h"

namespace voxeld::daemon::http {

// Whether clients can connect. The HTTP port opens earlier.
enum class Phase : uint8_t { kStarting /* and so when it is made */, kServing, kEnding };

// Returns: 200 while the daemon serves and every display is connected and drawn, else 503 with
// {"status":"failing","reasons":[{"display":"sim","what":"lost","why":"…"}]}. A display that
// is being searched for the first time is not a failure. The response is 200 and "degraded" if the
// CPU draws in place of the requested engine, or after an error within the last minute. It is 503
// and "degraded" while the CPU has not drawn yet and the last volume is held.
Response HealthResponse(const std::vector<DisplayDescription>& displays, const Stats& stats,
                        Phase phase);

// Returns: the handler for Server. `core` must outlive every call of it; `phase` is read on each
// call.
Handler MonitorHandler(Core& core, std::shared_ptr<const std::atomic<Phase>> phase);

}  // namespace voxeld::daemon::http
