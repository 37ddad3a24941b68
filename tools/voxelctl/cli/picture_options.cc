#include "tools/voxelctl/cli/picture_options.h"

#include <cmath>
#include <filesystem>
#include <utility>
#include <vector>

#include "absl/strings/ascii.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "tools/voxelctl/cli/about.h"
#include "tools/voxelctl/cli/argument_checks.h"

namespace voxeld::voxelctl {
namespace {

constexpr const char* kWhereItGoes =
    "Where it goes; an old one is replaced when the new one is whole";

void AddDisplay(CLI::App* command, std::string* display) {
  command->add_option("--display", *display, "Which display (default: the first)")
      ->type_name("NAME");
}

void AddViewer(CLI::App* command, double* azimuth, double* elevation, const char* where) {
  AddNumber(
      command, "--azimuth", azimuth, -3600, 3600,
      absl::StrCat("Degrees that the viewer has walked to the right from the front", where).c_str(),
      "DEG");
  AddNumber(command, "--elevation", elevation, -89, 89,
            "Degrees that the viewer stands above the middle, -89 to 89", "DEG");
}

void AddTimeout(CLI::App* command, double* seconds) {
  AddNumber(command, "--timeout", seconds, 0.01, 60, "Seconds to wait for a volume, up to 60", "S");
}

void ReadSize(const std::string& text, int* width, int* height) {
  const std::vector<std::string> sides = absl::StrSplit(text, absl::ByAnyChar("xX"));
  if (sides.size() != 2 || !absl::SimpleAtoi(sides[0], width) ||
      !absl::SimpleAtoi(sides[1], height)) {
    throw UsageError{absl::StrCat("--size is ", EscapeForTerminal(text),
                                  "; WIDTHxHEIGHT is expected, such as 1200x1000")};
  }
  CheckRange("the width in --size", *width, 64, 8192);
  CheckRange("the height in --size", *height, 64, 8192);
}

// Selects the format by the file's extension.
template <typename T>
T FormatOf(const std::string& file, const char* command, const char* example,
           const Choices<T>& formats) {
  if (file.empty()) {
    throw UsageError{absl::StrCat(command, " wants the name of a file, such as ", example)};
  }
  const std::string end = absl::AsciiStrToLower(std::filesystem::path(file).extension().string());
  std::vector<std::string> ends;
  for (const auto& [name, format] : formats) {
    if (end == name) return format;
    ends.push_back(name);
  }
  throw UsageError{absl::StrCat(
      "the name ", EscapeForTerminal(file),
      end.empty() ? " has no ending" : absl::StrCat(" ends in ", EscapeForTerminal(end)), "; ",
      command, " goes by it",
      end.empty() ? absl::StrCat(", such as ", example) : Suggestion(end, ends))};
}

}  // namespace

void SnapshotArguments::Add(CLI::App* command) {
  command->add_option("OUT.png", options_.file, kWhereItGoes);
  AddDisplay(command, &options_.display);
  command->add_option("--size", size_, "Size of the picture, 64x64 to 8192x8192")
      ->type_name("WxH")
      ->capture_default_str();
  AddViewer(command, &options_.azimuth_degrees, &options_.elevation_degrees, "");
  command->add_flag("--slices", options_.slices,
                    "A contact sheet of all slices instead, as large as they make it");
  AddTimeout(command, &options_.timeout_s);
}

SnapshotOptions SnapshotArguments::Read(const CLI::App& command) const {
  SnapshotOptions options = options_;
  if (options.file.empty()) throw UsageError{"snapshot wants the name of a file, OUT.png"};
  CheckPictureName(options.file);
  for (const char* option : {"--size", "--azimuth", "--elevation"}) {
    if (options.slices && command.count(option) > 0) {
      throw UsageError{absl::StrCat(option,
                                    " does not go with --slices: a contact sheet has no "
                                    "viewer, and its size follows from the slices")};
    }
  }
  ReadSize(size_, &options.width, &options.height);
  return options;
}

void RenderArguments::Add(CLI::App* command) {
  command->add_option("OUT", options_.file,
                      "OUT.gif, OUT.mp4, OUT####.png (numbered pictures) or OUT.png (one)");
  AddDisplay(command, &options_.display);
  AddNumber(command, "--frames", &frames_, 1, 10000, "Pictures in all, 1 to 10000", "N");
  AddNumber(command, "--fps", &options_.fps, 0.1, 240, "Pictures a second; of a GIF at most 50",
            "N");
  command
      ->add_option("--size", size_,
                   "Size of the pictures, 64x64 to 8192x8192 (default: 720x600; of one 1200x1000)")
      ->type_name("WxH");
  AddViewer(command, &options_.azimuth_degrees, &options_.elevation_degrees,
            " at the first picture");
  AddNumber(command, "--turns", &options_.turns, -100, 100,
            "Times that the viewer walks around; below 0: to the left; 0: stands still", "N");
  command->add_flag("--live", options_.live,
                    "What the display shows at each picture's time, instead of one volume in all");
  AddTimeout(command, &options_.timeout_s);
}

TurntableOptions RenderArguments::Read(const CLI::App& command) const {
  TurntableOptions options = options_;
  options.format = FormatOf<PictureFormat>(options.file, "render", "turn.gif",
                                           {{".gif", PictureFormat::kGif},
                                            {".mp4", PictureFormat::kMp4},
                                            {".png", PictureFormat::kPng}});
  if (frames_ != std::floor(frames_)) throw UsageError{"--frames wants a whole number"};
  options.frames = static_cast<int>(frames_);
  const std::string name = std::filesystem::path(options.file).filename().string();
  const bool one = options.format == PictureFormat::kPng && name.find('#') == std::string::npos;
  for (const char* option : {"--frames", "--fps", "--turns", "--live"}) {
    if (one && command.count(option) > 0) {
      throw UsageError{absl::StrCat(
          option, " is of moving pictures, and ", EscapeForTerminal(options.file),
          " is one: name it .gif or .mp4, or have #### for the pictures' numbers in the name")};
    }
  }
  if (one) options.frames = 1;
  if (options.format == PictureFormat::kGif && options.fps > 50) {
    throw UsageError{
        absl::StrCat("--fps is ", options.fps,
                     "; a GIF's pictures last 0.02 s at least: 0.1 to 50 is expected")};
  }
  ReadSize(!size_.empty()        ? size_
           : options.frames == 1 ? "1200x1000"
                                 : "720x600",
           &options.width, &options.height);
  if (options.format == PictureFormat::kMp4 &&
      (options.width % 2 != 0 || options.height % 2 != 0)) {
    throw UsageError{absl::StrCat("--size is ", options.width, "x", options.height,
                                  "; the sides of an MP4 are even, such as ", options.width / 2 * 2,
                                  "x", options.height / 2 * 2)};
  }
  return options;
}

void AddGalleryOptions(CLI::App* command, GalleryOptions* options) {
  command->add_option("OUT.png", options->file, kWhereItGoes);
  command
      ->add_option("--each", options->each,
                   "A folder for a small picture of each shape too, named as the shape is")
      ->type_name("DIR");
  AddDisplay(command, &options->display);
}

void CheckGalleryOptions(const GalleryOptions& options) {
  if (options.file.empty()) throw UsageError{"gallery wants the name of a file, OUT.png"};
  CheckPictureName(options.file);
}

void ExportArguments::Add(CLI::App* command) {
  command->add_option("OUT", options_.file, "OUT.ply, OUT.vox or OUT.npz");
  AddDisplay(command, &options_.display);
  AddTimeout(command, &options_.timeout_s);
}

ExportOptions ExportArguments::Read() const {
  ExportOptions options = options_;
  options.format = FormatOf<ExportFormat>(
      options.file, "export", "scene.ply",
      {{".ply", ExportFormat::kPly}, {".vox", ExportFormat::kVox}, {".npz", ExportFormat::kNpz}});
  return options;
}

}  // namespace voxeld::voxelctl
