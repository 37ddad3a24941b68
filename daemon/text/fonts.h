// Converts text in any script to outlines, with the system's fonts (fontconfig), their glyphs
// (FreeType), shaping (HarfBuzz) and bidirectional layout (FriBidi).
//
// Lengths are in heights of a capital letter; x runs along the line, y upwards from the base line.
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
// A closed curve of cubic Béziers with 4 points each. Each begins where the previous one ends.
using Contour = std::vector<OutlinePoint>;

// The outline of a letter or ligature, with its origin at 0, 0.
struct Glyph {
  std::vector<Contour> contours;
};

struct PlacedGlyph {
  std::shared_ptr<const Glyph> glyph;  // shared by equal letters
  double x = 0, y = 0;
};

enum class Alignment : uint8_t { kLeft, kCenter, kRight };

struct Layout {
  std::string font;  // a family; empty: "sans"
  Alignment alignment = Alignment::kLeft;
  double line_spacing = 1;  // factor of the font's spacing
  double width = 0;         // lines are broken between words to fit; 0: only at \n
  size_t most = 4096;       // limit on characters
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

  // Lays out the text. Checks `utf8`. Errors: InvalidArgument with the invalid byte, or with the
  // character that no font has; NotFound if the family does not exist, with the existing ones;
  // ResourceExhausted if there are too many characters; Unavailable if there are no fonts at all.
  absl::StatusOr<LaidOut> Lay(std::string_view utf8, const Layout& layout);

  // Returns: the stroke font of this name, as StrokeFont::Load, which is called once per name.
  absl::StatusOr<std::shared_ptr<const StrokeFont>> Strokes(const std::string& name);

 private:
  class Library;
  std::unique_ptr<Library> library_;
};

}  // namespace voxeld::text
