// Tests pictures on meshes and height maps: the errors for wrong ones, and the results for valid
// ones.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <bit>
#include <limits>
#include <string>
#include <vector>

#include "daemon/wire/encode_primitive.h"
#include "daemon/wire/primitive.h"
#include "gpu/primitives/texture.h"
#include "tests/daemon/pictures/files.h"
#include "tests/daemon/wire/faults.h"
#include "tests/daemon/wire/requests.h"
#include "voxeld/v1/primitives.pb.h"

namespace voxeld::daemon::wire {
namespace texture_test {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using P = v1::Primitive;

const std::vector<uint32_t> kPixels = {0xFF0000, 0x00FF00, 0x0000FF, 0x202020};

MaybeFault FaultOf(const P& primitive, Content* content, const Limits& limits = {}) {
  return ToContent(FieldPath("primitive"), primitive, {limits}, content);
}

P Mesh() {
  P p;
  *p.mutable_mesh()->mutable_vertices() = Triangle();
  v1::Texture* const texture = p.mutable_mesh()->mutable_texture();
  texture->set_picture(pictures::PngOf(2, 2, kPixels));
  texture->set_coordinates(Packed<float>({0, 0, 1, 0, 0, 1}));
  return p;
}
P Map() {
  P p;
  v1::HeightMap* const map = p.mutable_height_map();
  Set(map->mutable_edge_a(), 2, 0, 0);
  Set(map->mutable_edge_b(), 0, 4, 0);
  map->set_columns(3);
  map->set_rows(2);
  map->set_heights(Packed<float>({0, 1, 2, 3, 4, -5}));
  map->set_picture(pictures::PngOf(2, 2, kPixels));
  return p;
}
v1::Texture& Texture(P& p) { return *p.mutable_mesh()->mutable_texture(); }

const FaultCase kCases[] = {
    {"none", Mesh, [](P& p) { Texture(p).clear_picture(); }, "primitive.mesh.texture.picture",
     Reason::kInvalidValue, "is neither a PNG nor a JPEG file; give"},
    {"broken", Mesh, [](P& p) { Texture(p).mutable_picture()->resize(50); },
     "primitive.mesh.texture.picture", Reason::kInvalidValue, "begins as a PNG file does, but"},
    {"few", Mesh, [](P& p) { Texture(p).mutable_coordinates()->pop_back(); },
     "primitive.mesh.texture.coordinates", Reason::kSizeMismatch,
     "has 23 bytes; two F32 of each of 3 vertices take 24"},
    {"infinite", Mesh,
     [](P& p) {
       Texture(p).set_coordinates(
           Packed<float>({0, 0, 1, std::numeric_limits<float>::infinity(), 0, 1}));
     },
     "primitive.mesh.texture.coordinates[1]", Reason::kInvalidValue, "has inf"},
    {"solid", Mesh, [](P& p) { p.mutable_mesh()->set_fill(v1::FILL_SOLID); },
     "primitive.mesh.texture", Reason::kInvalidValue, "only a surface takes one"},
    {"lines", Mesh, [](P& p) { p.mutable_mesh()->set_fill(v1::FILL_LINES); },
     "primitive.mesh.texture", Reason::kInvalidValue, "only a surface takes one"},
    {"map_none", Map, [](P& p) { p.mutable_height_map()->set_picture("GIF89a"); },
     "primitive.height_map.picture", Reason::kInvalidValue, "is neither"},
    {"map_dots", Map, [](P& p) { p.mutable_height_map()->set_fill(v1::FILL_DOTS); },
     "primitive.height_map.picture", Reason::kInvalidValue, "only a surface takes one"},
};

TEST(TextureFaults, NameTheFieldTheValueAndWhatIsRight) {
  ExpectFaults(kCases, [](const P& p, Content* content) { return FaultOf(p, content); });
}

TEST(TextureFaults, AreTheLimitsToo) {
  Content content;
  EXPECT_FALSE(FaultOf(Mesh(), &content, {.max_texture_texels = 4}).has_value());
  MaybeFault fault = FaultOf(Mesh(), &content, {.max_texture_texels = 3});
  ASSERT_TRUE(fault.has_value());
  EXPECT_EQ(fault->reason, Reason::kQuotaExceeded);
  EXPECT_EQ(
      fault->message,
      "is a picture of 2 × 2; max_texture_texels allows 3 in all, and a side has 8192 at most");
  P wide = Mesh();
  Texture(wide).set_picture(pictures::PngOf(8193, 1, std::vector<uint32_t>(8193)));
  fault = FaultOf(wide, &content);
  ASSERT_TRUE(fault.has_value());
  EXPECT_EQ(fault->reason, Reason::kQuotaExceeded);
  EXPECT_THAT(fault->message, HasSubstr("is a picture of 8193 × 1; "));
}

// Returns the result of decoding it, which must be sound.
GeometryPtr Decoded(const P& p) {
  Content content;
  const MaybeFault fault = FaultOf(p, &content);
  EXPECT_FALSE(fault.has_value()) << fault->field << " " << fault->message;
  return fault.has_value() ? nullptr : std::get<GeometryPtr>(content);
}
std::vector<float> PlacesOf(const GeometryData& data, size_t colors) {
  std::vector<float> places;
  for (size_t i = 0; i < size_t{2} * data.record.vertex_count; ++i) {
    places.push_back(std::bit_cast<float>(data.arrays.colors()[colors + i]));
  }
  return places;
}
std::vector<uint32_t> TexelsOf(const GeometryData& data, size_t colors) {
  const auto texels = data.arrays.colors().subspan(colors + size_t{2} * data.record.vertex_count);
  return {texels.begin(), texels.end()};
}

TEST(Texture, LiesBehindTheColoursWithItsLevels) {
  P p = Mesh();
  p.mutable_color()->set_rgb(0x112233);
  GeometryPtr data = Decoded(p);
  ASSERT_TRUE(data != nullptr);
  EXPECT_EQ(data->record.texture_width, 2);
  EXPECT_EQ(data->record.texture_height, 2);
  EXPECT_EQ(data->record.color, 0x112233u);
  EXPECT_EQ(data->arrays.colors().size(), gpu::ColorCount(data->record));
  EXPECT_THAT(PlacesOf(*data, 0), ElementsAre(0, 0, 1, 0, 0, 1));
  EXPECT_THAT(TexelsOf(*data, 0), ElementsAre(0xFF0000, 0x00FF00, 0x0000FF, 0x202020, 0x484848));

  v1::Vertices* const vertices = p.mutable_mesh()->mutable_vertices();
  vertices->set_color_type(v1::ELEMENT_TYPE_RGB8);
  vertices->set_colors("abcdefghi");
  data = Decoded(p);
  ASSERT_TRUE(data != nullptr);
  EXPECT_EQ(data->arrays.colors()[0], 0x616263u);
  EXPECT_THAT(PlacesOf(*data, 3), ElementsAre(0, 0, 1, 0, 0, 1));
}

TEST(Texture, MultipliesAScalesColours) {
  P p = Mesh();
  p.mutable_color_scale()->set_colormap("viridis");
  Set(p.mutable_color_scale()->mutable_along(), 1, 0, 0);
  const GeometryPtr data = Decoded(p);
  ASSERT_TRUE(data != nullptr);
  EXPECT_EQ(data->record.color_mode, gpu::ColorMode::kPerVertex);
  EXPECT_THAT(PlacesOf(*data, 3), ElementsAre(0, 0, 1, 0, 0, 1));
}

TEST(Texture, OfAHeightMapGoesFromEdgeToEdge) {
  const GeometryPtr data = Decoded(Map());
  ASSERT_TRUE(data != nullptr);
  EXPECT_THAT(PlacesOf(*data, 0), ElementsAre(0, 0, 0.5, 0, 1, 0, 0, 1, 0.5, 1, 1, 1));
  EXPECT_EQ(TexelsOf(*data, 0)[1], 0x00FF00u);
}

TEST(Texture, IsGivenBackAsItWasSent) {
  for (const P& p : {Mesh(), Map()}) {
    const GeometryPtr data = Decoded(p);
    ASSERT_TRUE(data != nullptr);
    P back;
    Encode(data, &back);
    const GeometryPtr again = Decoded(back);
    ASSERT_TRUE(again != nullptr);
    EXPECT_THAT(again->arrays.colors(), ::testing::ElementsAreArray(data->arrays.colors()));
    EXPECT_THAT(again->arrays.positions(), ::testing::ElementsAreArray(data->arrays.positions()));
    EXPECT_EQ(back.mesh().texture().picture(), p.mesh().texture().picture());
    EXPECT_EQ(back.height_map().picture(), p.height_map().picture());
  }
}

}  // namespace texture_test
}  // namespace voxeld::daemon::wire
