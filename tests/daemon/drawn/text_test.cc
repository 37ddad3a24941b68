// Compares letters with the outlines in their fonts, in double precision: as solids, which contain
// what the outlines contain by the even-odd rule, from the front to the back; flat; and as lines.
// The fonts are those of the tests' machines (fonts-dejavu-core).
#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "daemon/text/stroke_font.h"
#include "gpu/curves/cut.h"
#include "tests/daemon/drawn/drawn.h"

namespace voxeld::daemon::drawn {
namespace text_test {

constexpr int32_t kSize = 64;
constexpr double kScale = 4;
constexpr double kHeight = 7.5;  // of capital letters, in units
constexpr const char* kText = "g8\xC3\x85";
// The curves of letters are cut into pieces that are at most this far from them, in capital
// heights.
constexpr double kFlatness = 1.0 / 1500;

struct Point {
  double x, y;
};
using Ring = std::vector<Point>;

Point BezierAt(const text::OutlinePoint* p, double t) {
  const double s = 1 - t, w[] = {s * s * s, 3 * s * s * t, 3 * s * t * t, t * t * t};
  Point at = {0, 0};
  for (int i = 0; i < 4; ++i) at = {at.x + w[i] * p[i].x, at.y + w[i] * p[i].y};
  return at;
}

// A letter, in capital heights, at its place in the text.
struct Letter {
  std::vector<Ring> rings;

  // Returns the distance from the outline, and sets whether the point is within it.
  double Distance(const Point& p, bool* inside) const {
    double square = 1e9;
    *inside = false;
    for (const Ring& ring : rings) {
      for (size_t i = 0; i < ring.size(); ++i) {
        const Point& a = ring[i];
        const Point& b = ring[(i + 1) % ring.size()];
        const double dx = b.x - a.x, dy = b.y - a.y, length2 = dx * dx + dy * dy;
        if (length2 == 0) continue;
        const double t = std::clamp(((p.x - a.x) * dx + (p.y - a.y) * dy) / length2, 0.0, 1.0);
        const double u = p.x - a.x - t * dx, v = p.y - a.y - t * dy;
        square = std::min(square, u * u + v * v);
        // Counts the edges that a ray upwards meets.
        if ((a.x > p.x) != (b.x > p.x) && a.y + (p.x - a.x) / dx * dy > p.y) *inside = !*inside;
      }
    }
    return std::sqrt(square);
  }
};

class DrawnText : public DrawnPrimitives {
 protected:
  DrawnText() : DrawnPrimitives(kSize) {
    const absl::StatusOr<text::LaidOut> laid = fonts_.Lay(kText, {});
    EXPECT_TRUE(laid.ok()) << laid.status();
    for (const text::PlacedGlyph& placed : laid->glyphs) {
      Letter& letter = letters_.emplace_back();
      for (const text::Contour& contour : placed.glyph->contours) {
        Ring& ring = letter.rings.emplace_back();
        for (size_t i = 0; i + 4 <= contour.size(); i += 4) {
          for (int k = 0; k < kPieces; ++k) {
            const Point p = BezierAt(&contour[i], k / double{kPieces});
            ring.push_back({placed.x + p.x, placed.y + p.y});
          }
        }
      }
    }
    EXPECT_EQ(letters_.size(), 3u);
  }

