// A display's options, as written in configuration files and on command lines: "key=value".
#pragma once

#include <array>
#include <cstdint>
#include <initializer_list>
#include <map>
#include <set>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "display/api/display.h"
#include "display/api/geometry.h"
#include "display/api/slice_frame.h"

namespace voxeld::display {

struct DisplayOptions {
  std::string name;    // unique in the daemon
  std::string driver;  // one of DriverNames() (registry.h)
  std::map<std::string, std::string> options;
};

// Reads options one by one, and remembers the first error and the requested keys; after an error
// the getters return their defaults, so that the caller need not check each. Lists have ';' between
// values.
class OptionReader {
 public:
  explicit OptionReader(const DisplayOptions& options) : options_(options) {}

  std::string Text(const std::string& key, const std::string& fallback);
  int64_t Integer(const std::string& key, int64_t fallback, int64_t least, int64_t most);
  double Number(const std::string& key, double fallback, double least, double most);
  bool Flag(const std::string& key, bool fallback);  // true, false
  // Returns one flag for all `count`, or one each; false if the option is not given.
  std::vector<bool> Flags(const std::string& key, size_t count);
  // Returns the index of the value in `choices`.
  size_t Choice(const std::string& key, std::span<const std::string_view> choices, size_t fallback);
  size_t Choice(const std::string& key, std::initializer_list<std::string_view> choices,
                size_t fallback) {
    return Choice(key, std::span(choices.begin(), choices.size()), fallback);
  }
  // Returns finite numbers within ±1e6.
  std::vector<double> Numbers(const std::string& key);
  // Parses "128x128x64": at least `least` and at most `most` numbers, each from 1 to 16384.
  std::vector<int32_t> Size(const std::string& key, std::vector<int32_t> fallback, size_t least,
                            size_t most);
  bool has(const std::string& key) const { return options_.options.contains(key); }

  // Records an error about `key` that the caller found.
  void Refuse(const std::string& key, std::string_view right);

  // Returns the first error; else InvalidArgument for a key that was never requested; else OK.
  absl::Status Finish() const;

 private:
  const std::string* Find(const std::string& key);

  const DisplayOptions& options_;
  std::set<std::string> known_;
  absl::Status status_;
};

// Reads everything in DisplayInfo except name and driver:
//   geometry=planar|rotor|helix|lattice   planar
//   size=WxHxS              planar: pixels by slices, 128x128x128; rotor: WxH pixels per panel,
//                           128x128
//   pitch_mm=P              distance between pixels, 1
// planar:
//   normal=z|y              z
//   slice_pitch_mm=P        distance between slices, pitch_mm
//   positions_mm=A;B;…      of slices, in the order of sending, instead of slice_pitch_mm
//   motion=stepped|sawtooth|sine   stepped: slice_pitch_mm apart; else evenly in time along
//   travel_mm=L             from end to end of a stroke, slices·slice_pitch_mm
//   dead_begin= dead_end=   shares of a stroke's time at its ends in which nothing is lit, 0
//   strokes=up|down|both    up; both: S slices up, and S down
// rotor:
//   slices=N                slices per turn, 360
//   eccentricity=E;…        of each panel, in pitches, 0 (one panel)
//   panel_phase=T;…         turns, of each panel, 0
//   shift_u=U;… shift_v=V;… of each panel's middle, in pitches, 0
//   tilt=D;…                degrees, of each panel about its u axis, 0
//   panel_pitch_u_mm=P;… panel_pitch_v_mm=P;…   of each panel, pitch_mm
//   clockwise=true|false    false
// helix:
//   size=WxH                of the slice image, 128x128
//   slices=N                per turn, 180
//   blades=N span=T         blades, and how much of a turn each spans: 1, 1/blades
//   travel_mm=H             height of a blade, twice radius_mm
//   radius_mm=R hub_mm=R    of the blades: half of the slice image, 0
//   phase=T left_handed= clockwise=   0, false, false
// lattice:
//   size=XxYxZ              lights in rows, one slice per layer, 8x8x8
//   points_mm=x;y;z;… width=N   instead: position of each light; N lights per slice, 64
//   cell_mm=L               the size of the box that a light represents, pitch_mm
// all, as measured:
//   keystone_mm=U;V;…       places of the corners (−u −v), (+u −v), (+u +v), (−u +v) of the slice
//                           images, once or for each slice; planar and helix
//   affine=…                12 numbers, three rows of four: nominal to true places, mm
//   displacement_size=XxYxZ displacement_low_mm=x;y;z displacement_high_mm=x;y;z
//   displacement_mm=x;y;z;…   in addition, at places of a grid, x fastest
// all shapes:
//   mirror_u= mirror_v=     true|false, false; for a rotor one for all panels or one each
//   voxel_mm=P | x;y;z      pitch of the voxels, instead of the shape's default (DefaultGrid)
//   format=rgb888|rgb332|bitplanes|hub75|planes24   rgb888
//   bits=1…8                per channel; rgb888 8, bitplanes and hub75 1
//   sub_frames=1…64         1
//   rate=volumes/s          30; a rotor with n panels still counts turns
//   gamma=G | r;g;b         1
//   white=r;g;b             light of full red, green and blue, 1;1;1
//   brightness=0…1          1
//   curve_red= curve_green= curve_blue=A;B;…   light, 0 to 1, at even steps of the channel from black to full, linear between,
//                           instead of gamma; 2 to 256 values, the first 0, ascending
//   dither=none|ordered|blue   ordered
//   sampling=max|weighted   max
//   density=full|even       full; even: crowded pixels are dimmed
absl::StatusOr<DisplayInfo> ReadDisplayInfo(const DisplayOptions& options, OptionReader& reader);

// How colours become light.
struct ToneOptions {
  std::array<double, 3> gamma{1, 1, 1};       // > 0
  std::array<double, 3> white{1, 1, 1};       // (0, 1]
  std::array<std::vector<double>, 3> curves;  // if not empty, used instead of gamma
  double brightness = 1;                      // (0, 1]
  Dither dither = Dither::kOrdered;
  Sampling sampling = Sampling::kMax;
  Density density = Density::kFull;
};

// Reads the options gamma to density, as listed at ReadDisplayInfo.
ToneOptions ReadTone(OptionReader& reader);

// Returns for each channel lut[0] = 0, lut[255] = 65535·white·brightness; in between, that times
// (c/255)^gamma or the curve at c/255, rounded, at least 1 (so that a lit voxel is never completely
// dark).
Tone MakeTone(const ToneOptions& options);

}  // namespace voxeld::display
