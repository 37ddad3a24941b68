#include "tools/bench/voxel_bench/command_line.h"

#include <CLI/App.hpp>
#include <CLI/Config.hpp>
#include <CLI/Formatter.hpp>
#include <algorithm>

#include "absl/status/status.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "tools/bench/frame/scene.h"

namespace voxeld::bench {
namespace {

constexpr double kMostSeconds = 86'400;
constexpr int kMostRounds = 1000;

// Rejects NaN too.
CLI::Validator Between(double least, double most) {
  return CLI::Validator(
      [least, most](const std::string& text) -> std::string {
        double value = 0;
        if (absl::SimpleAtod(text, &value) && value >= least && value <= most) return {};
        return absl::StrCat("is ", text, "; give a number from ", least, " to ", most);
      },
      "NUMBER");
}

void AddRounds(CLI::App& app, int& rounds) {
  app.add_option("--rounds", rounds, "How often, in turns")
      ->check(CLI::Range(1, kMostRounds))
      ->capture_default_str();
}

void AddSeconds(CLI::App& app, double& seconds, const char* what) {
  app.add_option("--seconds", seconds, what)
      ->check(Between(0.01, kMostSeconds))
      ->capture_default_str();
}

void AddCount(CLI::App& app, const char* name, int& count, const char* what, int most) {
  app.add_option(name, count, what)->check(CLI::Range(1, most))->capture_default_str();
}

void AddRate(CLI::App& app, const char* name, double& rate, const char* what) {
  app.add_option(name, rate, what)->check(Between(0.1, 100'000))->capture_default_str();
}

void AddDisplay(CLI::App& app, std::string& display) {
  app.add_option("--display", display, "Options of the simulated display")->capture_default_str();
}

CLI::App* AddIngest(CLI::App& app, IngestOptions& options) {
  CLI::App* command = app.add_subcommand(
      "ingest", "What the daemon takes in, beside a bare gRPC server that throws the same away");
  command->add_option("--case", options.cases, "Only these; may be repeated")
      ->check(CLI::IsMember(IngestCases()))
      ->expected(1)
      ->take_all();
  AddRounds(*command, options.rounds);
  AddSeconds(*command, options.seconds, "Of each round of each side");
  command
      ->add_option("--line-bytes", options.line_bytes,
                   "Two F32 ends (24), with U16 indices (28), with RGB8 colours (30)")
      ->check(CLI::IsMember({24, 28, 30}))
      ->capture_default_str();
  command->add_option("--batch", options.batch, "Entities a message, of 4,096 lines each")
      ->check(CLI::Range(1, 64))
      ->capture_default_str();
  AddDisplay(*command, options.display);
  return command;
}

CLI::App* AddLatency(CLI::App& app, LatencyOptions& options) {
  CLI::App* command = app.add_subcommand(
      "latency", "From a commit's sending to its last byte in the display's transport");
  AddRounds(*command, options.rounds);
  AddSeconds(*command, options.seconds, "Of each round");
  AddRate(*command, "--rate", options.rate, "Commits a second");
  AddCount(*command, "--lines", options.lines, "All changed in each commit", 1'000'000);
  AddCount(*command, "--entities", options.entities, "Into which the lines go", 10'000);
  AddDisplay(*command, options.display);
  return command;
}

CLI::App* AddFairness(CLI::App& app, FairnessOptions& options) {
  CLI::App* command = app.add_subcommand("fairness", "Many clients at once, as fast as they may");
  AddRounds(*command, options.rounds);
  AddSeconds(*command, options.seconds, "Of each round");
  AddCount(*command, "--clients", options.clients, "Each on a connection of its own", 10'000);
  AddCount(*command, "--layers", options.layers, "Of each, one entity in each replaced a commit",
           1000);
  AddCount(*command, "--credit-bytes", options.credit_bytes, "The daemon's, of each client",
           1 << 30);
  AddDisplay(*command, options.display);
  return command;
}

CLI::App* AddBeside(CLI::App& app, BesideOptions& options) {
  CLI::App* command = app.add_subcommand(
      "beside", "One line now and then, while another owner uploads a large scene");
  AddRounds(*command, options.rounds);
  AddSeconds(*command, options.seconds, "Of each round, alone and beside the upload");
  AddRate(*command, "--rate", options.rate, "Commits of one line a second");
  AddCount(*command, "--entities", options.entities, "Of the upload, each a line, in one commit",
           1'000'000);
  AddRate(*command, "--volumes-per-second", options.volumes_per_second, "The display's");
  AddDisplay(*command, options.display);
  return command;
}

CLI::App* AddOverload(CLI::App& app, OverloadOptions& options) {
  CLI::App* command = app.add_subcommand(
      "overload", "More frames than the display takes: latency, memory and outcomes over time");
  AddSeconds(*command, options.seconds, "How long");
  AddRate(*command, "--factor", options.factor, "Frames for each volume, all clients together");
  AddRate(*command, "--volumes-per-second", options.volumes_per_second, "The display's");
  AddCount(*command, "--clients", options.clients, "That share the load", 1000);
  AddCount(*command, "--lines", options.lines, "A frame", 1'000'000);
  AddDisplay(*command, options.display);
  command->add_option("--csv", options.csv, "Writes the samples there")->type_name("FILE");
  command->add_option("--svg", options.svg, "Writes a plot of them there")->type_name("FILE");
  return command;
}

CLI::App* AddIdle(CLI::App& app, IdleOptions& options) {
  CLI::App* command = app.add_subcommand(
      "idle", "Memory of idle streams, and a normal client beside those that do not read");
  AddCount(*command, "--streams", options.streams, "That are idle", 100'000);
  AddRounds(*command, options.rounds);
  AddSeconds(*command, options.seconds, "Of the normal client, each time");
  AddRate(*command, "--rate", options.rate, "Its commits a second");
  AddDisplay(*command, options.display);
  return command;
}

CLI::App* AddPaper(CLI::App& app, PaperOptions& options) {
  CLI::App* command = app.add_subcommand(
      "paper", "The paper's Tables 2 to 4 on this machine, beside its figures and our ceilings");
  command->add_option("--engine", options.engines, "Only these; may be repeated")
      ->check(CLI::IsMember({"cpu", "cuda", "auto"}))
      ->expected(1)
      ->take_all();
  command->add_option("--table", options.tables, "Only these; may be repeated")
      ->check(CLI::IsMember({"2", "3", "4"}))
      ->expected(1)
      ->take_all();
  AddSeconds(*command, options.seconds, "Of each figure, at least");
  command->add_option("--voxels", options.voxels, "Of each batch of Table 4")
      ->check(CLI::Range(uint64_t{100'000}, uint64_t{1} << 33))
      ->capture_default_str();
  command->add_option("--seed", options.seed, "Of the segments")
      ->check(CLI::Range(uint64_t{0}, uint64_t{1} << 53))
      ->capture_default_str();
  command->add_option("--from", options.from, "Shows this report again (--json wrote it)")
      ->type_name("FILE")
      ->check(CLI::ExistingFile);
  command->add_option("--svg", options.svg, "Draws the paper's Figures 5 to 9 there")
      ->type_name("FOLDER")
      ->check(CLI::ExistingDirectory);
  return command;
}

CLI::App* AddFrame(CLI::App& app, FrameOptions& options) {
  CLI::App* command = app.add_subcommand(
      "frame",
      "Whole frames through the engine's door: a draw list to packed slices, beside ceilings");
  command->add_option("--scene", options.scene, "Which; needed but with --from")
      ->check(CLI::IsMember(frame::SceneNames()));
  command
      ->add_option("--from", options.from,
                   "Shows these reports instead (--json wrote them); may be repeated")
      ->type_name("FILE")
      ->check(CLI::ExistingFile)
      ->expected(1)
      ->take_all()
      ->excludes("--scene");
  command
      ->add_option("--svg", options.svg,
                   "Draws time against resolution there, of the scene implicit")
      ->type_name("FILE");
  CLI::Option* const gpus =
      command
          ->add_option("--gpus", options.gpus,
                       "Over so many GPUs (of the CPU engine: processes), a process each, beside "
                       "one of them; default: in this process")
          ->check(CLI::Range(1, 64));
  command->add_option("--nccl", options.nccl, "Where NCCL's library is, or off; with --gpus")
      ->type_name("FILE|off")
      ->needs(gpus);
  command
      ->add_flag("--keep-tiles", options.keep_tiles,
                 "Slices kept tiles, as geometries need whose pixels are not voxels; with "
                 "--engine cuda, without --gpus")
      ->excludes(gpus);
  command->add_option("--engine", options.engine, "Which")
      ->check(CLI::IsMember({"cpu", "cuda"}))
      ->capture_default_str();
  command->add_option("--threads", options.threads, "Of the CPU engine; default: one a core")
      ->check(CLI::Range(1, 1024));
  AddRounds(*command, options.rounds);
  command->add_option("--seed", options.seed, "Of the scene")
      ->check(CLI::Range(uint64_t{0}, uint64_t{1} << 53))
      ->capture_default_str();
  command->add_option("--share", options.share, "Of the scene's primitives, but of rotor's")
      ->check(Between(1e-6, 1))
      ->capture_default_str();
  return command;
}

}  // namespace

absl::StatusOr<CommandLine> ParseCommandLine(const std::vector<std::string>& arguments) {
  CommandLine out;
  CLI::App app("What the daemon reaches, measured from its clients' side.", "voxel-bench");
  app.footer(
      "All but paper and frame start a daemon of their own. A figure is the median, with least and "
      "greatest.");
  app.require_subcommand(1);
  app.fallthrough();
  app.add_flag("--json", out.json, "JSON alone on the standard output");
  app.add_option("--daemon", out.daemon, "The program voxeld; default: beside this one")
      ->type_name("FILE");
  IngestOptions ingest;
  LatencyOptions latency;
  FairnessOptions fairness;
  BesideOptions beside;
  OverloadOptions overload;
  IdleOptions idle;
  PaperOptions paper;
  FrameOptions frame;
  SinkOptions sink;
  CLI::App* const ingest_command = AddIngest(app, ingest);
  CLI::App* const latency_command = AddLatency(app, latency);
  CLI::App* const fairness_command = AddFairness(app, fairness);
  CLI::App* const beside_command = AddBeside(app, beside);
  CLI::App* const overload_command = AddOverload(app, overload);
  CLI::App* const idle_command = AddIdle(app, idle);
  CLI::App* const paper_command = AddPaper(app, paper);
  CLI::App* const frame_command = AddFrame(app, frame);
  CLI::App* const sink_command = app.add_subcommand("sink", "The bare gRPC server by itself");
  sink_command->add_option("--listen", sink.listen, "Where; may be repeated")
      ->required()
      ->expected(1)
      ->take_all();

  std::vector<std::string> reversed(arguments.rbegin(), arguments.rend());
  try {
    app.parse(reversed);
  } catch (const CLI::CallForHelp&) {
    out.print_and_exit = app.help();
    return out;
  } catch (const CLI::ParseError& error) {
    return absl::InvalidArgumentError(absl::StrCat(error.what(), " (see --help)"));
  }
  if (frame_command->parsed() && frame.scene.empty() && frame.from.empty()) {
    return absl::InvalidArgumentError("frame wants --scene, or --from (see --help)");
  }
  if (!frame.svg.empty() && frame.from.empty() && frame.scene != "implicit") {
    return absl::InvalidArgumentError(absl::StrCat(
        "--svg goes with --scene implicit, which has several resolutions, not with ", frame.scene));
  }
  if (ingest_command->parsed()) out.command = ingest;
  if (latency_command->parsed()) out.command = latency;
  if (fairness_command->parsed()) out.command = fairness;
  if (beside_command->parsed()) out.command = beside;
  if (overload_command->parsed()) out.command = overload;
  if (idle_command->parsed()) out.command = idle;
  if (paper_command->parsed()) out.command = paper;
  if (frame_command->parsed()) out.command = frame;
  if (sink_command->parsed()) out.command = sink;
  return out;
}

}  // namespace voxeld::bench