  static P Text() {
    P p;
    v1::Text* const text = p.mutable_text();
    text->set_text(kText);
    text->set_height(kHeight);
    Set(text->mutable_position(), kPosition);
    Set(text->mutable_facing(), kFacing);
    Set(text->mutable_up(), kUp);
    return p;
  }
  // Maps a place in units to capital heights: x along the line, y up, z to the reader.
  static Vector InText(const Vector& p) {
    const Vector z = Unit(kFacing);
    const Vector y = Unit(kUp - gpu::implicit::Dot(kUp, z) * z), x = gpu::implicit::Cross(y, z);
    const Vector d = 1 / kHeight * (p - kPosition);
    return {gpu::implicit::Dot(d, x), gpu::implicit::Dot(d, y), gpu::implicit::Dot(d, z)};
  }
  static Vector FromText(const Point& p) {
    const Vector z = Unit(kFacing);
    const Vector y = Unit(kUp - gpu::implicit::Dot(kUp, z) * z), x = gpu::implicit::Cross(y, z);
    return kPosition + kHeight * (p.x * x + p.y * y);
  }
  // Checks that the letters lie between two depths, towards the reader, in voxels.
  void ExpectBetween(const Drawn& drawn, double back, double front) const {
    constexpr double kVoxel = 1 / (kHeight * kScale);  // in capital heights
    constexpr double kDoubt = kFlatness + kSnapped * kVoxel;
    uint64_t lit = 0, judged = 0, wrong = 0;
    drawn.ForEach([&](int32_t x, int32_t y, int32_t z) {
      const Vector p = InText(placed_.Back(x, y, z));
      lit += drawn.Lit(x, y, z);
      const double beyond = std::max(back * kVoxel - p.z, p.z - front * kVoxel);
      if (std::fabs(beyond) < kDoubt) return;
      bool want = false, doubtful = false;
      for (const Letter& letter : letters_) {
        if (beyond > 0) break;
        bool inside;
        doubtful = doubtful || letter.Distance({p.x, p.y}, &inside) < kDoubt;
        want = want || inside;
      }
      if (doubtful) return;
      ++judged;
      wrong += drawn.Lit(x, y, z) != want;
    });
    EXPECT_GT(lit, 1000u);
    EXPECT_GT(judged, uint64_t{kSize} * kSize * kSize * 9 / 10);
    EXPECT_EQ(wrong, 0u);
  }

