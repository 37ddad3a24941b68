// Tests colours by numbers: of vertices, and along a direction for everything that has a place.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <span>
#include <string>
#include <utility>
#include <vector>

#include "daemon/wire/color_scale.h"
#include "tests/daemon/wire/curve_messages.h"

namespace voxeld::daemon::wire {
namespace {

using ::testing::ElementsAre;

using ScalesTest = CurvesTest;

v1::ColorScale BlackToRed() {
  v1::ColorScale scale;
  scale.add_colors(0x000000);
  scale.add_colors(0xFF0000);
  Set(scale.mutable_along(), 1, 0, 0);
  return scale;
}

TEST_F(ScalesTest, ScalesColorWhateverHasAPlace) {
  // From the least to the greatest x: the ends of spans have the colours of their places.
  for (P (*const make)() : {Arc, Ellipse, Helix, BezierSurface}) {
    P p = make();
    *p.mutable_color_scale() = BlackToRed();
    const GeometryData& data = Geometry(p);
    const std::span<const uint32_t> colors = data.arrays.colors();
    ASSERT_EQ(colors.size(), data.record.vertex_count);
    size_t least = 0, greatest = 0;
    for (size_t i = 0; i < colors.size(); ++i) {
      if (data.arrays.positions()[i * 3] < data.arrays.positions()[least * 3]) least = i;
      if (data.arrays.positions()[i * 3] > data.arrays.positions()[greatest * 3]) greatest = i;
    }
    EXPECT_EQ(colors[least], 0x000000u);
    EXPECT_EQ(colors[greatest], 0xFF0000u);
  }
}

TEST_F(ScalesTest, ScalesColorLettersOverTheWholeText) {
  P p = Text();
  p.mutable_text()->set_text("II");
  const GroupData& plain = Group(p);
  ASSERT_EQ(plain.parts.size(), 2u);
  EXPECT_EQ(plain.parts[0].geometry, plain.parts[1].geometry);
  *p.mutable_color_scale() = Scaled().color_scale();
  const GroupData colored = Group(p);
  ASSERT_EQ(colored.parts.size(), 2u);
  EXPECT_NE(colored.parts[0].geometry, colored.parts[1].geometry) << "each has its own place";
  // If nothing changes within a letter, it still has the number of its place.
  Set(p.mutable_color_scale()->mutable_along(), 0, 0, 1);
  EXPECT_EQ(Group(p).parts.size(), 2u);
  for (const v1::Text::Style style : {v1::Text::OUTLINE, v1::Text::STROKES}) {
    p.mutable_text()->set_style(style);
    const GeometryData& lines = Geometry(p);
    EXPECT_EQ(lines.arrays.colors().size(), lines.record.vertex_count);
  }
}

TEST_F(ScalesTest, LettersInTheirOwnColoursAreCountedBeforeTheyAreMade) {
  P p = Text();
  p.mutable_text()->set_text(std::string(1000, 'A'));
  uint64_t decoded = 0;
  const DecodeContext context{.limits = limits_, .fonts = &fonts_, .decoded_bytes = &decoded};
  const auto fault_of = [&](const P& primitive) {
    return ToContent(FieldPath("primitive"), primitive, context, &content_);
  };
  ASSERT_FALSE(fault_of(p).has_value());
  const uint64_t plain = decoded;
  *p.mutable_color_scale() = Scaled().color_scale();
  ASSERT_FALSE(fault_of(p).has_value());
  const uint64_t colored = decoded - plain;
  EXPECT_GT(colored, 1000 * sizeof(ScaleTable));
  EXPECT_LT(plain, colored / 10) << "plain ones share one letter";
  // About as much as was estimated for them.
  decoded = 0;
  limits_.max_uncommitted_bytes = colored * 19 / 20;
  const MaybeFault fault = fault_of(p);
  ASSERT_TRUE(fault.has_value());
  EXPECT_EQ(fault->field, "primitive.text.text");
  EXPECT_EQ(fault->reason, Reason::kQuotaExceeded);
  EXPECT_THAT(fault->message, ::testing::HasSubstr("makes 1000 letters in colours of their own"));
  EXPECT_EQ(decoded, 0u);
  limits_.max_uncommitted_bytes = colored * 21 / 20;
  EXPECT_FALSE(fault_of(p).has_value());
}

TEST_F(ScalesTest, ScalesAreForWhatCanHaveThem) {
  P arc = Arc();
  *arc.mutable_color_scale() = Scaled().color_scale();
  arc.mutable_color_scale()->clear_along();
  arc.mutable_color_scale()->set_scalars(Packed<float>({1, 2}));
  P volume;
  volume.mutable_volume();
  *volume.mutable_color_scale() = Scaled().color_scale();
  const std::pair<P, const char*> cases[] = {{arc, "primitive.color_scale.scalars"},
                                             {volume, "primitive.color_scale"}};
  for (const auto& [p, field] : cases) {
    Content content;
    const MaybeFault fault = FaultOf(p, &content);
    ASSERT_TRUE(fault.has_value());
    EXPECT_EQ(fault->field, field);
  }
}

TEST_F(ScalesTest, ScalesColorVertices) {
  P p = Scaled();
  p.mutable_color_scale()->clear_colormap();
  for (const uint32_t color : {0x000000, 0x0000FF, 0xFF0000})
    p.mutable_color_scale()->add_colors(color);
  const auto colors = [&] {
    const GeometryData& data = Geometry(p);
    return std::vector(data.arrays.colors().begin(), data.arrays.colors().end());
  };
  EXPECT_THAT(colors(), ElementsAre(0x000000, 0x0100FE, 0xFF0000))
      << "from the least to the greatest";
  Set(p.mutable_color_scale()->mutable_along(), 4, 0, 0);
  p.mutable_color_scale()->set_high(1);
  EXPECT_THAT(colors(), ElementsAre(0x000000, 0x000080, 0x0100FE)) << "x / 4 from 0 to 1";
  p.mutable_color_scale()->clear_along();
  p.mutable_color_scale()->set_scalars(Packed<float>({2, -1, 0}));
  EXPECT_THAT(colors(), ElementsAre(0xFF0000, 0x000000, 0x000000)) << "clamped";
}

TEST_F(ScalesTest, ScalesBeyondAllNumbersAreRefusedOrPlain) {
  P p = Scaled();
  Set(p.mutable_color_scale()->mutable_along(), 1e-150, 0, 0);
  EXPECT_EQ(Geometry(p).arrays.colors().size(), 3u);
  Set(p.mutable_color_scale()->mutable_along(), 0, 0, 1);  // all are at 0
  const GeometryData& data = Geometry(p);                  // until the next one
  EXPECT_EQ(data.arrays.colors()[2], data.arrays.colors()[0]);
}

TEST_F(ScalesTest, ScalesColorShapes) {
  P p = Torus();
  *p.mutable_color_scale() = Scaled().color_scale();
  const uint32_t plain = Geometry(Torus()).record.index_count;
  EXPECT_GT(Geometry(p).record.index_count, plain + 256) << "the program has a table";
  p.mutable_torus()->set_fill(v1::FILL_LINES);
  const GeometryData& lines = Geometry(p);
  EXPECT_EQ(lines.arrays.colors().size(), lines.record.vertex_count) << "and so have its lines";
  P sphere;
  sphere.mutable_sphere()->set_radius(2);
  *sphere.mutable_color_scale() = Scaled().color_scale();
  EXPECT_EQ(Geometry(sphere).record.kind, gpu::PrimitiveKind::kImplicit);
  EXPECT_GT(Geometry(sphere).record.index_count, 256u);
}

}  // namespace
}  // namespace voxeld::daemon::wire
