#include "tools/bench/voxel_bench/command_line.h"

#include <gmock/gmock.h>

namespace voxeld::bench {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

template <typename Options>
Options Parsed(const std::vector<std::string>& arguments) {
  const absl::StatusOr<CommandLine> line = ParseCommandLine(arguments);
  EXPECT_TRUE(line.ok()) << line.status();
  EXPECT_TRUE(std::holds_alternative<Options>(line->command));
  return std::get<Options>(line->command);
}

std::string Refusal(const std::vector<std::string>& arguments) {
  const absl::StatusOr<CommandLine> line = ParseCommandLine(arguments);
  EXPECT_FALSE(line.ok());
  return std::string(line.status().message());
}

TEST(CommandLine, EachSubcommandHasItsOptions) {
  const auto ingest = Parsed<IngestOptions>(
      {"ingest", "--case", "batch_tcp", "--case", "upsert_unix", "--rounds", "2", "--batch", "4"});
  EXPECT_THAT(ingest.cases, ElementsAre("batch_tcp", "upsert_unix"));
  EXPECT_EQ(ingest.rounds, 2);
  EXPECT_EQ(ingest.batch, 4);
  EXPECT_EQ(Parsed<LatencyOptions>({"latency", "--rate", "50"}).rate, 50);
  EXPECT_EQ(Parsed<FairnessOptions>({"fairness", "--clients", "7"}).clients, 7);
  EXPECT_EQ(Parsed<OverloadOptions>({"overload", "--csv", "a.csv"}).csv, "a.csv");
  EXPECT_EQ(Parsed<IdleOptions>({"idle", "--streams", "9"}).streams, 9);
  const auto paper = Parsed<PaperOptions>(
      {"paper", "--engine", "cpu", "--table", "2", "--table", "4", "--seed", "9"});
  EXPECT_THAT(paper.engines, ElementsAre("cpu"));
  EXPECT_THAT(paper.tables, ElementsAre("2", "4"));
  EXPECT_EQ(paper.seed, 9u);
  const auto frame = Parsed<FrameOptions>(
      {"frame", "--scene", "short", "--engine", "cuda", "--rounds", "3", "--seed", "8"});
  EXPECT_EQ(frame.scene, "short");
  EXPECT_EQ(frame.engine, "cuda");
  EXPECT_EQ(frame.threads, 0);
  EXPECT_EQ(frame.rounds, 3);
  EXPECT_EQ(frame.seed, 8u);
  EXPECT_EQ(frame.gpus, 0);
  const auto ranks =
      Parsed<FrameOptions>({"frame", "--scene", "huge", "--gpus", "4", "--nccl", "off"});
  EXPECT_EQ(ranks.gpus, 4);
  EXPECT_EQ(ranks.nccl, "off");
  EXPECT_THAT(Parsed<SinkOptions>({"sink", "--listen", "unix:/x"}).listen, ElementsAre("unix:/x"));
}

TEST(CommandLine, JsonMayStandBeforeAndAfter) {
  EXPECT_TRUE(ParseCommandLine({"--json", "idle"})->json);
  EXPECT_TRUE(ParseCommandLine({"idle", "--json"})->json);
  EXPECT_FALSE(ParseCommandLine({"idle"})->json);
}

TEST(CommandLine, WhatIsWrongIsSaid) {
  EXPECT_THAT(Refusal({}), HasSubstr("subcommand"));
  EXPECT_THAT(Refusal({"ingest", "--case", "none"}), HasSubstr("none"));
  EXPECT_THAT(Refusal({"ingest", "--line-bytes", "26"}), HasSubstr("26"));
  EXPECT_THAT(Refusal({"latency", "--seconds", "0"}), HasSubstr("--seconds"));
  EXPECT_THAT(Refusal({"latency", "--rate", "nan"}), HasSubstr("--rate"));
  EXPECT_THAT(Refusal({"paper", "--engine", "gpu"}), HasSubstr("gpu"));
  EXPECT_THAT(Refusal({"paper", "--from", "/nowhere.json"}), HasSubstr("/nowhere.json"));
  EXPECT_THAT(Refusal({"frame"}), HasSubstr("--scene"));
  EXPECT_THAT(Refusal({"frame", "--scene", "none"}), HasSubstr("none"));
  EXPECT_THAT(Refusal({"frame", "--scene", "short", "--svg", "a.svg"}),
              HasSubstr("not with short"));
  EXPECT_THAT(Refusal({"frame", "--from", "/nonexistent.json"}), HasSubstr("/nonexistent.json"));
  EXPECT_THAT(Refusal({"frame", "--scene", "short", "--threads", "0"}), HasSubstr("--threads"));
  EXPECT_THAT(Refusal({"frame", "--scene", "short", "--gpus", "0"}), HasSubstr("--gpus"));
  EXPECT_THAT(Refusal({"overload", "--rounds", "3"}), HasSubstr("--rounds"));
}

TEST(CommandLine, HelpNamesThemAll) {
  const std::string help = ParseCommandLine({"--help"})->print_and_exit;
  for (const char* name :
       {"ingest", "latency", "fairness", "beside", "overload", "idle", "paper", "frame"}) {
    EXPECT_THAT(help, HasSubstr(name));
  }
}

TEST(CommandLine, TheDefaultsOfEachFitIntoTwoMinutes) {
  const auto total = [](const auto& options) { return options.rounds * options.seconds; };
  // Both sides of each case; the normal client three times in a round.
  EXPECT_LE(2 * total(IngestOptions()) * static_cast<double>(IngestCases().size()), 90);
  EXPECT_LE(total(LatencyOptions()), 90);
  EXPECT_LE(total(FairnessOptions()), 90);
  EXPECT_LE(2 * total(BesideOptions()), 90);
  EXPECT_LE(OverloadOptions().seconds, 90);
  EXPECT_LE(3 * total(IdleOptions()), 90);
}

}  // namespace
}  // namespace voxeld::bench
