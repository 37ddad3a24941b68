// Structured logs on stderr: an event and its fields, as text or as a JSON object, one a line.
// Whatever comes from clients and devices is escaped, so that a line is always one line. A reader
// that does not read holds nobody up: lines are left out then, and a later one says how many.
//
//   text  2026-01-31T12:00:00.000+0000 info session opened session=3 client="a \"b\""
//   json  {"time":"…","level":"info","event":"session opened","session":"3","client":"a \"b\""}
#pragma once

#include <initializer_list>
#include <memory>
#include <string>
#include <string_view>

#include "absl/status/statusor.h"

namespace spdlog {
class logger;
namespace sinks {
class sink;
}
}  // namespace spdlog

namespace voxeld::daemon {

struct LogField {
  std::string_view key;  // a word
  std::string value;     // anything; bytes that are not UTF-8 are replaced or escaped
};

// Thread-safe.
class Logger {
 public:
  enum class Level : uint8_t { kTrace, kDebug, kInfo, kWarn, kError, kOff };
  enum class Format : uint8_t { kText, kJson };

  // To stderr, or another descriptor, which outlives the logger.
  Logger(Level level, Format format, int descriptor = 2);
  // To `sink`, whose pattern is set.
  Logger(Level level, Format format, std::shared_ptr<spdlog::sinks::sink> sink);
  ~Logger();
  Logger(const Logger&) = delete;
  Logger& operator=(const Logger&) = delete;

  // "trace" … "off", "text", "json"; InvalidArgument lists them.
  static absl::StatusOr<Level> ParseLevel(std::string_view text);
  static absl::StatusOr<Format> ParseFormat(std::string_view text);

  using Fields = std::initializer_list<LogField>;
  void Log(Level level, std::string_view event, Fields fields = {});
  void Debug(std::string_view event, Fields fields = {}) { Log(Level::kDebug, event, fields); }
  void Info(std::string_view event, Fields fields = {}) { Log(Level::kInfo, event, fields); }
  void Warn(std::string_view event, Fields fields = {}) { Log(Level::kWarn, event, fields); }
  void Error(std::string_view event, Fields fields = {}) { Log(Level::kError, event, fields); }

 private:
  const Format format_;
  const std::unique_ptr<spdlog::logger> logger_;
};

}  // namespace voxeld::daemon
