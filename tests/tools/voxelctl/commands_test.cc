// Tests the commands with a server in this process.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <thread>
#include <vector>

#include "tests/tools/voxelctl/commands_fixture.h"
#include "tools/voxelctl/commands/not_showing.h"
#include "tools/voxelctl/import/import_program.h"

namespace voxeld::voxelctl {
namespace {

using nlohmann::json;
using testing::HasSubstr;
using testing::Not;

TEST_F(CommandsTest, EveryReportIsOneJsonDocument) {
  EXPECT_EQ(RunJson({"displays"})["displays"][0]["name"], "fake");
  EXPECT_EQ(RunJson({"displays"})["displays"][0]["geometry"]["planar_stack"]["positions_mm"].size(),
            16u);

  const json stats = RunJson({"stats"});
  EXPECT_EQ(stats["entities"], 3);
  const json& display = stats["displays"][0];
  EXPECT_EQ(display["engine"], "cpu");
  EXPECT_EQ(display["lit_voxels"], 1234567);
  EXPECT_EQ(display["commit_to_last_byte"]["p50_ns"], 1000000);
  for (const char* field : {"volumes_per_second", "volumes_presented", "commits_superseded",
                            "commits_lost", "bytes_out"}) {
    EXPECT_TRUE(display.contains(field)) << field;
  }

  EXPECT_EQ(RunJson({"top", "--once"})["stats"]["displays"][0]["name"], "fake");
  EXPECT_THAT(RunTool({"top", "--once"}).out, testing::Not(HasSubstr("\x1b")));

  const json entities = RunJson({"entities", "--layer", "voxelctl"});
  EXPECT_EQ(entities["entities"].size(), 2u) << "both pages";
  EXPECT_EQ(entities["layers"][0]["owner"], 7);

  EXPECT_EQ(RunJson({"clear"})["entities"], 2);
  EXPECT_EQ(RunJson({"pattern", "list"})["patterns"].size(), 10u);
  EXPECT_EQ(RunJson({"pattern", "axes"})["displays"][0]["test_pattern"], "TEST_PATTERN_AXES");
  EXPECT_EQ(RunJson({"snapshot", folder_.Path("a.png")})["lit_pixels"], 256);
  EXPECT_EQ(RunJson({"play", DataFile("points.ply")})["files"][0]["vertices"], 3);
}

TEST_F(CommandsTest, TablesAreDataAndNothingFromTheServerReachesTheTerminalRaw) {
  for (const std::vector<std::string>& command :
       std::vector<std::vector<std::string>>{{"displays"}, {"stats"}, {"entities"}}) {
    const Result result = RunTool(command);
    EXPECT_EQ(result.code, 0);
    EXPECT_EQ(result.err, "");
    EXPECT_THAT(result.out, HasSubstr("\\u{1b}")) << command[0];
    EXPECT_THAT(result.out, Not(HasSubstr("\x1b"))) << command[0];
  }
  EXPECT_THAT(RunTool({"stats"}).out, HasSubstr("1,234,567"));
  EXPECT_THAT(RunTool({"stats"}).out, HasSubstr("locked, +0 ppm"));
  EXPECT_THAT(RunTool({"stats"}).out, HasSubstr("no memory\\u{1b}\n"));
  EXPECT_THAT(RunTool({"top", "--once"}).out, HasSubstr("no memory\\u{1b}\n"));
}

TEST_F(CommandsTest, WhySaysWhatTheServerFound) {
  const json why = RunJson({"why", "one"});
  EXPECT_EQ(why["visibility"], "VISIBILITY_BLACK");
  EXPECT_EQ(why["info"]["key"]["owner"], 7);
  const Result told = RunTool({"why", "two\x1b[2J"});
  EXPECT_EQ(told.code, 0) << told.err;
  EXPECT_EQ(told.out,
            "box \"two\\u{1b}[2J\" in layer \"voxelctl\" of owner 7, on display \"fake\":\n"
            "it is \\u{1b}[2Jblack\nvoxels that it covers 1,234; that it lights 0; that clip and "
            "mask leave 0; that it changes 0\n");
  const Result near = RunTool({"why", "onee"});
  EXPECT_EQ(near.code, kExitFailure);
  EXPECT_THAT(near.err, HasSubstr("no entity \"onee\" is in the scene; did you mean \"one\"?"));
  EXPECT_THAT(RunTool({"why", "quite different"}).err,
              HasSubstr("its commit has not come; there are \"one\", \"two\\u{1b}[2J\""));
}

TEST_F(CommandsTest, ALatticeIsListedAndPictured) {
  server_.Set({.lattice = true});
  EXPECT_THAT(RunTool({"displays"}).out, HasSubstr("lattice, 5 lights"));
  EXPECT_EQ(RunJson({"displays"})["displays"][0]["geometry"]["lattice"]["pixels"].size(), 5u);
  // A pixel without a light has bytes too; the light that the server puts there is counted, but not
  // drawn.
  EXPECT_EQ(RunJson({"snapshot", folder_.Path("a.png")})["lit_pixels"], 6);
  EXPECT_EQ(RunTool({"snapshot", folder_.Path("a.png"), "--slices"}).code, 0);
}

TEST_F(CommandsTest, OneIsSingular) {
  const std::string one = folder_.Write(
      "one.ply",
      "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty "
      "float z\nend_header\n1 2 3\n");
  EXPECT_THAT(RunTool({"play", one}).err, HasSubstr("1 entity, 1 vertex, "));
  EXPECT_THAT(RunTool({"stats"}).out, HasSubstr(": 1 session, 0 layers, 3 entities, 0 objects, "));
}

TEST_F(CommandsTest, StatsAreWatchedUntilAnInterrupt) {
  // The fake server sends without pause; the interrupt follows the first line.
  std::ostringstream out, err;
  Console console(out, err, true, false);
  auto connection = Connection::Connect(server_.address(), {}, interrupt_);
  ASSERT_TRUE(connection.ok());
  v1::WatchStatsRequest request;
  int seen = 0;
  EXPECT_FALSE((*connection)
                   ->WatchStats(request,
                                [&](const v1::Stats&) {
                                  if (++seen == 3) interrupt_.Request();
                                  return true;
                                })
                   .ok());
  EXPECT_GE(seen, 3);
  EXPECT_TRUE(interrupt_.requested());
}

TEST_F(CommandsTest, WatchTellsWhatComesChangesAndGoes) {
  const Result result = RunTool({"watch", "--layer", "the\nother"});
  EXPECT_EQ(result.code, kExitFailure);  // the server exited
  EXPECT_EQ(result.out,
            "+ 7 voxelctl  of some\\u{1b}one\n"
            "+ 7 voxelctl a  sphere\n"
            "~ 7 voxelctl a  sphere\n"
            "+ 7 voxelctl b  mesh\n"
            "- 8 the\\u{a}other\n"
            "- 7 voxelctl b\n"
            "~ 7 voxelctl, hidden\n");
  EXPECT_THAT(result.err, HasSubstr("that is all there is"));
  EXPECT_THAT(result.err, HasSubstr("shutting down"));
}

TEST_F(CommandsTest, WatchAsJsonIsALineAChangeSet) {
  std::istringstream lines(RunTool({"--json", "watch"}).out);
  std::vector<json> sets;
  for (std::string line; std::getline(lines, line);) {
    sets.push_back(json::parse(line, nullptr, false));
  }
  ASSERT_EQ(sets.size(), 3u);
  EXPECT_EQ(sets[0]["in_sync"], 4);
  EXPECT_EQ(sets[0]["layers"].size(), 1u) << "of the message before";
  EXPECT_EQ(sets[0]["entities"][0]["info"]["key"]["id"], "a");
  EXPECT_EQ(sets[1]["in_sync"], 5);
  EXPECT_EQ(sets[1]["layers"].size(), 0u);
  EXPECT_EQ(sets[1]["entities"].size(), 2u);
  EXPECT_EQ(sets[2]["removed_entities"][0]["id"], "b");
}

TEST_F(CommandsTest, PlayPutsUpObjectsAndInstancesThatStay) {
  const Result result = RunTool({"play", DataFile("points.ply"), DataFile("quad.topojson")});
  EXPECT_EQ(result.code, 0) << result.err;
  EXPECT_EQ(result.out, "");
  EXPECT_THAT(result.err, HasSubstr("2 entities"));
  EXPECT_THAT(result.err, HasSubstr("voxelctl clear"));
  const FakeServer::Log log = server_.log();
  ASSERT_EQ(log.opens.size(), 1u);
  EXPECT_EQ(log.opens[0].on_disconnect(), v1::DISCONNECT_POLICY_KEEP);
  EXPECT_TRUE(log.opens[0].strict());
  ASSERT_EQ(log.entities.size(), 2u);
  EXPECT_EQ(log.entities.at("play 1").label(), "points.ply");
  for (const auto& [id, entity] : log.entities) {
    const std::string& object = entity.primitive().instance().object();
    ASSERT_TRUE(log.objects.contains(object));
    for (const v1::Object::Part& part : log.objects.at(object).parts())
      EXPECT_TRUE(log.objects.contains(part.primitive().instance().object()));
  }
  // The layers that an earlier play left are removed, owner by owner, and those of no one else.
  ASSERT_EQ(log.clears.size(), 1u);
  EXPECT_EQ(log.clears[0].owner(), 7u);
  EXPECT_EQ(log.clears[0].layer(), "voxelctl");
}

TEST_F(CommandsTest, ADrawingIsAVolumeOfColours) {
  if (const absl::Status importers = CheckImporters("play"); !importers.ok())
    GTEST_SKIP() << importers.message();
  const std::string file = folder_.Write(
      "a.svg",
      "<svg xmlns='http://www.w3.org/2000/svg' viewBox='0 0 20 10'><rect width='9' height='9' "
      "fill='red'/><script/></svg>");
  const Result result = RunTool({"play", file, DataFile("points.ply")});
  EXPECT_EQ(result.code, 0) << result.err;
  EXPECT_THAT(result.err, HasSubstr("2 entities"));
  EXPECT_THAT(result.err, HasSubstr("left out: scripts (1)"));
  const FakeServer::Log log = server_.log();
  ASSERT_EQ(log.entities.size(), 2u);
  const v1::Grid& grid = log.objects.at("voxelctl/1/0").parts(0).primitive().volume().grid();
  EXPECT_EQ(grid.size_a(), 15u) << "of the fake display's 16 voxels, some room is left";
  EXPECT_EQ(grid.size_b(), 8u);
  EXPECT_EQ(grid.size_c(), 1u);
}

TEST_F(CommandsTest, PlayEndsATestPatternThatIsUp) {
  EXPECT_EQ(RunTool({"pattern", "corners"}).code, 0);
  const Result result = RunTool({"play", DataFile("points.ply")});
  EXPECT_EQ(result.code, 0) << result.err;
  EXPECT_THAT(result.err, HasSubstr("ended the test pattern on fake"));
  ASSERT_EQ(server_.log().updates.size(), 2u);
  EXPECT_EQ(server_.log().updates[1].name(), "fake");
  EXPECT_EQ(server_.log().updates[1].test_pattern(), v1::TEST_PATTERN_NONE);
  EXPECT_FALSE(server_.log().updates[1].has_brightness());

  EXPECT_THAT(RunTool({"play", DataFile("points.ply")}).err, Not(HasSubstr("pattern")));
  EXPECT_EQ(server_.log().updates.size(), 2u) << "none was present";
}

TEST_F(CommandsTest, ARefusedSceneLeavesTheTestPatternUp) {
  EXPECT_EQ(RunTool({"pattern", "corners"}).code, 0);
  server_.Set({.refuse_commits_with = "quota exceeded"});
  EXPECT_EQ(RunTool({"play", DataFile("points.ply")}).code, 1);
  EXPECT_EQ(server_.log().updates.size(), 1u);
}

TEST_F(CommandsTest, ClearEndsATestPatternThatIsUp) {
  EXPECT_EQ(RunTool({"pattern", "corners"}).code, 0);
  EXPECT_THAT(RunTool({"clear"}).err,
              HasSubstr("cleared 2 entities in 1 layer, ended 1 test pattern\n"));
  EXPECT_EQ(server_.log().updates.back().test_pattern(), v1::TEST_PATTERN_NONE);
}

TEST_F(CommandsTest, LargeCloudsGoInManyMessages) {
  constexpr int kPoints = 100000;
  std::string bytes =
      "ply\nformat binary_little_endian 1.0\nelement vertex 100000\nproperty float x\nproperty "
      "float y\nproperty float z\nend_header\n";
  bytes.resize(bytes.size() + kPoints * 12, '\1');
  const json summary = RunJson({"play", folder_.Write("big.ply", bytes)});
  EXPECT_EQ(summary["files"][0]["vertices"], kPoints);
  const FakeServer::Log log = server_.log();
  EXPECT_LE(log.largest_message, 256u << 10);
  EXPECT_GE(log.objects.size(), 7u);
  EXPECT_GE(log.commits, 3u) << "at most max_uncommitted_bytes at a time";
}

TEST_F(CommandsTest, SpinningSendsTransformsOnly) {
  const json summary =
      RunJson({"play", DataFile("points.ply"), "--spin", "--fps", "100", "--duration", "0.5"});
  const FakeServer::Log log = server_.log();
  EXPECT_GT(summary["frames"], 0) << "a slow machine turns it less often";
  EXPECT_EQ(log.transforms, summary["frames"]);
  EXPECT_EQ(log.commits, summary["commits"]);
  EXPECT_EQ(summary["unanswered"], 0);
  EXPECT_EQ(summary["displays"][0]["presented"], summary["commits"]);
  EXPECT_EQ(summary["latency"]["count"], summary["commits"]);
  EXPECT_TRUE(summary["still_up"]);
}

TEST_F(CommandsTest, VolumesAreOneMessageEach) {
  if (const absl::Status importers = CheckImporters("play"); !importers.ok())
    GTEST_SKIP() << importers.message();
  std::string samples(64 * 64 * 128, '\0');
  for (size_t i = 0; i < samples.size(); i += 3) samples[i] = '\x60';
  const std::string path = folder_.Write("a.raw", samples);
  const json summary =
      RunJson({"play", path, "--size", "64x64x128", "--colormap", "viridis", "--window", "0:96"});
  EXPECT_THAT(summary["files"][0]["note"].get<std::string>(),
              HasSubstr("more than the server takes"));
  FakeServer::Log log = server_.log();
  EXPECT_LE(log.largest_message, 256u << 10);
  const std::string root = log.entities.at("play 1").primitive().instance().object();
  const auto shape = [&log](const std::string& object) -> const v1::Primitive& {
    return log.objects.at(object).parts(0).primitive();
  };
  const v1::Volume& volume = shape(shape(root).instance().object()).volume();
  EXPECT_EQ(volume.transfer().colormap(), "viridis");
  EXPECT_EQ(summary["files"][0]["samples"], volume.grid().samples().size());
  EXPECT_EQ(RunTool({"play", path, "--size", "64x64x128", "--level", "50"}).code, 0);
  EXPECT_TRUE(server_.log()
                  .objects.at(shape(root).instance().object())
                  .parts(0)
                  .primitive()
                  .has_isosurface());
  EXPECT_THAT(RunTool({"play", path, "--size", "64x64x128", "--level", "500"}).err,
              HasSubstr("a.raw: --level is 500"));
}

TEST_F(CommandsTest, ASequenceReplacesEachByTheNext) {
  std::string many;
  for (int i = 0; i < 30000; ++i) many += "0 0 1\n";
  folder_.Write("f_1.xyz", many);  // in several pieces, which the third frame does not use
  folder_.Write("f_2.xyz", "0 0 0\n1 1 1\n");
  folder_.Write("f_3.xyz", "0 0 0\n1 1 1\n");
  const json summary = RunJson({"play", folder_.Path("f_#.xyz"), "--fps", "20"});
  EXPECT_EQ(summary["frames"].get<int>() + summary["frames_skipped"].get<int>(), 3);
  EXPECT_EQ(summary["unanswered"], 0);
  EXPECT_TRUE(summary["still_up"]);
  const FakeServer::Log log = server_.log();
  ASSERT_EQ(log.entities.size(), 1u);
  EXPECT_EQ(log.entities.at("play 1").label(), "f_3.xyz");
  const json looped =
      RunJson({"play", "--sequence", folder_.Path("f_2.xyz"), folder_.Path("f_3.xyz"), "--loop",
               "--fps", "50", "--duration", "1"});
  // More frames were due than there are files, so it looped; a slow machine skips some of them.
  EXPECT_GE(looped["frames"].get<int>() + looped["frames_skipped"].get<int>(), 5);
  EXPECT_THAT(RunTool({"play", folder_.Path("f_2.xyz"), "--loop"}).err, HasSubstr("--loop is for"));
  EXPECT_THAT(RunTool({"play", folder_.Path("g_#.xyz")}).err, HasSubstr("there is no such file"));
}

TEST_F(CommandsTest, ASlowDisplayMakesNoQueue) {
  server_.Set({.no_outcomes = true});
  const Result result =
      RunTool({"play", DataFile("points.ply"), "--spin", "--fps", "200", "--duration", "0.3"});
  EXPECT_EQ(result.code, 0);
  EXPECT_LE(server_.log().most_unanswered, 4u);
  EXPECT_THAT(result.err, HasSubstr("it is up and spins for 0.3 s; Ctrl-C ends it before\n"));
  EXPECT_THAT(result.err, HasSubstr("left out while a display was behind"));
  EXPECT_THAT(result.err, HasSubstr("no outcome yet"));
}

TEST_F(CommandsTest, CtrlCEndsASpinCleanlyAndTheSceneStays) {
  Result result;
  std::thread player([&] { result = RunTool({"play", DataFile("points.ply"), "--spin"}); });
  while (server_.log().transforms == 0) std::this_thread::yield();
  interrupt_.Request();
  player.join();
  EXPECT_EQ(result.code, 0) << result.err;
  EXPECT_THAT(result.err, HasSubstr("it is up and spins until Ctrl-C\n"));
  EXPECT_THAT(result.err, HasSubstr("stays up in the layer voxelctl, called \"play 1\", until"));
  EXPECT_FALSE(server_.log().deleted_all_mine);
}

TEST_F(CommandsTest, AnInterruptBeforeTheSceneIsUpExitsWith130) {
  interrupt_.Request();
  EXPECT_EQ(RunTool({"play", DataFile("points.ply")}).code, 130);
  EXPECT_EQ(RunTool({"displays"}).code, 130);
}

TEST_F(CommandsTest, ClearAtTheEnd) {
  const Result result = RunTool({"play", DataFile("points.ply"), "--clear", "--duration", "0.05"});
  EXPECT_EQ(result.code, 0) << result.err;
  EXPECT_TRUE(server_.log().deleted_all_mine);
  EXPECT_EQ(server_.log().opens[0].on_disconnect(), v1::DISCONNECT_POLICY_CLEAR);
  EXPECT_THAT(result.err, Not(HasSubstr("stays up")));
}

TEST_F(CommandsTest, ASceneTakenDownByAnotherEndsTheSpin) {
  server_.Set({.lose_entities = true});
  const Result result = RunTool({"play", DataFile("points.ply"), "--spin", "--fps", "100"});
  EXPECT_EQ(result.code, 0);
  EXPECT_THAT(result.err, HasSubstr("taken down by another client"));
  EXPECT_THAT(result.err, Not(HasSubstr("stays up")));
}

TEST_F(CommandsTest, NothingIsPutUpIfOneFileIsBad) {
  const Result result =
      RunTool({"play", DataFile("points.ply"), folder_.Write("bad.ply", "nonsense")});
  EXPECT_EQ(result.code, 1);
  EXPECT_EQ(result.out, "");
  EXPECT_THAT(result.err, HasSubstr("bad.ply: is text that begins with \"nonsense\""));
  EXPECT_THAT(result.err, HasSubstr("nothing is put up"));
  EXPECT_TRUE(server_.log().opens.empty());
}

TEST_F(CommandsTest, RefusalsAreToldWithTheirIssues) {
  server_.Set({.refuse_commits_with = "quota\x1b exceeded"});
  const Result result = RunTool({"play", DataFile("points.ply")});
  EXPECT_EQ(result.code, 1);
  EXPECT_THAT(result.err, HasSubstr("quota\\u{1b} exceeded"));
  EXPECT_THAT(result.err, HasSubstr("define_object.definition: of no use"));
  EXPECT_TRUE(server_.log().clears.empty()) << "the old scene stays";
}

TEST_F(CommandsTest, WhatARefusalSaysByItselfIsNotSaidAgain) {
  server_.Set(
      {.refuse_commits_with = "1 was refused; the first: define_object.definition: of no use"});
  const std::string err = RunTool({"play", DataFile("points.ply")}).err;
  EXPECT_EQ(err,
            "voxelctl: the server refused the scene: 1 was refused; the first: "
            "define_object.definition: of no use\n");
}

TEST_F(CommandsTest, IssuesThatAreNoRefusalsAreToldAsNotes) {
  server_.Set({.note_commits = true});
  const json summary = RunJson({"play", DataFile("points.ply")});
  ASSERT_EQ(summary["issues"].size(), summary["commits"].get<size_t>());
  EXPECT_EQ(summary["issues"][0]["applied"], true);
  EXPECT_EQ(summary["refused_operations"], 0);
  EXPECT_THAT(RunTool({"play", DataFile("points.ply")}).err,
              HasSubstr("note: /1: drawn otherwise"));
  server_.Set({.lose_entities = true});
  const json lost =
      RunJson({"play", DataFile("points.ply"), "--spin", "--fps", "100", "--duration", "0.3"});
  EXPECT_EQ(lost["issues"][0]["applied"], false);
}

TEST_F(CommandsTest, GlobeWantsAMap) {
  EXPECT_THAT(RunTool({"play", DataFile("points.ply"), "--globe"}).err,
              HasSubstr("--globe is for maps"));
  EXPECT_EQ(RunTool({"play", DataFile("points.ply"), DataFile("quad.topojson"), "--globe"}).code,
            0);
}

TEST_F(CommandsTest, UnknownDisplaysAreToldWithThoseThereAre) {
  const Result play = RunTool({"play", DataFile("points.ply"), "--display", "fkae"});
  EXPECT_EQ(play.code, 1);
  EXPECT_THAT(play.err, HasSubstr("there is no display \"fkae\"; there are fake"));
  EXPECT_THAT(RunTool({"snapshot", folder_.Path("a.png"), "--display", "x"}).err,
              HasSubstr("there is fake"));
  EXPECT_THAT(RunTool({"pattern", "grid", "--display", "x"}).err, HasSubstr("there is fake"));
}

TEST_F(CommandsTest, SnapshotsAreWrittenWholeOrNotAtAll) {
  const std::string path = folder_.Path("a.png");
  EXPECT_EQ(RunTool({"snapshot", path, "--size", "200x100"}).code, 0);
  EXPECT_EQ(ReadAll(path).substr(1, 3), "PNG");
  EXPECT_EQ(RunTool({"snapshot", path, "--slices"}).code, 0);
  const std::string sheet = ReadAll(path);
  server_.Set({.short_volume = true});
  const Result result = RunTool({"snapshot", path});
  EXPECT_EQ(result.code, 1);
  EXPECT_THAT(result.err, HasSubstr("1 of the volume's 16 slices did not come"));
  EXPECT_EQ(ReadAll(path), sheet);
}

TEST_F(CommandsTest, ASnapshotIsOfAllThatIsUp) {
  const std::string path = folder_.Path("a.png");
  EXPECT_EQ(RunJson({"snapshot", path})["up_to_date"], true);
  ASSERT_EQ(server_.log().captures.size(), 1u);
  EXPECT_EQ(server_.log().captures[0].at_least_snapshot(), 4u)
      << "the number that the scene's watch reports";

  server_.Set({.behind = true});
  EXPECT_EQ(RunJson({"snapshot", path})["up_to_date"], false);
  ASSERT_EQ(server_.log().captures.size(), 3u);
  EXPECT_EQ(server_.log().captures[2].at_least_snapshot(), 0u);
  const Result result = RunTool({"snapshot", path});
  EXPECT_EQ(result.code, 0);
  EXPECT_THAT(result.err, HasSubstr("is not shown yet"));
  EXPECT_THAT(result.err, HasSubstr("the newest has 3"));
}

TEST_F(CommandsTest, ASnapshotIsTakenThoughNoMoreWatchesAreGiven) {
  const std::string path = folder_.Path("a.png");
  server_.Set({.no_watches = true});
  EXPECT_EQ(RunJson({"snapshot", path})["up_to_date"], false);
  ASSERT_EQ(server_.log().captures.size(), 1u);
  EXPECT_EQ(server_.log().captures[0].at_least_snapshot(), 0u);
  const Result result = RunTool({"snapshot", path});
  EXPECT_EQ(result.code, 0);
  EXPECT_THAT(result.err, HasSubstr("may be from before the newest commits"));
  EXPECT_THAT(result.err, HasSubstr("max_scene_watches"));
}

TEST_F(CommandsTest, ClearAndPatternAskForWhatTheySay) {
  EXPECT_EQ(RunTool({"pattern", "white"}).code, 0);
  EXPECT_EQ(RunTool({"clear"}).code, 0);
  FakeServer::Log log = server_.log();
  ASSERT_EQ(log.updates.size(), 2u);
  EXPECT_EQ(log.updates[0].test_pattern(), v1::TEST_PATTERN_WHITE);
  EXPECT_EQ(log.updates[1].test_pattern(), v1::TEST_PATTERN_NONE);
  EXPECT_EQ(log.clears.back().layer(), "voxelctl");
  EXPECT_EQ(log.clears.back().owner(), 7u)
      << "layer by layer, so that one's own is removed in any case";
  EXPECT_EQ(RunTool({"clear", "--all"}).code, 0);
  log = server_.log();
  ASSERT_EQ(log.clears.size(), 3u);
  EXPECT_EQ(log.clears[1].owner(), 0u);
  EXPECT_EQ(log.clears[1].layer(), "");
  EXPECT_EQ(RunTool({"clear", "--layer", "absent"}).code, 0);
}

TEST_F(CommandsTest, SetSetsWhatItSays) {
  const Result result = RunTool({"set", "--brightness", "0.25", "--power-limit", "40"});
  EXPECT_EQ(result.code, 0) << result.err;
  FakeServer::Log log = server_.log();
  ASSERT_EQ(log.updates.size(), 1u);
  EXPECT_EQ(log.updates[0].brightness(), 0.25);
  EXPECT_EQ(log.updates[0].power_limit_w(), 40);
  EXPECT_FALSE(log.updates[0].has_blank());
  EXPECT_EQ(RunTool({"set", "--blank", "on", "--display", "fake"}).code, 0);
  log = server_.log();
  EXPECT_TRUE(log.updates[1].blank());
  EXPECT_EQ(log.updates[1].name(), "fake");
  EXPECT_FALSE(log.updates[1].has_brightness());
}

TEST_F(CommandsTest, NobodyThere) {
  const Result result = RunAnywhere({"--server", "unix:" + folder_.Path("nobody"), "stats"});
  EXPECT_EQ(result.code, 1);
  EXPECT_EQ(result.out, "");
  EXPECT_THAT(result.err, HasSubstr("unix:" + folder_.Path("nobody")));
  EXPECT_THAT(result.err, HasSubstr("start it with `voxeld`"));
  EXPECT_EQ(RunAnywhere({"--server", "nonsense", "stats"}).code, 2);
}

TEST(NotShowing, EachDisplayThatIsDarkWithTheReason) {
  v1::ListDisplaysResponse displays;
  v1::DisplayDescription* display = displays.add_displays();
  display->set_name("here");
  display->set_state(v1::DISPLAY_STATE_SHOWING);
  EXPECT_TRUE(NotShowing(displays).empty());
  display = displays.add_displays();
  display->set_name(
      "cu\x1b"
      "be");
  display->set_state(v1::DISPLAY_STATE_ATTACHING);
  display->set_state_reason("board 1: no USB device 1d50:607a is attached");
  display = displays.add_displays();
  display->set_name("dark");
  display->set_state(v1::DISPLAY_STATE_BLANKED);
  display->set_state_reason("blanked");
  EXPECT_THAT(NotShowing(displays),
              testing::ElementsAre(
                  "display cu\\u{1b}be shows nothing now: it is attaching (board 1: no USB "
                  "device 1d50:607a is attached)",
                  "display dark shows nothing now: it is blanked"));
}

}  // namespace
}  // namespace voxeld::voxelctl
