// Text in any script as outlines: the system's fonts (fontconfig), their letters (FreeType), and how these
// follow one another (HarfBuzz, right-to-left by FriBidi).
//
// Lengths are in heights of a capital letter, x along the line, y upwards from its base line.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/statusor.h"
#include "daemon/text/stroke_font.h"

namespace voxeld::text {

struct OutlinePoint {
  double x = 0, y = 0;
};
// A closed curve: cubic Béziers, 4 points each, each from where the one before ends.
using Contour = std::vector<OutlinePoint>;

// A letter, or what a font makes of several; its origin at 0, 0.
struct Glyph {
  std::vector<Contour> contours;
};

struct PlacedGlyph {
  std::shared_ptr<const Glyph> glyph;  // the same for the same letter
  double x = 0, y = 0;
};

enum class Alignment : uint8_t { kLeft, kCenter, kRight };

struct Layout {
  std::string font;  // a family; empty: "sans"
  Alignment alignment = Alignment::kLeft;
  double line_spacing = 1;  // times the font's
  double width = 0;         // lines are broken between words so as not to be longer; 0: only at \n
  size_t most = 4096;       // characters
};

struct LaidOut {
  std::vector<PlacedGlyph> glyphs;
};

// Thread-safe.
class Fonts {
 public:
  Fonts();
  ~Fonts();
  Fonts(const Fonts&) = delete;
  Fonts& operator=(const Fonts&) = delete;

  // `utf8` is checked. InvalidArgument says which byte is wrong, or which character no font has; NotFound that there
  // is no font of that family, and which there are; ResourceExhausted that there are too many characters;
  // Unavailable that there are no fonts at all.
  absl::StatusOr<LaidOut> Lay(std::string_view utf8, const Layout& layout);

  // A stroke font by its name, as StrokeFont::Load, which is read once.
  absl::StatusOr<std::shared_ptr<const StrokeFont>> Strokes(const std::string& name);

 private:
  class Library;
  std::unique_ptr<Library> library_;
};

}  // namespace voxeld::text
