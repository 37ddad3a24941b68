// The contents of the command line.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "tools/lights/datagram.h"
#include "tools/voxelctl/import/import_options.h"
#include "tools/voxelctl/import/model.h"
#include "tools/voxelctl/scene/look.h"
#include "tools/voxelctl/scene/volume.h"
#include "voxeld/credentials.h"
#include "voxeld/v1/display.pb.h"

namespace voxeld::voxelctl {

struct PlayOptions {
  std::vector<std::string> files;  // at least one
  std::vector<std::string> given;  // options that apply to some files only, as typed
  bool spin = false;
  bool clear = false;  // removes the layer at the end
  bool globe = false;
  bool flat = false;
  bool each = false;
  Up up = Up::kAuto;
  FillStyle fill = FillStyle::kSurface;
  double fps = 20;  // 0.1 to 240: for spins, sequences and animations
  std::optional<double> duration_s;
  std::string display;  // whose space is filled; empty: all displays fit
  std::optional<RawLayout> raw;
  VolumeLook volume;     // its colour map also applies to color_by
  std::string color_by;  // the attribute that colours points and meshes; empty: none
  std::optional<std::array<double, 2>> range;  // of the attribute; ascending
  MoleculeStyle style = MoleculeStyle::kBalls;
  OtherFiles other_files = OtherFiles::kBelow;  // which files they may refer to
  bool sequence = false;                        // shows the files one after another, at `fps`
  std::optional<uint32_t> animation;            // of the only file, from 1
  bool loop = false;                            // repeats a sequence or an animation
};

struct DemoOptions {
  std::vector<std::string> scenes;  // from kSceneNames; empty: all
  bool list = false;                // only lists the scenes
  bool once = false;                // ends after the last scene
  double seconds = 20;              // per scene
  std::string display;              // whose space is filled; empty: all displays fit
  std::string data;                 // a folder that is searched first; empty: none
};

struct DrawOptions {
  std::vector<std::string> shapes;  // at least one, as in shape/shape_text.h
  bool add = false;                 // adds to what voxelctl drew before
};

struct SnapshotOptions {
  std::string file;
  std::string display;  // empty: the first
  int width = 1200, height = 1000;
  double azimuth_degrees = 24, elevation_degrees = 20;
  bool slices = false;
  double timeout_s = 5;
};

enum class PictureFormat : uint8_t { kGif, kMp4, kPng };

struct TurntableOptions {
  std::string file;  // PNGs: with a run of "#", or one frame
  PictureFormat format = PictureFormat::kGif;
  std::string display;  // empty: the first
  int frames = 72;
  double fps = 24;
  int width = 720, height = 600;  // even for an MP4
  double azimuth_degrees = 24, elevation_degrees = 20;
  double turns = 1;  // over all frames; the last is a step before the first
  bool live = false;
  double timeout_s = 5;
};

enum class ExportFormat : uint8_t { kPly, kVox, kNpz };

struct ExportOptions {
  std::string file;
  ExportFormat format = ExportFormat::kPly;
  std::string display;  // empty: the first
  double timeout_s = 5;
};

struct GalleryOptions {
  std::string file;
  std::string each;     // a folder for a picture of each shape; empty: none
  std::string display;  // empty: the first
};

struct DisplaysOptions {};

struct StatsOptions {
  bool watch = false;
  double interval_s = 1;
};

struct TopOptions {
  bool once = false;
  double interval_s = 1;
  std::string display;  // shown first; empty: the first
};

struct EntitiesOptions {
  std::string layer;   // empty: all
  uint64_t owner = 0;  // 0: all
};

struct WhyOptions {
  std::string id;       // id of an entity
  std::string layer;    // empty: the only layer that has it
  uint64_t owner = 0;   // 0: the only owner that has it
  std::string display;  // empty: the first
};

struct WatchOptions {
  std::string layer;   // empty: all
  uint64_t owner = 0;  // 0: all
};

struct ClearOptions {
  std::string layer;  // empty: what voxelctl drew
  bool all = false;
};

struct PatternOptions {
  bool list = false;
  v1::TestPattern pattern = v1::TEST_PATTERN_NONE;
  std::string display;  // empty: all
};

struct SetOptions {
  std::string display;  // empty: all
  std::optional<double> brightness, power_limit_w;
  std::optional<bool> blank;
};

struct CalibrateOptions {
  std::string display;  // "[NAME=]DRIVER[,KEY=VALUE…]"
  std::string file;     // output file of the profile; must not exist yet
};

struct VerifyOptions {
  std::string display;  // "[NAME=]DRIVER[,KEY=VALUE…]"
  std::string filter;   // of case ids, matched like file names; empty: all
  std::string junit;    // output file; empty: none
  bool list = false;
  uint64_t seed = 1;
  double wait_s = 0;  // seconds to wait for the device to be attached
};

struct ProfileOptions {
  bool list = false;    // list profiles; otherwise check one
  std::string profile;  // a name or a path
};

struct DoctorOptions {};

struct InitOptions {
  std::string file;  // output file of the profile; must not exist yet
};

struct TokenOptions {
  std::string name;                  // the principal
  std::string scopes = "view,draw";  // as in the grants file
  double days = 0;                   // until it expires; 0: never
  std::string grants;                // the file to append the entry to; empty: none
};

struct RecordOptions {
  std::string file;       // must not exist yet
  double duration_s = 0;  // 0: until interrupted
  bool still = false;     // records only the current scene
};

struct PlaylistOptions {
  std::string file;
  bool check = false;  // only reports what it contains
};

struct ReplayOptions {
  std::string file;
  double speed = 1, from_s = 0;
  bool loop = false, step = false, keep = false;
};

// The lights, and the layer that shows them.
struct LightsOptions {
  std::optional<std::array<int, 3>> size;  // a box of lights; otherwise
  // An Open Pixel Control layout; otherwise the display's own.
  std::string layout;
  std::string display;  // empty: the first
  std::string layer = "lights";
};

struct InputOptions {
  lights::Protocol protocol = lights::Protocol::kOpc;
  LightsOptions lights;
  std::string listen;               // HOST:PORT
  int32_t first_universe = 1;       // E1.31, Art-Net
  int32_t universe_channels = 510;  // of each universe that belong to lights; as above
  int32_t a_channel = 0;            // lights per channel of Open Pixel Control; 0: all
  double gather_ms = 4;
  bool multicast = false;  // E1.31
};

struct MarkersOptions {
  std::string url;                  // ws://HOST:PORT
  std::vector<std::string> topics;  // empty: all scene topics
  std::string layer = "markers";
};

struct AssetsOptions {
  std::vector<std::string> files;  // to upload; empty: list the existing assets
};

struct PipeOptions {
  LightsOptions lights;
  double fps = 0;  // 0: as received
  bool keep = false;
};

// Completes a prefix to names for a shell.
struct CompleteOptions {
  std::string kind;
  std::string beginning;
};

// Manual pages, generated by the parser from its own declarations.
struct ManualOptions {
  std::string folder;
  std::vector<std::pair<std::string, std::string>> pages;  // file names and contents
};

struct Options {
  std::string server;               // empty: see ChooseServer
  client::Credentials credentials;  // as given; see ChooseCredentials
  bool json = false;
  std::variant<PlayOptions, DemoOptions, DrawOptions, SnapshotOptions, TurntableOptions,
               ExportOptions, GalleryOptions, DisplaysOptions, StatsOptions, TopOptions,
               EntitiesOptions, WatchOptions, ClearOptions, PatternOptions, SetOptions,
               CalibrateOptions, VerifyOptions, ProfileOptions, DoctorOptions, InitOptions,
               TokenOptions, RecordOptions, ReplayOptions, PlaylistOptions, InputOptions,
               MarkersOptions, PipeOptions, WhyOptions, AssetsOptions, CompleteOptions,
               ManualOptions>
      command;
};

// Exit codes of the whole tool.
inline constexpr int kExitOk = 0;
inline constexpr int kExitFailure = 1;
inline constexpr int kExitUsage = 2;
inline constexpr int kExitNoDevice = 3;  // verify: nothing was verified
inline constexpr int kExitInterrupted = 130;

// Either the options, or a text to print with the exit code (help, version, a usage error).
struct ParsedCommandLine {
  std::optional<Options> options;
  int exit_code = kExitOk;
  std::string out, err;
};

// `arguments` excludes the program's name. Global options may be before or after the command. A
// usage error says what was not understood, the nearest valid word, and where to find help.
ParsedCommandLine ParseCommandLine(const std::vector<std::string>& arguments);

}  // namespace voxeld::voxelctl
