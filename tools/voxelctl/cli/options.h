// What the command line says.
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
  std::vector<std::string>
      given;  // the options that only some files have a use for, as they are typed
  bool spin = false;
  bool clear = false;  // takes it down at the end
  bool globe = false;
  bool flat = false;
  bool each = false;
  Up up = Up::kAuto;
  FillStyle fill = FillStyle::kSurface;
  double fps = 20;  // 0.1 to 240: of spins, sequences and animations
  std::optional<double> duration_s;
  std::string display;  // whose space is filled; empty: all of them fit
  std::optional<RawLayout> raw;
  VolumeLook volume;     // its colour map also of color_by
  std::string color_by;  // the numbers that points and meshes are coloured by; empty: none
  std::optional<std::array<double, 2>> range;  // of those; the first less than the second
  MoleculeStyle style = MoleculeStyle::kBalls;
  OtherFiles other_files = OtherFiles::kBelow;  // the files that they name
  bool sequence = false;                        // the files one after another, at `fps`
  std::optional<uint32_t> animation;            // from 1 on: of the only file
  bool loop = false;                            // repeats a sequence or an animation
};

struct DemoOptions {
  std::vector<std::string> scenes;  // of kSceneNames; empty: all
  bool list = false;                // only says which there are
  bool once = false;                // ends after the last
  double seconds = 20;              // of each
  std::string display;              // whose space is filled; empty: all of them fit
  std::string data;                 // a folder that is looked at first; empty: none
};

struct DrawOptions {
  std::vector<std::string> shapes;  // at least one, as shape/shape_text.h has them
  bool add = false;                 // to what voxelctl put up before
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
  std::string file;  // PNGs: with a run of "#"s, or one frame
  PictureFormat format = PictureFormat::kGif;
  std::string display;  // empty: the first
  int frames = 72;
  double fps = 24;
  int width = 720, height = 600;  // of an MP4 even
  double azimuth_degrees = 24, elevation_degrees = 20;
  double turns = 1;  // in all frames; the last is a step before the first
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
  std::string display;  // that is looked at first; empty: the first
};

struct EntitiesOptions {
  std::string layer;   // empty: all
  uint64_t owner = 0;  // 0: all
};

struct WhyOptions {
  std::string id;       // an entity's
  std::string layer;    // empty: the only one that has it
  uint64_t owner = 0;   // 0: the only one that has it
  std::string display;  // empty: the first
};

struct WatchOptions {
  std::string layer;   // empty: all
  uint64_t owner = 0;  // 0: all
};

struct ClearOptions {
  std::string layer;  // empty: what voxelctl put up
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
  std::string file;     // where the profile goes: must not be there yet
};

struct VerifyOptions {
  std::string display;  // "[NAME=]DRIVER[,KEY=VALUE…]"
  std::string filter;   // of cases' ids, as file names are matched; empty: all
  std::string junit;    // a file to write, or nothing
  bool list = false;
  uint64_t seed = 1;
  double wait_s = 0;  // for the device to be attached
};

struct ProfileOptions {
  bool list = false;    // else check
  std::string profile;  // a name or a path
};

struct DoctorOptions {};

struct InitOptions {
  std::string file;  // where the profile goes: must not be there yet
};

struct TokenOptions {
  std::string name;                  // the principal
  std::string scopes = "view,draw";  // as the grants file has them
  double days = 0;                   // until it expires; 0: never
  std::string grants;                // the file that gets the entry; empty: none
};

struct RecordOptions {
  std::string file;       // must not be there yet
  double duration_s = 0;  // 0: until an interrupt
  bool still = false;     // the scene as it is, and no more
};

struct PlaylistOptions {
  std::string file;
  bool check = false;  // only say what is in it
};

struct ReplayOptions {
  std::string file;
  double speed = 1, from_s = 0;
  bool loop = false, step = false, keep = false;
};

// Which lights, and the layer that they are put into.
struct LightsOptions {
  std::optional<std::array<int, 3>> size;  // a box of them; else
  std::string layout;                      // a layout of Open Pixel Control; else the display's own
  std::string display;                     // empty: the first
  std::string layer = "lights";
};

struct InputOptions {
  lights::Protocol protocol = lights::Protocol::kOpc;
  LightsOptions lights;
  std::string listen;               // HOST:PORT
  int32_t first_universe = 1;       // E1.31, Art-Net
  int32_t universe_channels = 510;  // of each that are lights'; as above
  int32_t a_channel = 0;  // lights of a channel of Open Pixel Control; 0: as many as there are
  double gather_ms = 4;
  bool multicast = false;  // E1.31
};

struct MarkersOptions {
  std::string url;                  // ws://HOST:PORT
  std::vector<std::string> topics;  // empty: all that have a scene
  std::string layer = "markers";
};

struct AssetsOptions {
  std::vector<std::string> files;  // to upload; empty: what is there is listed
};

struct PipeOptions {
  LightsOptions lights;
  double fps = 0;  // 0: as they come
  bool keep = false;
};

// Names that begin so, for a shell that completes one.
struct CompleteOptions {
  std::string kind;
  std::string beginning;
};

// Manual pages, made by the parser, which knows what they are about.
struct ManualOptions {
  std::string folder;
  std::vector<std::pair<std::string, std::string>> pages;  // names of files, and what is in them
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
inline constexpr int kExitNoDevice = 3;  // of verify: nothing was verified
inline constexpr int kExitInterrupted = 130;

// Either what to do, or what to print and the code to end with (help, version, a usage error).
struct ParsedCommandLine {
  std::optional<Options> options;
  int exit_code = kExitOk;
  std::string out, err;
};

// `arguments` without the program's name. Global options may stand before the command or after it.
// A usage error says what was not understood, the nearest that would have been, and where help is.
ParsedCommandLine ParseCommandLine(const std::vector<std::string>& arguments);

}  // namespace voxeld::voxelctl
