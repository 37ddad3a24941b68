#include "daemon/log/logger.h"

#include <spdlog/logger.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <utility>

#include "absl/status/status.h"
#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"
#include "common/text/printable.h"
#include "daemon/log/descriptor_sink.h"

namespace voxeld::daemon {
namespace {

constexpr const char* kTextPattern = "%Y-%m-%dT%H:%M:%S.%e%z %l %v";
constexpr const char* kJsonPattern = R"({"time":"%Y-%m-%dT%H:%M:%S.%e%z","level":"%l",%v})";

constexpr std::pair<Logger::Level, std::string_view> kLevels[] = {
    {Logger::Level::kTrace, "trace"}, {Logger::Level::kDebug, "debug"},
    {Logger::Level::kInfo, "info"},   {Logger::Level::kWarn, "warn"},
    {Logger::Level::kError, "error"}, {Logger::Level::kOff, "off"}};

spdlog::level::level_enum ToSpdlog(Logger::Level level) {
  switch (level) {
    case Logger::Level::kTrace:
      return spdlog::level::trace;
    case Logger::Level::kDebug:
      return spdlog::level::debug;
    case Logger::Level::kInfo:
      return spdlog::level::info;
    case Logger::Level::kWarn:
      return spdlog::level::warn;
    case Logger::Level::kError:
      return spdlog::level::err;
    case Logger::Level::kOff:
      return spdlog::level::off;
  }
  return spdlog::level::info;
}

absl::string_view View(std::string_view text) { return {text.data(), text.size()}; }

std::string JsonText(std::string_view text) {
  using Json = nlohmann::json;
  return EscapeJson(Json(std::string(text)).dump(-1, ' ', false, Json::error_handler_t::replace));
}

// Returns: the text, quoted unless it is unambiguous without quotes.
std::string TextValue(std::string_view text) {
  const bool bare = !text.empty() && std::all_of(text.begin(), text.end(), [](unsigned char c) {
    return c > ' ' && c < 0x7F && c != '"' && c != '=' && c != '\\';
  });
  if (bare) return std::string(text);
  return absl::StrCat("\"", absl::CHexEscape(View(text)), "\"");
}

std::string LineOf(Logger::Format format, std::string_view event, Logger::Fields fields,
                   uint64_t left_out = 0) {
  std::string line;
  if (format == Logger::Format::kJson) {
    line = absl::StrCat("\"event\":", JsonText(event));
    for (const LogField& field : fields) {
      absl::StrAppend(&line, ",", JsonText(field.key), ":", JsonText(field.value));
    }
    if (left_out > 0) absl::StrAppend(&line, ",\"lines_left_out\":\"", left_out, "\"");
  } else {
    line = std::string(event);
    for (const LogField& field : fields) {
      absl::StrAppend(&line, " ", View(field.key), "=", TextValue(field.value));
    }
    if (left_out > 0) absl::StrAppend(&line, " lines_left_out=", left_out);
  }
  return line;
}

}  // namespace

Logger::Logger(Level level, Format format, int descriptor)
    : Logger(level, format, std::make_shared<DescriptorSink>(descriptor, [format](uint64_t lines) {
               return LineOf(format, "lines of the log were left out, nobody read them",
                             {{"lines", absl::StrCat(lines)}});
             })) {}

Logger::Logger(Level level, Format format, std::shared_ptr<spdlog::sinks::sink> sink)
    : format_(format), logger_(std::make_unique<spdlog::logger>("voxeld", std::move(sink))) {
  logger_->set_pattern(format == Format::kJson ? kJsonPattern : kTextPattern);
  logger_->set_level(ToSpdlog(level));
  logger_->flush_on(spdlog::level::info);
}

Logger::~Logger() = default;

absl::StatusOr<Logger::Level> Logger::ParseLevel(std::string_view text) {
  for (const auto& [level, name] : kLevels) {
    if (name == text) return level;
  }
  return absl::InvalidArgumentError(absl::StrCat(
      "the log level \"", View(text), "\" is not trace, debug, info, warn, error or off"));
}

absl::StatusOr<Logger::Format> Logger::ParseFormat(std::string_view text) {
  if (text == "text") return Format::kText;
  if (text == "json") return Format::kJson;
  return absl::InvalidArgumentError(
      absl::StrCat("the log format \"", View(text), "\" is not text or json"));
}

void Logger::LimitEach(uint32_t lines_per_second, sync::Clock& clock) {
  clock_ = &clock;
  lines_per_second_ = lines_per_second;
}

void Logger::SetLinesPerSecond(uint32_t lines_per_second) {
  if (clock_ != nullptr) lines_per_second_ = lines_per_second;
}

void Logger::SetLevel(Level level) { logger_->set_level(ToSpdlog(level)); }

bool Logger::TakeShare(std::string_view event, uint64_t* left_out) {
  const sync::MutexLock lock(mutex_);
  const sync::TimeNs now = clock_->Now();
  auto at = shares_.find(event);
  if (at == shares_.end()) at = shares_.emplace(event, Share{.since = now}).first;
  Share& share = at->second;
  if (now - share.since >= sync::kSecond) {
    share.since = now;
    share.lines = 0;
  }
  if (share.lines >= lines_per_second_) {
    ++share.left_out;
    return false;
  }
  ++share.lines;
  *left_out = std::exchange(share.left_out, 0);
  return true;
}

void Logger::Log(Level level, std::string_view event, Fields fields) {
  if (!logger_->should_log(ToSpdlog(level))) return;
  uint64_t left_out = 0;
  if (lines_per_second_ > 0 && !TakeShare(event, &left_out)) return;
  const std::string line = LineOf(format_, event, fields, left_out);
  logger_->log(ToSpdlog(level), spdlog::string_view_t(line.data(), line.size()));
}

}  // namespace voxeld::daemon
