// Tests the command line: which arguments are accepted, and the errors for others.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "absl/strings/str_split.h"
#include "common/text/suggest.h"
#include "tools/voxelctl/cli/options.h"
#include "tools/voxelctl/cli/patterns.h"

namespace voxeld::voxelctl {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

std::vector<std::string> Split(const std::string& line) {
  return absl::StrSplit(line, ' ', absl::SkipEmpty());
}

Options Parse(const std::string& line) {
  const ParsedCommandLine parsed = ParseCommandLine(Split(line));
  EXPECT_TRUE(parsed.options.has_value()) << line << "\n" << parsed.err;
  return parsed.options.value_or(Options());
}

TEST(CommandLine, DemoTakesScenesByName) {
  const auto all = std::get<DemoOptions>(Parse("demo").command);
  EXPECT_TRUE(all.scenes.empty());
  EXPECT_EQ(all.seconds, 20);
  EXPECT_FALSE(all.once || all.list);
  const auto some = std::get<DemoOptions>(
      Parse("demo life --seconds 5 globe --once --display desk --data /d -- clock").command);
  EXPECT_THAT(some.scenes, ElementsAre("life", "globe", "clock"));
  EXPECT_EQ(some.seconds, 5);
  EXPECT_TRUE(some.once);
  EXPECT_EQ(some.display, "desk");
  EXPECT_EQ(some.data, "/d");
  EXPECT_TRUE(std::get<DemoOptions>(Parse("demo --list").command).list);
  const ParsedCommandLine wrong = ParseCommandLine({"demo", "glob"});
  EXPECT_EQ(wrong.exit_code, kExitUsage);
  EXPECT_THAT(wrong.err,
              HasSubstr("there is no scene \"glob\"; did you mean globe?; there are globe,"));
  EXPECT_EQ(ParseCommandLine({"demo", "--seconds", "0"}).exit_code, kExitUsage);
}

TEST(CommandLine, GlobalOptionsBeforeAndAfterTheCommand) {
  for (const char* line : {"--server unix:/a --json displays", "displays --json --server unix:/a",
                           "--json displays --server=unix:/a"}) {
    const Options options = Parse(line);
    EXPECT_EQ(options.server, "unix:/a") << line;
    EXPECT_TRUE(options.json) << line;
    EXPECT_TRUE(std::holds_alternative<DisplaysOptions>(options.command));
  }
  EXPECT_EQ(Parse("--server a:1 stats --server b:2").server, "b:2");
  EXPECT_EQ(Parse("displays").server, "");
}

TEST(CommandLine, Play) {
  const Options options = Parse(
      "play a.obj --spin b.glb --up z --fill lines --fps 12.5 --duration 3 --globe --flat --each "
      "--display d --clear");
  const auto& play = std::get<PlayOptions>(options.command);
  EXPECT_THAT(play.files, ElementsAre("a.obj", "b.glb"));
  EXPECT_TRUE(play.spin && play.globe && play.flat && play.each && play.clear);
  EXPECT_EQ(play.up, Up::kZ);
  EXPECT_EQ(play.fill, FillStyle::kLines);
  EXPECT_EQ(play.fps, 12.5);
  EXPECT_EQ(play.duration_s, 3);
  EXPECT_EQ(play.display, "d");
  const auto plain = std::get<PlayOptions>(Parse("play a.obj").command);
  EXPECT_FALSE(plain.spin || plain.globe || plain.flat || plain.each || plain.clear);
  EXPECT_EQ(plain.up, Up::kAuto);
  EXPECT_EQ(plain.fps, 20);
  EXPECT_FALSE(plain.duration_s.has_value());
}

TEST(CommandLine, PlayOfWhatMoves) {
  const auto play = [](const std::string& line) {
    return std::get<PlayOptions>(Parse(line).command);
  };
  EXPECT_EQ(play("play a.glb").animation, std::nullopt);
  EXPECT_EQ(play("play a.glb --animate").animation, 1u);
  EXPECT_EQ(play("play a.glb --animate 3 --loop").animation, 3u);
  EXPECT_EQ(play("play a.glb --animate --loop").animation, 1u);
  EXPECT_THAT(play("play --animate a.glb").files, ElementsAre("a.glb"));
  EXPECT_TRUE(play("play a b --sequence --loop").loop);
}

TEST(CommandLine, PlayOfVolumes) {
  const auto play = std::get<PlayOptions>(
      Parse(
          "play a.raw --size 4x5x6 --type i16 --big-endian --colormap viridis --window -160:240.5")
          .command);
  ASSERT_TRUE(play.raw.has_value());
  EXPECT_THAT(play.raw->size, ElementsAre(4, 5, 6));
  EXPECT_EQ(play.raw->type, SampleType::kI16);
  EXPECT_TRUE(play.raw->big_endian);
  EXPECT_EQ(play.volume.colormap, "viridis");
  EXPECT_THAT(*play.volume.window, ElementsAre(-160, 240.5));
  EXPECT_EQ(std::get<PlayOptions>(Parse("play a.nii --level -5").command).volume.level, -5);
}

TEST(CommandLine, Verify) {
  const auto verify =
      std::get<VerifyOptions>(Parse("verify lab=voxlink,serial=A1 --filter volume.* --junit "
                                    "out.xml --seed 42 --list --wait 2.5")
                                  .command);
  EXPECT_EQ(verify.display, "lab=voxlink,serial=A1");
  EXPECT_EQ(verify.filter, "volume.*");
  EXPECT_EQ(verify.junit, "out.xml");
  EXPECT_EQ(verify.seed, 42u);
  EXPECT_TRUE(verify.list);
  EXPECT_EQ(verify.wait_s, 2.5);
  const auto plain = std::get<VerifyOptions>(Parse("verify simulated").command);
  EXPECT_EQ(plain.filter + plain.junit, "");
  EXPECT_EQ(plain.seed, 1u);
  EXPECT_FALSE(plain.list);
  const ParsedCommandLine none = ParseCommandLine({"verify"});
  EXPECT_EQ(none.exit_code, kExitUsage);
  EXPECT_THAT(none.err, HasSubstr("voxlink,serial=A1"));
}

TEST(CommandLine, Input) {
  const auto input = std::get<InputOptions>(
      Parse("input e131 --universe 7 --size 16x8x4 --multicast --gather 2.5 --layer fire").command);
  EXPECT_EQ(input.protocol, lights::Protocol::kE131);
  EXPECT_EQ(input.first_universe, 7);
  EXPECT_THAT(*input.lights.size, ElementsAre(16, 8, 4));
  EXPECT_TRUE(input.multicast);
  EXPECT_EQ(input.gather_ms, 2.5);
  EXPECT_EQ(input.lights.layer, "fire");
  EXPECT_EQ(input.listen, "0.0.0.0:5568");
  const auto opc = std::get<InputOptions>(Parse("input opc --per-channel 64").command);
  EXPECT_EQ(opc.listen, "127.0.0.1:7890");
  EXPECT_EQ(opc.a_channel, 64);
  EXPECT_FALSE(opc.lights.size.has_value());
  EXPECT_EQ(std::get<InputOptions>(Parse("input e131").command).first_universe, 1);
  const auto artnet = std::get<InputOptions>(Parse("input artnet --listen 0.0.0.0:99").command);
  EXPECT_EQ(artnet.first_universe, 0);
  EXPECT_EQ(artnet.listen, "0.0.0.0:99");
  EXPECT_EQ(std::get<InputOptions>(Parse("input ddp").command).listen, "127.0.0.1:4048");
  const std::vector<std::pair<const char*, const char*>> wrong = {
      {"input", "wants a PROTOCOL"},
      {"input opcc", "PROTOCOL opcc is not known"},
      {"input opc --universe 1", "--universe is for e131 and artnet"},
      {"input e131 --universe 0", "--universe 0; e131 has 1 to 63999"},
      {"input artnet --universe 40000", "artnet has 0 to 32767"},
      {"input ddp --per-channel 2", "--per-channel is for opc"},
      {"input artnet --multicast", "--multicast is for e131"},
      {"input opc --size 4x4", "--size 4x4 is no box of lights, such as 16x16x16"},
      {"input opc --size 4x4x0", "no box of lights"},
      {"pipe --size 4x4x4 --layout a.json", "--size and --layout do not go together"}};
  for (const auto& [line, words] : wrong) {
    const ParsedCommandLine parsed = ParseCommandLine(Split(line));
    EXPECT_EQ(parsed.exit_code, kExitUsage) << line;
    EXPECT_THAT(parsed.err, HasSubstr(words));
  }
}

TEST(CommandLine, RenderAndExport) {
  const auto render = std::get<TurntableOptions>(
      Parse("render a.MP4 --frames 10 --fps 30 --size 640x480 --azimuth 5 --elevation -6 --turns "
            "-0.5 --live --display d --timeout 2")
          .command);
  EXPECT_EQ(render.file, "a.MP4");
  EXPECT_EQ(render.format, PictureFormat::kMp4);
  EXPECT_EQ(render.frames, 10);
  EXPECT_EQ(render.fps, 30);
  EXPECT_EQ(render.width, 640);
  EXPECT_EQ(render.azimuth_degrees, 5);
  EXPECT_EQ(render.elevation_degrees, -6);
  EXPECT_EQ(render.turns, -0.5);
  EXPECT_TRUE(render.live);
  EXPECT_EQ(render.display, "d");
  const auto gif = std::get<TurntableOptions>(Parse("render a.gif").command);
  EXPECT_EQ(gif.frames, 72);
  EXPECT_EQ(gif.fps, 24);
  EXPECT_EQ(gif.width, 720);
  EXPECT_EQ(std::get<TurntableOptions>(Parse("render -- -#.png").command).frames, 72);
  EXPECT_EQ(std::get<TurntableOptions>(Parse("render a.png").command).frames, 1);
  EXPECT_EQ(std::get<ExportOptions>(Parse("export a.npz --display d").command).format,
            ExportFormat::kNpz);
  const std::vector<std::pair<const char*, const char*>> wrong = {
      {"render", "render wants the name of a file, such as turn.gif"},
      {"render a.mpg", "the name a.mpg ends in .mpg; render goes by it; did you mean .mp4?"},
      {"render turn", "the name turn has no ending; render goes by it, such as turn.gif"},
      {"render a.png --frames 3", "--frames is of moving pictures, and a.png is one"},
      {"render #/a.png --live", "have #### for the pictures' numbers in the name"},
      {"render a.gif --fps 60", "--fps is 60; a GIF's pictures last 0.02 s at least"},
      {"render a.mp4 --size 641x480", "the sides of an MP4 are even, such as 640x480"},
      {"render a.gif --frames 2.5", "--frames wants a whole number"},
      {"render a.gif --frames 0", "--frames is 0; a number from 1 to 10000 is expected"},
      {"export a.obj",
       "the name a.obj ends in .obj; export goes by it; known are .ply, .vox, .npz"},
      {"export a.ply b.ply", "\"b.ply\" is one argument too many"}};
  for (const auto& [line, words] : wrong) {
    const ParsedCommandLine parsed = ParseCommandLine(Split(line));
    EXPECT_EQ(parsed.exit_code, kExitUsage) << line;
    EXPECT_THAT(parsed.err, HasSubstr(words));
  }
}

TEST(CommandLine, Pipe) {
  const auto pipe =
      std::get<PipeOptions>(Parse("pipe --layout a.json --display d --fps 30 --keep").command);
  EXPECT_EQ(pipe.lights.layout, "a.json");
  EXPECT_EQ(pipe.lights.display, "d");
  EXPECT_EQ(pipe.lights.layer, "lights");
  EXPECT_EQ(pipe.fps, 30);
  EXPECT_TRUE(pipe.keep);
}

TEST(CommandLine, AFileMayBeCalledLikeACommandOrAnOption) {
  EXPECT_THAT(std::get<PlayOptions>(Parse("play stats").command).files, ElementsAre("stats"));
  EXPECT_THAT(std::get<PlayOptions>(Parse("play -- --spin").command).files, ElementsAre("--spin"));
  EXPECT_THAT(std::get<PlayOptions>(Parse("play a --spin -- -b c").command).files,
              ElementsAre("a", "-b", "c"));
  EXPECT_EQ(std::get<SnapshotOptions>(Parse("snapshot -- -a.png").command).file, "-a.png");
}

TEST(CommandLine, TheOthers) {
  const auto snapshot =
      std::get<SnapshotOptions>(Parse("snapshot o.png --display d --size 640x480 --azimuth -30 "
                                      "--elevation 5.5 --timeout 9")
                                    .command);
  EXPECT_EQ(snapshot.file, "o.png");
  EXPECT_EQ(snapshot.width, 640);
  EXPECT_EQ(snapshot.height, 480);
  EXPECT_EQ(snapshot.azimuth_degrees, -30);
  EXPECT_EQ(snapshot.elevation_degrees, 5.5);
  EXPECT_FALSE(snapshot.slices);
  EXPECT_EQ(snapshot.timeout_s, 9);
  EXPECT_TRUE(std::get<SnapshotOptions>(Parse("snapshot o.PNG --slices").command).slices);
  EXPECT_EQ(std::get<SnapshotOptions>(Parse("snapshot picture").command).file, "picture");
  const auto stats = std::get<StatsOptions>(Parse("stats --watch --interval 0.5").command);
  EXPECT_TRUE(stats.watch);
  EXPECT_EQ(stats.interval_s, 0.5);
  const auto top = std::get<TopOptions>(Parse("top --once --interval 2 --display d").command);
  EXPECT_TRUE(top.once);
  EXPECT_EQ(top.interval_s, 2);
  EXPECT_EQ(top.display, "d");
  const auto entities =
      std::get<EntitiesOptions>(Parse("entities --layer l --owner 18446744073709551615").command);
  EXPECT_EQ(entities.layer, "l");
  EXPECT_EQ(entities.owner, UINT64_MAX);
  const auto why = std::get<WhyOptions>(Parse("why ball --layer l --owner 3 --display d").command);
  EXPECT_EQ(why.id, "ball");
  EXPECT_EQ(why.layer, "l");
  EXPECT_EQ(why.owner, 3u);
  EXPECT_EQ(why.display, "d");
  const auto watch = std::get<WatchOptions>(Parse("watch --layer l --owner 7").command);
  EXPECT_EQ(watch.layer, "l");
  EXPECT_EQ(watch.owner, 7u);
  EXPECT_TRUE(std::get<ClearOptions>(Parse("clear --all").command).all);
  EXPECT_EQ(std::get<ClearOptions>(Parse("clear --layer x").command).layer, "x");
  EXPECT_EQ(std::get<PatternOptions>(Parse("pattern axes").command).pattern, v1::TEST_PATTERN_AXES);
  EXPECT_EQ(std::get<PatternOptions>(Parse("pattern none --display d").command).display, "d");
  EXPECT_TRUE(std::get<PatternOptions>(Parse("pattern list").command).list);
  EXPECT_EQ(std::get<ProfileOptions>(Parse("profile check ./a.toml").command).profile, "./a.toml");
  EXPECT_TRUE(std::get<ProfileOptions>(Parse("profile list").command).list);
  const auto set = std::get<SetOptions>(
      Parse("set --display d --brightness 0.5 --blank on --power-limit 40").command);
  EXPECT_EQ(set.display, "d");
  EXPECT_EQ(set.brightness, 0.5);
  EXPECT_EQ(set.blank, true);
  EXPECT_EQ(set.power_limit_w, 40);
  EXPECT_FALSE(std::get<SetOptions>(Parse("set --blank off").command).brightness.has_value());
  const auto calibrate =
      std::get<CalibrateOptions>(Parse("calibrate voxlink,profile=./a.toml b.toml").command);
  EXPECT_EQ(calibrate.display, "voxlink,profile=./a.toml");
  EXPECT_EQ(calibrate.file, "b.toml");
  EXPECT_THAT(PatternNames(), ElementsAre("axes", "corners", "grid", "ramp", "white", "bars",
                                          "density", "slices", "posts", "frames"));
}

struct Wrong {
  const char* line;
  std::vector<std::string> words;
};

class UsageErrors : public testing::TestWithParam<Wrong> {};

TEST_P(UsageErrors, ExitWithTwoAndSuggest) {
  const ParsedCommandLine parsed = ParseCommandLine(Split(GetParam().line));
  EXPECT_FALSE(parsed.options.has_value());
  EXPECT_EQ(parsed.exit_code, 2);
  EXPECT_EQ(parsed.out, "");
  for (const std::string& word : GetParam().words)
    EXPECT_THAT(parsed.err, HasSubstr(word)) << GetParam().line;
  EXPECT_THAT(parsed.err, HasSubstr("--help"));
}

INSTANTIATE_TEST_SUITE_P(
    Table, UsageErrors,
    testing::Values(
        Wrong{"", {"a command is expected", "play", "pattern"}},
        Wrong{"--json", {"a command is expected"}},
        Wrong{"plya a.obj", {"\"plya\" is no command", "did you mean play?"}},
        Wrong{"snap o.png", {"did you mean snapshot?"}},
        Wrong{"--json stat", {"did you mean stats?"}},
        Wrong{"--server a:1 claer", {"did you mean clear?"}},
        Wrong{"play a b --animate", {"--animate wants one FILE"}},
        Wrong{"play a --animate 0", {"the first animation is 1"}},
        Wrong{"play a --animate --sequence", {"do not go together"}},
        Wrong{"play a.nii --window 5", {"--window is 5; LOW:HIGH is expected"}},
        Wrong{"play a.nii --window 5:5", {"LOW:HIGH is expected"}},
        Wrong{"play a.nii --window 1:5 --level 3", {"do not go together"}},
        Wrong{"play a.raw --size 5x5", {"--size is 5x5; XxYxZ is expected"}},
        Wrong{"play a.raw --size 5x5x0", {"XxYxZ is expected"}},
        Wrong{"play a.raw --type u8", {"want --size too"}},
        Wrong{"play a.raw --size 1x1x1 --type u9", {"--type u9 is not known", "u8"}},
        Wrong{"xyzzy", {"\"xyzzy\" is no command", "known are play, demo, draw, snapshot"}},
        Wrong{"pl\x1b[31m", {"pl\\u{1b}[31m"}},
        Wrong{"play", {"at least one FILE", "voxelctl play --help"}},
        Wrong{"play a.obj --sipn", {"--sipn", "did you mean --spin?"}},
        Wrong{"play --sipn", {"did you mean --spin?"}},
        Wrong{"play a.obj --jsno", {"did you mean --json?"}},
        Wrong{"play a.obj --fill=surfaces", {"--fill surfaces", "did you mean surface?"}},
        Wrong{"play a.obj --fill fog", {"known are dots, lines, surface"}},
        Wrong{"play a.obj --up w", {"--up w", "known are auto, x, y, z"}},
        Wrong{"play a.obj --fps 0", {"--fps is 0", "0.1 to 240"}},
        Wrong{"play a.obj --fps nan", {"--fps is nan"}},
        Wrong{"play a.obj --fps many",
              {"voxelctl: --fps is many; a number from 0.1 to 240 is expected\n"}},
        Wrong{"play a.obj --fps 9fps", {"--fps is 9fps; a number"}},
        Wrong{"play a.obj --fps 1e999", {"--fps is 1e999; a number"}},
        Wrong{"play a.obj --duration long",
              {"--duration is long; a number from 0 to 1e+09 is expected"}},
        Wrong{"play a.obj --duration -1", {"--duration is -1"}},
        Wrong{"play a.obj --duration", {"--duration"}}, Wrong{"snapshot", {"OUT.png"}},
        Wrong{"snapshot a.png b.png", {"\"b.png\"", "too many"}},
        Wrong{"snapshot a.png --size 640", {"--size is 640", "WIDTHxHEIGHT"}},
        Wrong{"snapshot a.png --size 99999x10", {"width", "99999", "64 to 8192"}},
        Wrong{"snapshot a.png --size 640x1e3", {"--size is 640x1e3"}},
        Wrong{"snapshot a.png --elevation 90", {"--elevation is 90"}},
        Wrong{"snapshot a.png --timeout 61", {"--timeout is 61"}},
        Wrong{"snapshot a.png --timeout soon",
              {"--timeout is soon; a number from 0.01 to 60 is expected"}},
        Wrong{"snapshot a.png --azimuth left",
              {"--azimuth is left; a number from -3600 to 3600 is expected"}},
        Wrong{"snapshot a.png --elevation up",
              {"--elevation is up; a number from -89 to 89 is expected"}},
        Wrong{"snapshot a.png --slices --size 640x480", {"--size does not go with --slices"}},
        Wrong{"snapshot a.png --elevation 5 --slices", {"--elevation does not go with --slices"}},
        Wrong{"snapshot b/a.jpg", {"b/a.jpg ends in .jpg", "writes PNG", "name it b/a.png"}},
        Wrong{"snapshot a.b\x1b", {"ends in .b\\u{1b}"}},
        Wrong{"displays all", {"\"all\"", "too many"}},
        Wrong{"displays -- all", {"\"all\"", "too many"}},
        Wrong{"stats --interval 0", {"--interval is 0"}},
        Wrong{"stats --interval often",
              {"--interval is often; a number from 0.01 to 3600 is expected"}},
        Wrong{"entities --owner me", {"--owner is me; an owner's number is expected"}},
        Wrong{"watch --owner 0x7", {"--owner is 0x7; an owner's number is expected"}},
        Wrong{"entities --owner -1", {"--owner is -1; an owner's number"}},
        Wrong{"entities --owner 010", {"--owner is 010; an owner's number"}},
        Wrong{"entities --owner 18446744073709551616",
              {"--owner is 18446744073709551616; an owner's number"}},
        Wrong{"why", {"why wants the ID"}}, Wrong{"why a b", {"\"b\"", "too many"}},
        Wrong{"clear --all --layer x", {"do not go together"}},
        Wrong{"pattern", {"pattern wants a name", "axes", "list"}},
        Wrong{"profile", {"check PROFILE, or list"}},
        Wrong{"profile chek x", {"the action chek is not known", "check"}},
        Wrong{"profile check", {"profile check wants a PROFILE"}},
        Wrong{"set", {"set wants something to set", "--power-limit"}},
        Wrong{"set --brightness 2", {"--brightness", "2"}},
        Wrong{"set --blank maybe", {"--blank", "maybe"}},
        Wrong{"calibrate simulated", {"calibrate wants a DISPLAY and the name of a file"}},
        Wrong{"pattern axs", {"did you mean axes?"}},
        Wrong{"--sevrer a:1 stats", {"--sevrer is no option here", "did you mean --server?"}},
        Wrong{"--watch stats", {"--watch is an option of stats, and belongs behind it"}},
        Wrong{"stats --interval", {"--interval wants a value, S: Seconds between, 0.01 to 3600\n"}},
        Wrong{"set --blank", {"--blank wants a value, on|off"}},
        Wrong{"stats --watch=\x1bmaybe", {"--watch is \\u{1b}maybe; it takes no value"}},
        Wrong{"rendre a.gif", {"did you mean render?"}},
        Wrong{"top --interval 0.01", {"--interval is 0.01; a number from 0.1 to 3600"}},
        Wrong{"completion", {"completion wants a SHELL: bash, zsh or fish"}},
        Wrong{"completion basch", {"the shell basch is not known", "did you mean bash?"}},
        Wrong{"__complet", {"is no command"}},
        Wrong{"stats --wacth=1", {"--wacth", "did you mean --watch?"}}));

TEST(CommandLine, HelpAndVersionAreData) {
  for (const char* line : {"--help", "-h", "play --help", "--json stats -h"}) {
    const ParsedCommandLine parsed = ParseCommandLine(Split(line));
    EXPECT_FALSE(parsed.options.has_value());
    EXPECT_EQ(parsed.exit_code, 0) << line;
    EXPECT_THAT(parsed.out, HasSubstr("Usage: voxelctl"));
    EXPECT_EQ(parsed.err, "");
  }
  EXPECT_THAT(ParseCommandLine({"play", "--help"}).out, HasSubstr("--flat"));
  const ParsedCommandLine version = ParseCommandLine({"--version"});
  EXPECT_EQ(version.exit_code, 0);
  EXPECT_THAT(version.out, testing::MatchesRegex("voxelctl [0-9]+\\.[0-9]+\\.[0-9]+\n"));
}

TEST(CommandLine, WhatIsForScriptsIsHidden) {
  EXPECT_EQ(std::get<CompleteOptions>(Parse("__complete layers vox").command).beginning, "vox");
  const ManualOptions manual = std::get<ManualOptions>(Parse("__manual out").command);
  EXPECT_EQ(manual.folder, "out");
  ASSERT_GT(manual.pages.size(), 25u);
  EXPECT_EQ(manual.pages[0].first, "voxelctl.1");
  for (const auto& [name, page] : manual.pages) {
    EXPECT_THAT(page, testing::Not(HasSubstr("__"))) << name;
    EXPECT_THAT(page, HasSubstr(".SH SEE ALSO")) << name;
  }
  EXPECT_THAT(ParseCommandLine({"--help"}).out, testing::Not(HasSubstr("__complete")));
  EXPECT_THAT(ParseCommandLine({"xyzzy"}).err, testing::Not(HasSubstr("__")));
  const ParsedCommandLine script = ParseCommandLine({"completion", "bash"});
  EXPECT_FALSE(script.options.has_value());
  EXPECT_EQ(script.exit_code, 0);
  EXPECT_THAT(script.out, HasSubstr("complete -F _voxelctl voxelctl\n"));
}

TEST(EditDistance, CountsAddDropChangeSwap) {
  EXPECT_EQ(EditDistance("", ""), 0u);
  EXPECT_EQ(EditDistance("play", "play"), 0u);
  EXPECT_EQ(EditDistance("PLAY", "play"), 0u);
  EXPECT_EQ(EditDistance("ply", "play"), 1u);
  EXPECT_EQ(EditDistance("plaay", "play"), 1u);
  EXPECT_EQ(EditDistance("plby", "play"), 1u);
  EXPECT_EQ(EditDistance("paly", "play"), 1u);
  EXPECT_EQ(EditDistance("kitten", "sitting"), 3u);
  EXPECT_EQ(EditDistance("", "abc"), 3u);
}

TEST(Nearest, OnlyWhatMayBeMeant) {
  EXPECT_EQ(Nearest("sats", {"stats", "snapshot"}), "stats");
  EXPECT_EQ(Nearest("disp", {"displays", "stats"}), "displays");
  EXPECT_EQ(Nearest("q", {"x", "y"}), "");
  EXPECT_EQ(Nearest("", {"x"}), "");
  EXPECT_EQ(Nearest(std::string(1000, 'a'), {std::string(1000, 'b')}), "");
}

}  // namespace
}  // namespace voxeld::voxelctl
