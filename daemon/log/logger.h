// Writes structured logs to stderr: an event and its fields, as text or as a JSON object, one per
// line. Text from clients and devices is escaped, so that an entry is always one line. A reader
// that does not read never blocks the daemon: lines are dropped then, and a later line reports
// their number. Lines are also dropped when one event is logged more often than a limit.
//
//   text  2026-01-31T12:00:00.000+0000 info session opened session=3 client="a \"b\""
//   json  {"time":"…","level":"info","event":"session opened","session":"3","client":"a \"b\""}
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <initializer_list>
#include <map>
#include <memory>
#include <string>
#include <string_view>

#include "absl/status/statusor.h"
#include "display/sync/clock.h"
#include "display/sync/mutex.h"

namespace spdlog {
class logger;
namespace sinks {
class sink;
}
}  // namespace spdlog

namespace voxeld::daemon {

struct LogField {
  std::string_view key;  // one word
  std::string value;     // any text; bytes that are not UTF-8 are replaced or escaped
};

// Thread-safe.
class Logger {
 public:
  enum class Level : uint8_t { kTrace, kDebug, kInfo, kWarn, kError, kOff };
  enum class Format : uint8_t { kText, kJson };

  // Logs to `descriptor`, which must outlive the logger.
  Logger(Level level, Format format, int descriptor = 2);
  // Logs to `sink` and sets its pattern.
  Logger(Level level, Format format, std::shared_ptr<spdlog::sinks::sink> sink);
  ~Logger();
  Logger(const Logger&) = delete;
  Logger& operator=(const Logger&) = delete;

  // Limits each event to this many lines per second; 0 means no limit. The first line after dropped
  // ones has `lines_left_out`. `clock` must outlive the logger. Call this before other threads log.
  void LimitEach(uint32_t lines_per_second, sync::Clock& clock);
  // Changes the limit (if LimitEach has set a clock) or the level.
  void SetLinesPerSecond(uint32_t lines_per_second);
  void SetLevel(Level level);

  // Parses "trace" … "off", or "text" and "json". Errors: InvalidArgument, which lists them.
  static absl::StatusOr<Level> ParseLevel(std::string_view text);
  static absl::StatusOr<Format> ParseFormat(std::string_view text);

  using Fields = std::initializer_list<LogField>;
  void Log(Level level, std::string_view event, Fields fields = {});
  void Debug(std::string_view event, Fields fields = {}) { Log(Level::kDebug, event, fields); }
  void Info(std::string_view event, Fields fields = {}) { Log(Level::kInfo, event, fields); }
  void Warn(std::string_view event, Fields fields = {}) { Log(Level::kWarn, event, fields); }
  void Error(std::string_view event, Fields fields = {}) { Log(Level::kError, event, fields); }

 private:
  struct Share {
    sync::TimeNs since = 0;
    uint32_t lines = 0;
    uint64_t left_out = 0;
  };
  // The map of events stays small, because event names are constants of the program.
  bool TakeShare(std::string_view event, uint64_t* left_out) VOXELD_EXCLUDES(mutex_);

  const Format format_;
  sync::Clock* clock_ = nullptr;  // null: no limit
  std::atomic<uint32_t> lines_per_second_ = 0;
  sync::Mutex mutex_;
  std::map<std::string, Share, std::less<>> shares_ VOXELD_GUARDED_BY(mutex_);
  const std::unique_ptr<spdlog::logger> logger_;
};

}  // namespace voxeld::daemon
