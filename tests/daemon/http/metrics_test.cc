#include "daemon/http/metrics.h"

#include <gmock/gmock.h>

#include <set>
#include <sstream>

#include "daemon/http/monitor.h"

namespace voxeld::daemon::http {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

TEST(Metrics, EveryFigureStandsThereOnce) {
  Stats stats;
  stats.version = "1.2";
  stats.uptime_ns = 1'500'000'000;
  stats.commits_accepted = 12345678901;
  for (const char* name : {"one", "two"}) {
    DisplayFigures& display = stats.displays.emplace_back();
    display.name = name;
    display.state = display::DisplayState::kLost;
    display.bytes_out = 77;
    display.commit_to_presented.count = 3;
    display.commit_to_presented.p99_ns = 250'000'000;
  }
  stats.memory.answers = 88;
  stats.applying = {3, 1'000'000, 2, 3};
  stats.assets = {
      .count = 4, .bytes = 55, .uploaded = 6, .evicted = 7, .damaged = 1, .bytes_in = 66};
  stats.process = {.heap_bytes = 15 << 20,
                   .segments_refused = 3,
                   .trouble = "",
                   .pauses = 5,
                   .clock_steps = 6,
                   .time_trouble = ""};
  stats.volume_watches_asleep = 77;
  const std::string text = MetricsText(stats);
  EXPECT_THAT(text, HasSubstr("# TYPE voxeld_process_heap_bytes gauge\n"));
  EXPECT_THAT(text, HasSubstr("voxeld_process_heap_bytes 15728640\n"));
  EXPECT_THAT(text, HasSubstr("voxeld_process_segments_refused_total 3\n"));
  EXPECT_THAT(text, HasSubstr("voxeld_process_pauses_total 5\n"));
  EXPECT_THAT(text, HasSubstr("voxeld_process_clock_steps_total 6\n"));
  EXPECT_THAT(text, HasSubstr("voxeld_volume_watches_asleep_total 77\n"));
  EXPECT_THAT(text, HasSubstr("voxeld_memory_bytes{use=\"answers\"} 88\n"));
  EXPECT_THAT(text, HasSubstr("voxeld_commit_applying_seconds{stat=\"p50\"} 0.001\n"));
  EXPECT_THAT(text, HasSubstr("voxeld_assets 4\n"));
  EXPECT_THAT(text, HasSubstr("voxeld_asset_bytes 55\n"));
  EXPECT_THAT(text, HasSubstr("voxeld_assets_uploaded_total 6\n"));
  EXPECT_THAT(text, HasSubstr("voxeld_assets_evicted_total 7\n"));
  EXPECT_THAT(text, HasSubstr("voxeld_assets_damaged_total 1\n"));
  EXPECT_THAT(text, HasSubstr("voxeld_asset_bytes_in_total 66\n"));
  EXPECT_THAT(text, HasSubstr("voxeld_info{version=\"1.2\"} 1\n"));
  EXPECT_THAT(text, HasSubstr("voxeld_uptime_seconds 1.5\n"));
  EXPECT_THAT(text, HasSubstr("# TYPE voxeld_commits_accepted_total counter\n"));
  EXPECT_THAT(text, HasSubstr("voxeld_commits_accepted_total 12345678901\n"));
  EXPECT_THAT(text, HasSubstr("voxeld_display_bytes_out_total{display=\"one\"} 77\n"));
  EXPECT_THAT(text, HasSubstr("voxeld_display_bytes_out_total{display=\"two\"} 77\n"));
  EXPECT_THAT(text, HasSubstr("voxeld_display_commit_to_presented_seconds{display=\"one\","
                              "stat=\"p99\"} 0.25\n"));
  // Without a value, the metric is left out.
  EXPECT_THAT(text, HasSubstr("voxeld_display_assemble_seconds{display=\"one\",stat=\"p50\"} Nan"));
  EXPECT_THAT(text, HasSubstr("voxeld_display_state{display=\"one\",state=\"lost\"} 1\n"));
  EXPECT_THAT(text, HasSubstr("voxeld_display_state{display=\"one\",state=\"showing\"} 0\n"));

  // Every line is a comment or a metric of ours, and each family is announced once.
  std::istringstream lines(text);
  std::string line;
  std::set<std::string> families;
  while (std::getline(lines, line)) {
    if (line.starts_with("# TYPE ")) {
      EXPECT_TRUE(families.insert(line.substr(7)).second) << line;
    }
    if (!line.starts_with('#')) {
      EXPECT_TRUE(line.starts_with("voxeld_")) << line;
    }
  }
  EXPECT_GT(families.size(), 35u);
}

TEST(Metrics, LabelValuesAreEscaped) {
  Stats stats;
  stats.displays.emplace_back().engine_reason = "a \"b\"\nvoxeld_evil 1\\";
  const std::string text = MetricsText(stats);
  EXPECT_THAT(text, HasSubstr("reason=\"a \\\"b\\\"\\nvoxeld_evil 1\\\\\""));
  EXPECT_THAT(text, Not(HasSubstr("\nvoxeld_evil")));
}

TEST(Health, IsWellUnlessADisplayIsLostOrAnEngineIsGone) {
  Stats stats;
  stats.displays.emplace_back().name = "sim";
  stats.displays[0].engine = "cpu";
  std::vector<DisplayDescription> displays(1);
  displays[0].info.name = "sim";
  for (const auto state : {display::DisplayState::kAttaching, display::DisplayState::kShowing,
                           display::DisplayState::kBlanked}) {
    displays[0].state = state;
    const Response well = HealthResponse(displays, stats, Phase::kServing);
    EXPECT_EQ(well.status, 200u);
    EXPECT_EQ(well.body, "{\"status\":\"ok\",\"reasons\":[]}\n");
  }
  displays[0].state = display::DisplayState::kLost;
  displays[0].state_reason = "it said \"no\"\xFF";
  const Response lost = HealthResponse(displays, stats, Phase::kServing);
  EXPECT_EQ(lost.status, 503u);
  EXPECT_EQ(lost.content_type, "application/json");
  EXPECT_THAT(lost.body, HasSubstr(R"({"display":"sim","what":"lost","why":"it said \"no\")"));

  displays[0].state = display::DisplayState::kShowing;
  stats.displays[0].engine = "";
  stats.displays[0].engine_reason = "gone";
  EXPECT_THAT(HealthResponse(displays, stats, Phase::kServing).body, HasSubstr("\"no engine\""));
  stats.displays[0].engine = "cpu";
  stats.displays[0].engine_degraded = "a fault";
  stats.displays[0].pinned_entities = {"x"};
  const Response degraded = HealthResponse(displays, stats, Phase::kServing);
  EXPECT_EQ(degraded.status, 200u);
  EXPECT_EQ(degraded.body,
            R"({"status":"degraded","reasons":[{"display":"sim","what":"the engine is degraded",)"
            R"("why":"a fault","pinned":["x"]}]})"
            "\n");
  stats.displays[0].volume_held = true;
  EXPECT_EQ(HealthResponse(displays, stats, Phase::kServing).status, 503u);
  EXPECT_THAT(HealthResponse(displays, stats, Phase::kServing).body,
              HasSubstr("the last volume is held"));
  stats.displays[0].volume_held = false;
  stats.displays[0].engine_degraded = "";
  stats.process.trouble = "there was none";
  EXPECT_EQ(HealthResponse(displays, stats, Phase::kServing).status, 200u);
  EXPECT_EQ(HealthResponse(displays, stats, Phase::kServing).body,
            R"({"status":"degraded","reasons":[{"what":"memory","why":"there was none"}]})"
            "\n");
  stats.process.trouble = "";
  stats.process.time_trouble = "it stepped";
  EXPECT_EQ(HealthResponse(displays, stats, Phase::kServing).status, 200u);
  EXPECT_EQ(HealthResponse(displays, stats, Phase::kServing).body,
            R"({"status":"degraded","reasons":[{"what":"time","why":"it stepped"}]})"
            "\n");
  stats.process.time_trouble = "";
  stats.connections.accept_trouble = "none could be";
  EXPECT_EQ(HealthResponse(displays, stats, Phase::kServing).status, 200u);
  EXPECT_THAT(HealthResponse(displays, stats, Phase::kServing).body,
              HasSubstr(R"("reasons":[{"what":"connections","why":"none could be"}])"));
  stats.connections.accept_trouble = "";
  stats.displays[0].device_trouble = "it was lost";
  EXPECT_EQ(HealthResponse(displays, stats, Phase::kServing).status, 200u);
  EXPECT_THAT(HealthResponse(displays, stats, Phase::kServing).body,
              HasSubstr(R"("what":"device","why":"it was lost"})"));
  stats.displays[0].state = display::DisplayState::kLost;
  EXPECT_THAT(HealthResponse(displays, stats, Phase::kServing).body, Not(HasSubstr("it was lost")))
      << "it is still so, and is reported";
  stats.displays[0].state = display::DisplayState::kShowing;
  stats.displays[0].device_trouble = "";
  stats.connections.unreachable = "127.0.0.1:1: no answer came in time";
  EXPECT_EQ(HealthResponse(displays, stats, Phase::kServing).status, 503u);
  EXPECT_EQ(HealthResponse(displays, stats, Phase::kServing).body,
            R"({"status":"failing","reasons":[{"what":"not reachable",)"
            R"("why":"127.0.0.1:1: no answer came in time"}]})"
            "\n");
  stats.connections.unreachable = "";
  EXPECT_EQ(HealthResponse(displays, stats, Phase::kStarting).status, 503u);
  EXPECT_THAT(HealthResponse(displays, stats, Phase::kStarting).body, HasSubstr("\"starting\""));
  EXPECT_EQ(HealthResponse(displays, stats, Phase::kEnding).status, 503u);
  // And nothing else: it is not an error of displays that they stop then.
  stats.displays[0].state = display::DisplayState::kStopped;
  EXPECT_EQ(HealthResponse(displays, stats, Phase::kEnding).body,
            R"({"status":"failing","reasons":[{"what":"shutting down"}]})"
            "\n");
}

}  // namespace
}  // namespace voxeld::daemon::http
