// Formats the statistics as Prometheus text.
#pragma once

#include <string>

#include "daemon/core/stats.h"

namespace voxeld::daemon::http {

inline constexpr const char* kMetricsContentType = "text/plain; version=0.0.4; charset=utf-8";

// Names begin with voxeld_ and times are in seconds. The serializer escapes label values.
std::string MetricsText(const Stats& stats);

}  // namespace voxeld::daemon::http
