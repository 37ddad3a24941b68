// A display's options, as configuration files and command lines state them: "key=value".
#pragma once

#include <cstdint>
#include <initializer_list>
#include <map>
#include <set>
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

// Reads options one by one and remembers the first error and the keys asked for; the getters then
// give their defaults, so that a reader need not check each. Lists have ';' between values.
class OptionReader {
 public:
  explicit OptionReader(const DisplayOptions& options) : options_(options) {}

  std::string Text(const std::string& key, const std::string& fallback);
  int64_t Integer(const std::string& key, int64_t fallback, int64_t least, int64_t most);
  double Number(const std::string& key, double fallback, double least, double most);
  bool Flag(const std::string& key, bool fallback);  // true, false
  // The index of the value in `choices`.
  size_t Choice(const std::string& key, std::initializer_list<std::string_view> choices,
                size_t fallback);
  // Finite numbers within ±1e6.
  std::vector<double> Numbers(const std::string& key);
  // "128x128x64": at least `least` and at most `most` numbers, each from 1 to 16384.
  std::vector<int32_t> Size(const std::string& key, std::vector<int32_t> fallback, size_t least,
                            size_t most);
  bool has(const std::string& key) const { return options_.options.contains(key); }

  // An error about `key` found by the caller.
  void Refuse(const std::string& key, std::string_view right);

  // The first error; else InvalidArgument for a key that nobody asked for; else OK.
  absl::Status Finish() const;

 private:
  const std::string* Find(const std::string& key);

  const DisplayOptions& options_;
  std::set<std::string> known_;
  absl::Status status_;
};

// Everything of DisplayInfo but name and driver:
//   geometry=planar|rotor   planar
//   size=WxHxS              planar: pixels by slices, 128x128x128; rotor: WxH pixels a panel,
//                           128x128
//   pitch_mm=P              distance of pixels, 1
// planar:
//   normal=z|y              z
//   slice_pitch_mm=P        distance of slices, pitch_mm
//   positions_mm=A;B;…      of slices, ascending, instead of slice_pitch_mm
// rotor:
//   slices=N                slices a turn, 360
//   eccentricity=E;…        of each panel, in pitches, 0 (one panel)
//   panel_phase=T;…         turns, of each panel, 0
//   shift_u=U;… shift_v=V;… of each panel's middle, in pitches, 0
//   clockwise=true|false    false
// both:
//   mirror_u= mirror_v=     true|false, false
//   format=rgb888|rgb332|bitplanes3, sub_frames=1…64, rate=volumes/s (30; a rotor with n panels
//     still counts turns), gamma=1, brightness=0…1 (1), dither=none|ordered (ordered),
//     sampling=max|weighted (max)
absl::StatusOr<DisplayInfo> ReadDisplayInfo(const DisplayOptions& options, OptionReader& reader);

// lut[0] = 0, lut[255] = 65535·brightness; between, 65535·brightness·(c/255)^gamma, rounded, at
// least 1 (so that what is lit is never quite dark). gamma > 0, brightness in (0, 1].
Tone MakeTone(double gamma, double brightness, Dither dither, Sampling sampling);

}  // namespace voxeld::display
