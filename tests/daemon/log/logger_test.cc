#include "daemon/log/logger.h"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <spdlog/sinks/ostream_sink.h>
#include <unistd.h>

#include <nlohmann/json.hpp>
#include <sstream>

#include "display/sync/fake_clock.h"

namespace voxeld::daemon {
namespace {

using ::testing::EndsWith;
using ::testing::MatchesRegex;

constexpr const char* kNasty = "a \"b\"\n2026 error fake=1 \x1b[31m\xFF é";

class Lines {
 public:
  Lines(Logger::Level level, Logger::Format format)
      : logger(level, format, std::make_shared<spdlog::sinks::ostream_sink_mt>(text_)) {}
  std::string Take() {
    std::string text = text_.str();
    text_.str("");
    return text;
  }

 private:
  std::ostringstream text_;

 public:
  Logger logger;
};

TEST(Logger, TextIsOneLineWhateverIsInIt) {
  Lines lines(Logger::Level::kInfo, Logger::Format::kText);
  lines.logger.Info("session opened", {{"session", "3"}, {"client", kNasty}, {"none", ""}});
  const std::string line = lines.Take();
  EXPECT_EQ(std::count(line.begin(), line.end(), '\n'), 1);
  EXPECT_EQ(line.find('\x1b'), std::string::npos);
  EXPECT_THAT(line, MatchesRegex("[0-9-]+T[0-9:.]+[+-][0-9:]+ info session opened session=3 .*\n"));
  EXPECT_THAT(line, EndsWith(" none=\"\"\n"));
}

TEST(Logger, JsonIsAnObjectALine) {
  Lines lines(Logger::Level::kDebug, Logger::Format::kJson);
  lines.logger.Error("failed", {{"why", kNasty}});
  const auto line = nlohmann::json::parse(lines.Take());
  EXPECT_EQ(line["level"], "error");
  EXPECT_EQ(line["event"], "failed");
  EXPECT_EQ(line["why"], "a \"b\"\n2026 error fake=1 \x1b[31m\xEF\xBF\xBD é");
  EXPECT_TRUE(line.contains("time"));
}

TEST(Logger, OneEventDoesNotDrownTheOthers) {
  sync::FakeClock clock;
  for (const Logger::Format format : {Logger::Format::kText, Logger::Format::kJson}) {
    Lines lines(Logger::Level::kInfo, format);
    lines.logger.LimitEach(2, clock);
    const auto count = [&lines] {
      const std::string text = lines.Take();
      return std::count(text.begin(), text.end(), '\n');
    };
    for (int i = 0; i < 1000; ++i) lines.logger.Info("often", {{"i", std::to_string(i)}});
    EXPECT_EQ(count(), 2);
    lines.logger.Info("seldom");
    EXPECT_EQ(count(), 1);
    clock.Advance(sync::kSecond);
    lines.logger.Info("often");
    const std::string line = lines.Take();
    EXPECT_THAT(line,
                testing::HasSubstr(format == Logger::Format::kJson ? R"("lines_left_out":"998")"
                                                                   : "lines_left_out=998"));
    lines.logger.Info("often");
    EXPECT_THAT(lines.Take(), testing::Not(testing::HasSubstr("left_out")));
    lines.logger.LimitEach(0, clock);
    for (int i = 0; i < 1000; ++i) lines.logger.Info("often");
    EXPECT_EQ(count(), 1000);
  }
}

TEST(Logger, LevelsFilter) {
  Lines lines(Logger::Level::kWarn, Logger::Format::kText);
  lines.logger.Debug("no");
  lines.logger.Info("no");
  EXPECT_EQ(lines.Take(), "");
  lines.logger.Warn("yes");
  EXPECT_THAT(lines.Take(), EndsWith("warning yes\n"));
  Lines off(Logger::Level::kOff, Logger::Format::kText);
  off.logger.Error("no");
  EXPECT_EQ(off.Take(), "");
}

TEST(Logger, WordsOfLevelsAndFormats) {
  EXPECT_EQ(*Logger::ParseLevel("trace"), Logger::Level::kTrace);
  EXPECT_EQ(*Logger::ParseLevel("off"), Logger::Level::kOff);
  EXPECT_TRUE(absl::IsInvalidArgument(Logger::ParseLevel("loud").status()));
  EXPECT_EQ(*Logger::ParseFormat("json"), Logger::Format::kJson);
  EXPECT_TRUE(absl::IsInvalidArgument(Logger::ParseFormat("xml").status()));
}

TEST(Logger, AReaderThatDoesNotReadHoldsNobodyUp) {
  int ends[2];
  ASSERT_EQ(pipe(ends), 0);
  fcntl(ends[0], F_SETFL, O_NONBLOCK);
  constexpr uint64_t kLines = 5000;
  Logger log(Logger::Level::kInfo, Logger::Format::kJson, ends[1]);
  for (uint64_t i = 0; i < kLines; ++i) log.Info("a line", {{"text", std::string(100, 'x')}});
  std::string text;
  const auto read_all = [&] {
    char some[4096];
    for (ssize_t got = 0; (got = read(ends[0], some, sizeof(some))) > 0;) {
      text.append(some, static_cast<size_t>(got));
    }
  };
  read_all();
  log.Info("again");
  read_all();
  close(ends[0]);
  close(ends[1]);

  uint64_t lines = 0, left_out = 0;
  std::istringstream in(text);
  for (std::string line; std::getline(in, line);) {
    const auto object = nlohmann::json::parse(line);
    if (object["event"] == "a line") ++lines;
    if (object.contains("lines")) left_out = std::stoull(object["lines"].get<std::string>());
  }
  EXPECT_GT(lines, 0u);
  EXPECT_GT(left_out, 0u);
  EXPECT_EQ(lines + left_out, kLines);
  EXPECT_THAT(text, ::testing::HasSubstr("\"again\""));
}

}  // namespace
}  // namespace voxeld::daemon
