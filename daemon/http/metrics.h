// The figures as Prometheus text.
#pragma once

#include <string>

#include "daemon/core/stats.h"

namespace voxeld::daemon::http {

inline constexpr const char* kMetricsContentType = "text/plain; version=0.0.4; charset=utf-8";

// Names begin with voxeld_; times are in seconds. Label values are escaped by the serializer.
std::string MetricsText(const Stats& stats);

}  // namespace voxeld::daemon::http