  static constexpr int kPieces = 16;
  static constexpr Vector kPosition = {-6.5, -2, -1}, kFacing = {0.2, -0.5, 2}, kUp = {0.3, 1, 0};
  const Placement placed_ = Placed(0.3, kScale, kSize / 2, 0.2);
  std::vector<Letter> letters_;
};

TEST_F(DrawnText, SolidLettersHoldWhatTheirOutlinesDo) {
  P p = Text();
  p.mutable_text()->set_depth(1.3);
  ExpectBetween(Draw(p, placed_.map), -1.3 * kScale, 0);
}

TEST_F(DrawnText, FlatLettersAreAsThickAsTheyAreSaidToBe) {
  P p = Text();
  p.mutable_text()->mutable_thickness()->set_value(3);
  ExpectBetween(Draw(p, placed_.map), -1.5, 1.5);
}

TEST_F(DrawnText, OutlinesAreWithinTheirRadius) {
  constexpr double kRadius = 1.25;
  P p = Text();
  p.mutable_text()->set_style(v1::Text::OUTLINE);
  p.mutable_text()->mutable_thickness()->set_value(2 * kRadius);
  const Drawn drawn = Draw(p, placed_.map);
  Distances distances(kSize, kRadius + 0.5);
  for (const Letter& letter : letters_) {
    for (const Ring& ring : letter.rings) {
      for (size_t i = 0; i < ring.size(); ++i) {
        const Point& a = ring[i];
        const Point& b = ring[(i + 1) % ring.size()];
        for (int k = 0; k < kPieces; ++k) {
          const double t = k / double{kPieces};
          distances.Add(placed_.Forth(FromText({a.x + t * (b.x - a.x), a.y + t * (b.y - a.y)})));
        }
      }
    }
  }
  // A sixteenth of a piece of an outline is at most a tenth of a voxel here.
  constexpr double kError = gpu::kCurveError + kSnapped + 0.01;
  uint64_t lit = 0, far = 0, missing = 0;
  drawn.ForEach([&](int32_t x, int32_t y, int32_t z) {
    const double d = distances.At(x, y, z);
    lit += drawn.Lit(x, y, z);
    far += drawn.Lit(x, y, z) && d > kRadius + kError;
    missing += !drawn.Lit(x, y, z) && d < kRadius - kError;
  });
  EXPECT_GT(lit, 1000u);
  EXPECT_EQ(far, 0u);
  EXPECT_EQ(missing, 0u);
}

TEST_F(DrawnText, StrokesAreWithinTheirRadius) {
  constexpr double kRadius = 1.4;
  constexpr const char* kAscii = "Rq";
  P p = Text();
  p.mutable_text()->set_text(kAscii);
  p.mutable_text()->set_style(v1::Text::STROKES);
  p.mutable_text()->set_font("futural");
  p.mutable_text()->mutable_thickness()->set_value(2 * kRadius);
  const Drawn drawn = Draw(p, placed_.map);
  const absl::StatusOr<text::StrokeFont> font = text::StrokeFont::Load("futural");
  ASSERT_TRUE(font.ok()) << font.status();
  const text::StrokeFont::Line line = font->Lay(kAscii);
  ASSERT_GT(line.strokes.size(), 3u);
  Distances distances(kSize, kRadius + 0.5);
  for (const text::Stroke& stroke : line.strokes) {
    for (size_t i = 0; i + 1 < stroke.size(); ++i) {
      for (int k = 0; k <= 1000; ++k) {
        const double t = k / 1000.0;
        distances.Add(
            placed_.Forth(FromText({(1 - t) * double{stroke[i].x} + t * double{stroke[i + 1].x},
                                    (1 - t) * double{stroke[i].y} + t * double{stroke[i + 1].y}})));
      }
    }
  }
  constexpr double kError = kSnapped + 0.01;
  uint64_t lit = 0, far = 0, missing = 0;
  drawn.ForEach([&](int32_t x, int32_t y, int32_t z) {
    const double d = distances.At(x, y, z);
    lit += drawn.Lit(x, y, z);
    far += drawn.Lit(x, y, z) && d > kRadius + kError;
    missing += !drawn.Lit(x, y, z) && d < kRadius - kError;
  });
  EXPECT_GT(lit, 500u);
  EXPECT_EQ(far, 0u);
  EXPECT_EQ(missing, 0u);
}

// From green to red along a direction that is not an axis of the text; each letter is coloured by
// its own place.
TEST_F(DrawnText, ColouredLettersHaveTheColoursOfTheirPlaces) {
  const Vector along{1, 0.5, -0.25};
  for (const double depth : {0.0, 1.3}) {
    P p = Text();
    p.mutable_text()->set_depth(depth);
    if (depth == 0) p.mutable_text()->mutable_thickness()->set_value(3);
    const Drawn plain = Draw(p, placed_.map);
    p.mutable_color_scale()->add_colors(0x00FF40);
    p.mutable_color_scale()->add_colors(0xFF0040);
    Set(p.mutable_color_scale()->mutable_along(), along);
    p.mutable_color_scale()->set_low(-5);
    p.mutable_color_scale()->set_high(6);
    const Drawn drawn = Draw(p, placed_.map);
    uint64_t lit = 0, otherwise = 0, wrong = 0;
    double least = 1, greatest = 0;
    drawn.ForEach([&](int32_t x, int32_t y, int32_t z) {
      otherwise += drawn.Lit(x, y, z) != plain.Lit(x, y, z);
      if (!drawn.Lit(x, y, z)) return;
      ++lit;
      const double number =
          gpu::implicit::Dot(placed_.Back(x, y, z), along) / gpu::implicit::Dot(along, along);
      const double level = std::clamp((number + 5) / 11, 0.0, 1.0);
      least = std::min(least, level);
      greatest = std::max(greatest, level);
      // One of 256 steps, and the rounding of colours.
      const uint32_t rgb = drawn.At(x, y, z);
      wrong += std::fabs(static_cast<double>(rgb >> 16) - 255 * level) > 1.6 ||
               std::fabs(static_cast<double>(rgb >> 8 & 255) - 255 * (1 - level)) > 1.6 ||
               (rgb & 255) != 0x40;
    });
    EXPECT_GT(lit, 1000u);
    EXPECT_LT(least, 0.2);
    EXPECT_GT(greatest, 0.8);
    EXPECT_EQ(otherwise, 0u);
    EXPECT_EQ(wrong, 0u) << "depth " << depth;
  }
}

}  // namespace text_test
}  // namespace voxeld::daemon::drawn
