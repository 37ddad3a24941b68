#include "daemon/http/monitor.h"

#include <nlohmann/json.hpp>
#include <string>
#include <utility>

#include "common/text/printable.h"
#include "daemon/http/metrics.h"

namespace voxeld::daemon::http {
namespace {

using Json = nlohmann::ordered_json;

Response Unavailable(const absl::Status& status) {
  return {503, "text/plain; charset=utf-8", std::string(status.message()) + "\n"};
}

}  // namespace

Response HealthResponse(const std::vector<DisplayDescription>& displays, const Stats& stats,
                        Phase phase) {
  Json reasons = Json::array();
  bool held = false;
  if (phase == Phase::kStarting) reasons.push_back({{"what", "starting"}});
  if (phase == Phase::kEnding) {
    // Displays stop during a shutdown, so they are not reported as faulty.
    return {503, "application/json",
            "{\"status\":\"failing\",\"reasons\":[{\"what\":\"shutting down\"}]}\n"};
  }
  for (const DisplayDescription& display : displays) {
    if (display.state != display::DisplayState::kLost &&
        display.state != display::DisplayState::kStopped) {
      continue;
    }
    reasons.push_back({{"display", display.info.name},
                       {"what", DisplayStateName(display.state)},
                       {"why", display.state_reason}});
  }
  for (const DisplayFigures& figures : stats.displays) {
    if (!figures.engine.empty()) continue;
    reasons.push_back(
        {{"display", figures.name}, {"what", "no engine"}, {"why", figures.engine_reason}});
  }
  if (!stats.connections.unreachable.empty()) {
    reasons.push_back({{"what", "not reachable"}, {"why", stats.connections.unreachable}});
  }
  const bool fails = !reasons.empty();
  if (!stats.state.trouble.empty()) {
    reasons.push_back({{"what", "state"}, {"why", stats.state.trouble}});
  }
  if (!stats.assets.trouble.empty()) {
    reasons.push_back({{"what", "assets"}, {"why", stats.assets.trouble}});
  }
  if (!stats.connections.access_trouble.empty()) {
    reasons.push_back({{"what", "access"}, {"why", stats.connections.access_trouble}});
  }
  if (!stats.connections.config_trouble.empty()) {
    reasons.push_back({{"what", "configuration"}, {"why", stats.connections.config_trouble}});
  }
  if (!stats.connections.accept_trouble.empty()) {
    reasons.push_back({{"what", "connections"}, {"why", stats.connections.accept_trouble}});
  }
  if (!stats.process.trouble.empty()) {
    reasons.push_back({{"what", "memory"}, {"why", stats.process.trouble}});
  }
  if (!stats.process.time_trouble.empty()) {
    reasons.push_back({{"what", "time"}, {"why", stats.process.time_trouble}});
  }
  for (const DisplayFigures& figures : stats.displays) {
    const bool lost = figures.state == display::DisplayState::kLost;  // already reported above
    if (!figures.device_trouble.empty() && !lost) {
      reasons.push_back(
          {{"display", figures.name}, {"what", "device"}, {"why", figures.device_trouble}});
    }
    held = held || figures.volume_held;
    if (figures.engine_degraded.empty()) continue;
    Json reason = {
        {"display", figures.name},
        {"what", figures.volume_held ? "the last volume is held" : "the engine is degraded"},
        {"why", figures.engine_degraded}};
    if (!figures.pinned_entities.empty()) reason["pinned"] = figures.pinned_entities;
    reasons.push_back(std::move(reason));
  }
  const char* status = fails ? "failing" : reasons.empty() ? "ok" : "degraded";
  const Json answer = {{"status", status}, {"reasons", std::move(reasons)}};
  return {fails || held ? 503u : 200u, "application/json",
          EscapeJson(answer.dump(-1, ' ', false, Json::error_handler_t::replace)) + "\n"};
}

Handler MonitorHandler(Core& core, std::shared_ptr<const std::atomic<Phase>> phase) {
  return [&core, phase](const Request& request, Done done) {
    const std::string_view path = request.path;
    if (path == "/metrics") {
      core.GetStats([done](absl::StatusOr<Stats> stats) {
        if (!stats.ok()) return done(Unavailable(stats.status()));
        done({200, kMetricsContentType, MetricsText(*stats)});
      });
      return true;
    }
    if (path == "/healthz") {
      core.ListDisplays([&core, phase,
                         done](absl::StatusOr<std::vector<DisplayDescription>> displays) {
        if (!displays.ok()) return done(Unavailable(displays.status()));
        core.GetStats([phase, done, displays = *std::move(displays)](absl::StatusOr<Stats> stats) {
          if (!stats.ok()) return done(Unavailable(stats.status()));
          done(HealthResponse(displays, *stats, *phase));
        });
      });
      return true;
    }
    return false;
  };
}

}  // namespace voxeld::daemon::http
