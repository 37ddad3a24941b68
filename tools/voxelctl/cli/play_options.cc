#include "tools/voxelctl/cli/play_options.h"

#include <CLI/CLI.hpp>
#include <cmath>
#include <utility>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "common/text/printable.h"
#include "tools/voxelctl/cli/argument_checks.h"

namespace voxeld::voxelctl {
namespace {

const Choices<Up> kUps = {{"auto", Up::kAuto}, {"x", Up::kX}, {"y", Up::kY}, {"z", Up::kZ}};
const Choices<FillStyle> kFills = {
    {"dots", FillStyle::kDots}, {"lines", FillStyle::kLines}, {"surface", FillStyle::kSurface}};
const Choices<OtherFiles> kOtherFiles = {
    {"none", OtherFiles::kNone}, {"below", OtherFiles::kBelow}, {"any", OtherFiles::kAny}};
const Choices<MoleculeStyle> kStyles = {{"balls", MoleculeStyle::kBalls},
                                        {"space", MoleculeStyle::kSpace}};
const Choices<SampleType> kTypes = {{"u8", SampleType::kU8},   {"i8", SampleType::kI8},
                                    {"u16", SampleType::kU16}, {"i16", SampleType::kI16},
                                    {"u32", SampleType::kU32}, {"i32", SampleType::kI32},
                                    {"f32", SampleType::kF32}, {"f64", SampleType::kF64}};

// Reads two numbers in ascending order.
std::array<double, 2> ReadRange(absl::string_view option, const std::string& text) {
  const std::pair<std::string, std::string> ends = absl::StrSplit(text, absl::MaxSplits(':', 1));
  std::array<double, 2> range;
  if (!absl::SimpleAtod(ends.first, &range[0]) || !absl::SimpleAtod(ends.second, &range[1]) ||
      !(range[0] < range[1]) || !std::isfinite(range[1] - range[0])) {
    throw UsageError{absl::StrCat(option, " is ", EscapeForTerminal(text),
                                  "; LOW:HIGH is expected, LOW less than HIGH, such as 0:100")};
  }
  return range;
}

}  // namespace

void PlayArguments::Add(CLI::App* c) {
  command_ = c;
  c->add_option("FILE", options_.files,
                "Files; several share one space, as parts of one thing (meshes beside a --globe "
                "come inside it)")
      ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
  c->add_flag("--spin", options_.spin,
              "Turn about the vertical axis, 8 s a turn, until Ctrl-C or --duration");
  c->add_option("--up", up_,
                "The files' axis that points up: auto, x, y or z. auto: y for glTF, OBJ and flat "
                "maps, z for STL and PLY; y up has +z in front, z and x up have -y in front")
      ->type_name("auto|x|y|z")
      ->capture_default_str();
  c->add_option("--fill", fill_, "Draw meshes as dots, lines or surface")
      ->type_name("dots|lines|surface")
      ->capture_default_str();
  AddNumber(c, "--fps", &options_.fps, 0.1, 240, "Frames a second of what moves, 0.1 to 240", "N");
  c->add_flag("--sequence", options_.sequence,
              "One file after another, --fps a second, instead of all at once; a FILE such as "
              "'frame_####.obj' or 'frame_%04d.obj' is such a sequence");
  animate_option_ = c->add_option("--animate", animate_,
                                  "Play an animation of a glTF, FBX, COLLADA or BVH file, the "
                                  "first or number N, --fps frames a second")
                        ->type_name("[N]")
                        ->expected(0, 1);
  c->add_flag("--loop", options_.loop,
              "A sequence or animation begins again at its end, until Ctrl-C");
  c->add_option("--duration", duration_, "End after so many seconds")->type_name("S");
  WantNumber(c->get_option("--duration"), 0, 1e9);
  c->add_flag("--globe", options_.globe,
              "Put maps on a sphere by longitude and latitude, poles on the vertical axis");
  c->add_flag("--flat", options_.flat, "Colours as they are in the file, without shading");
  c->add_flag("--each", options_.each, "Fit every file by itself instead of all together");
  c->add_option("--display", options_.display, "Fill this display's volume (default: fit into all)")
      ->type_name("NAME");
  c->add_option(
       "--other-files", other_files_,
       "Read the files that a FILE names, such as buffers and materials: none, those in its "
       "folder and below, or any")
      ->type_name("none|below|any")
      ->capture_default_str();
  c->add_flag("--clear", options_.clear, "Take the scene down at the end");
  c->add_option("--style", style_,
                "Of molecules: balls with bonds between them, or space, atoms as large as they are")
      ->type_name("balls|space")
      ->capture_default_str();
  c->add_option("--colormap", options_.volume.colormap,
                "Colour map for volumes and --color-by, such as viridis (default "
                "for volumes: grey)")
      ->type_name("NAME");
  c->add_option("--color-by", options_.color_by,
                "Colour points, meshes and molecules by a column or attribute of the file, or "
                "by x, y or z, with the map of --colormap (default: viridis)")
      ->type_name("NAME");
  c->add_option("--range", range_,
                "With --color-by: the values of the first and the last colour (default: "
                "the least and the greatest)")
      ->type_name("LOW:HIGH");
  c->add_option("--window", window_,
                "Of volumes: the numbers that are dark and as bright as can be (default: the "
                "file's, else found from the samples)")
      ->type_name("LOW:HIGH");
  c->add_option("--level", level_, "Of volumes: the surface where the numbers are this instead")
      ->type_name("VALUE");
  WantNumber(c->get_option("--level"), -1e300, 1e300);
  c->add_option("--size", size_, "Of .raw files: samples along x, y and z, x fastest")
      ->type_name("XxYxZ");
  c->add_option("--type", type_, "Of .raw files: u8, i8, u16, i16, u32, i32, f32 or f64")
      ->type_name("u8|i8|u16|i16|u32|i32|f32|f64");
  c->add_flag("--big-endian", big_endian_, "Of .raw files: the highest byte comes first");
}

void PlayArguments::ReadAnimation() {
  if (animate_option_->count() == 0) return;
  options_.animation = 1;
  for (const std::string& word : animate_) {
    uint32_t number = 0;
    if (word.empty()) continue;
    if (!absl::SimpleAtoi(word, &number)) {
      // For example --animate walk.glb.
      options_.files.push_back(word);
    } else if (number < 1) {
      throw UsageError{
          absl::StrCat("--animate is ", EscapeForTerminal(word), "; the first animation is 1")};
    } else {
      options_.animation = number;
    }
  }
  if (options_.files.size() > 1) throw UsageError{"--animate wants one FILE"};
  if (options_.sequence) throw UsageError{"--animate and --sequence do not go together"};
}

void PlayArguments::ReadVolume() {
  if (!window_.empty()) options_.volume.window = ReadRange("--window", window_);
  if (command_->count("--color-by") > 0 && options_.color_by.empty())
    throw UsageError{"--color-by wants a name, such as z"};
  if (!range_.empty()) {
    options_.range = ReadRange("--range", range_);
    if (options_.color_by.empty())
      throw UsageError{"--range requires --color-by, for example --color-by z"};
  }
  if (!std::isnan(level_)) {
    if (options_.volume.window) throw UsageError{"--window and --level do not go together"};
    options_.volume.level = level_;
  }
  if (size_.empty()) {
    if (!type_.empty() || big_endian_)
      throw UsageError{"--type and --big-endian are of .raw files, which want --size too"};
    return;
  }
  RawLayout layout;
  const std::vector<std::string> sides = absl::StrSplit(size_, absl::ByAnyChar("xX"));
  bool good = sides.size() == 3;
  for (size_t axis = 0; axis < 3 && good; ++axis) {
    good = absl::SimpleAtoi(sides[axis], &layout.size[axis]) && layout.size[axis] > 0;
  }
  if (!good) {
    throw UsageError{absl::StrCat("--size is ", EscapeForTerminal(size_),
                                  "; XxYxZ is expected, such as 256x256x128")};
  }
  layout.type = Choose("--type", type_.empty() ? "u8" : type_, kTypes);
  layout.big_endian = big_endian_;
  options_.raw = layout;
}

PlayOptions PlayArguments::Read(const std::vector<std::string>& plain) {
  options_.files.insert(options_.files.end(), plain.begin(), plain.end());
  ReadAnimation();
  if (options_.files.empty()) throw UsageError{"play wants at least one FILE"};
  for (const char* name :
       {"--globe", "--style", "--fill", "--colormap", "--window", "--level", "--size"}) {
    if (command_->count(name) > 0) options_.given.push_back(name);
  }
  options_.up = Choose("--up", up_, kUps);
  options_.fill = Choose("--fill", fill_, kFills);
  options_.style = Choose("--style", style_, kStyles);
  options_.other_files = Choose("--other-files", other_files_, kOtherFiles);
  if (!std::isnan(duration_)) options_.duration_s = duration_;
  ReadVolume();
  return options_;
}

}  // namespace voxeld::voxelctl
