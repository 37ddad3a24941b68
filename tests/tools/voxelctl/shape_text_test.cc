// Tests shapes as typed by a user.
#include "tools/voxelctl/shape/shape_text.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstring>
#include <set>
#include <string>
#include <vector>

#include "absl/strings/str_split.h"
#include "tests/tools/voxelctl/temp_folder.h"
#include "tools/voxelctl/shape/as_typed.h"
#include "tools/voxelctl/shape/drawing.h"
#include "tools/voxelctl/shape/examples.h"

namespace voxeld::voxelctl {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

v1::Entity Parsed(const std::string& text) {
  const absl::StatusOr<v1::Entity> entity = ParseShapeText(text);
  EXPECT_TRUE(entity.ok()) << text << ": " << entity.status();
  return entity.value_or(v1::Entity());
}
std::string ErrorOf(const std::string& text) {
  return std::string(ParseShapeText(text).status().message());
}

TEST(ShapeText, FieldsOfEveryTypeComeThrough) {
  const v1::Entity entity = Parsed(
      "cone start=0,0,-1 end=0,1,2 start_radius=0.5 round_ends=true fill=solid rule=cover "
      "shell=0.1u color=#102030 "
      "priority=7 erase=true lifetime=1.5 label='two words'");
  const v1::Cone& cone = entity.primitive().cone();
  EXPECT_EQ(cone.start().z(), -1);
  EXPECT_EQ(cone.end().y(), 1);
  EXPECT_EQ(cone.start_radius(), 0.5);
  EXPECT_TRUE(cone.round_ends());
  EXPECT_EQ(cone.fill(), v1::FILL_SOLID);
  EXPECT_EQ(cone.rule(), v1::SURFACE_RULE_COVER);
  EXPECT_FLOAT_EQ(cone.shell().value(), 0.1f);
  EXPECT_EQ(cone.shell().unit(), v1::Thickness::UNITS);
  EXPECT_EQ(entity.primitive().color().rgb(), 0x102030u);
  EXPECT_EQ(entity.priority(), 7u);
  EXPECT_TRUE(entity.erase());
  EXPECT_EQ(entity.lifetime_ns(), 1'500'000'000);
  EXPECT_EQ(entity.label(), "two words");
  const v1::Entity lines = Parsed("segments vertices='0,0,0 1,2,3' topology=strip thickness=3");
  float positions[6];
  ASSERT_EQ(lines.primitive().segments().vertices().positions().size(), sizeof(positions));
  std::memcpy(positions, lines.primitive().segments().vertices().positions().data(),
              sizeof(positions));
  EXPECT_THAT(positions, ElementsAre(0, 0, 0, 1, 2, 3));
  EXPECT_EQ(lines.primitive().segments().topology(), v1::Segments::STRIP);
  EXPECT_EQ(lines.primitive().segments().thickness().unit(), v1::Thickness::VOXELS);
  const v1::HeightMap map =
      Parsed("height_map columns=2 rows=2 heights=0,1,2,3 colors='red #102030 white black'")
          .primitive()
          .height_map();
  EXPECT_EQ(map.heights().size(), 16u);
  EXPECT_EQ(map.colors().substr(0, 6), std::string("\xFF\0\0\x10\x20\x30", 6));
  EXPECT_EQ(Parsed("box size=2").primitive().box().size().z(), 2);
  const v1::Entity shape = Parsed(
      "implicit surface=\"x <= r\" parameter_names=r parameter_values=3 domain=-1,-1,-1:1,2,3 "
      "boundary=0,0,0,1,0,0,0,1,0 level=z colormap=jet");
  EXPECT_EQ(shape.primitive().implicit().surface().text(), "x <= r");
  EXPECT_THAT(shape.primitive().implicit().parameter_values(), ElementsAre(3));
  EXPECT_EQ(shape.primitive().implicit().domain().max().z(), 3);
  EXPECT_EQ(shape.primitive().implicit().boundary().points_size(), 9);
  const v1::Primitive volume =
      Parsed(
          "volume grid.size_a=2 grid.samples=1,2 grid.edge_b=0,3,0 grid.filter=nearest "
          "transfer.values=0,1 transfer.colors='red blue'")
          .primitive();
  EXPECT_EQ(volume.volume().grid().size_a(), 2u);
  EXPECT_EQ(volume.volume().grid().samples().size(), 8u);
  EXPECT_EQ(volume.volume().grid().edge_b().y(), 3);
  EXPECT_EQ(volume.volume().grid().filter(), v1::Grid::NEAREST);
  EXPECT_THAT(volume.volume().transfer().colors(), ElementsAre(0xFF0000, 0x0000FF));
  const v1::Primitive scaled =
      Parsed("torus radius=1 tube_radius=0.2 color_scale.along=0,0,1 color_scale.colormap=jet")
          .primitive();
  EXPECT_EQ(scaled.color_scale().along().z(), 1);
  EXPECT_EQ(scaled.color_scale().colormap(), "jet");
  EXPECT_EQ(Parsed("instance object=o tint=red").primitive().instance().tint().rgb(), 0xFF0000u);
  EXPECT_EQ(Parsed("text text='a\\nb' height=1").primitive().text().text(), "a\nb");
}

TEST(ShapeText, ShapesArePlaced) {
  const v1::Entity entity = Parsed("sphere radius=1 at=1,2,3 scale=2,1,1 turn=0,0,90");
  // x, doubled, is mapped to y.
  EXPECT_NEAR(entity.transform().m(0), 0, 1e-12);
  EXPECT_NEAR(entity.transform().m(4), 2, 1e-12);
  EXPECT_NEAR(entity.transform().m(1), -1, 1e-12);
  EXPECT_EQ(entity.transform().m(3), 1);
  EXPECT_EQ(entity.transform().m(11), 3);
}

TEST(ShapeText, AllElseIsAnExpression) {
  EXPECT_EQ(Parsed("x^2+y^2-z = 0 where x^2+y^2 <= 1").primitive().implicit().surface().text(),
            "x^2+y^2-z = 0 where x^2+y^2 <= 1");
  EXPECT_EQ(Parsed("x").primitive().implicit().surface().text(), "x");
  EXPECT_EQ(Parsed("length(x, y, z) = 1").primitive().implicit().surface().text(),
            "length(x, y, z) = 1");
}

TEST(ShapeText, PicturesAreFilesOrTheirBytes) {
  const TempFolder folder;
  const std::string bytes("\x89PNG\0!", 6);
  const std::string path = folder.Write("a picture.png", bytes);
  EXPECT_EQ(Parsed("height_map picture='" + path + "'").primitive().height_map().picture(), bytes);
  EXPECT_EQ(Parsed("mesh texture.picture=base64:iVBORwAh").primitive().mesh().texture().picture(),
            bytes);
  EXPECT_THAT(ErrorOf("height_map picture=" + folder.Path("none")),
              HasSubstr("the path of a PNG or JPEG file that can be read would be right"));
  EXPECT_THAT(ErrorOf("height_map picture=" + folder.Path("")),
              HasSubstr("the path of a PNG or JPEG file that can be read would be right"));
  const std::string raw = folder.Write("samples.raw", std::string("\x01\x02\x03\xFF", 4));
  EXPECT_EQ(
      Parsed("volume grid.type=u8 grid.samples=file:" + raw).primitive().volume().grid().samples(),
      std::string("\x01\x02\x03\xFF", 4));
  EXPECT_THAT(ErrorOf("volume grid.samples=file:/nowhere/x.raw"),
              HasSubstr("samples is \"/nowhere/x.raw\"; the path of a file that can be read"));
  EXPECT_EQ(ErrorOf("height_map picture=base64:*"),
            "picture is \"base64:*\"; base64 would be right, or a file's path");
}

TEST(ShapeText, WhatIsWrongIsSaid) {
  EXPECT_EQ(ErrorOf(""), "a shape is expected, or an expression");
  EXPECT_EQ(ErrorOf("spere radius=1"), "there is no shape spere; did you mean sphere?");
  EXPECT_EQ(ErrorOf("sphere radios=1"), "sphere has no radios; did you mean radius?");
  EXPECT_EQ(ErrorOf("sphere radius=big"), "radius is \"big\"; a number would be right");
  EXPECT_EQ(ErrorOf("sphere 1"), "after sphere is \"1\"; NAME=VALUE would be right");
  EXPECT_EQ(ErrorOf("box size=1,2"),
            "size is \"1,2\"; x,y,z would be right, or one number for all");
  EXPECT_EQ(ErrorOf("box fill=full"),
            "fill is \"full\"; one of surface, solid, lines, dots would be right");
  EXPECT_EQ(ErrorOf("cone round_ends=yes"), "round_ends is \"yes\"; true or false would be right");
  EXPECT_EQ(ErrorOf("implicit domain=1,2,3"),
            "domain is \"1,2,3\"; two corners, x,y,z:x,y,z, would be right");
  EXPECT_EQ(
      ErrorOf("torus shell=2v"),
      "shell is \"2v\"; a number of voxels would be right, or one of units with a u, as 0.1u");
  EXPECT_EQ(ErrorOf("box label='open"), "a ' is not closed");
  EXPECT_THAT(
      ErrorOf("box color=purpel"),
      HasSubstr(
          "color is \"purpel\"; #rrggbb or a CSS color name is expected; did you mean purple?"));
  EXPECT_THAT(ErrorOf("points vertices=1,2"), HasSubstr("these are 2 numbers"));
  EXPECT_EQ(ErrorOf("sphere radius=1 color=red radius=2"),
            "sphere has radius twice, \"1\" and \"2\"; one of them would be right");
}

TEST(ShapeText, NumbersAreOfTheirType) {
  const auto samples = [](const char* text) {
    return Parsed(text).primitive().volume().grid().samples();
  };
  EXPECT_EQ(samples("volume grid.type=u8 grid.samples=1,255"), "\x01\xFF");
  EXPECT_EQ(samples("volume grid.type=u16 grid.samples=258"), "\x02\x01");
  EXPECT_EQ(samples("volume grid.type=rgba8 grid.samples=1,2,3,4"), "\x01\x02\x03\x04");
  EXPECT_EQ(samples("volume grid.samples=1,255 grid.type=u8"), "\x01\xFF") << "in any order";
  EXPECT_EQ(samples("volume grid.samples=1").size(), 4u);
  EXPECT_EQ(Parsed("height_map height_type=u16 heights=258").primitive().height_map().heights(),
            "\x02\x01");
  EXPECT_EQ(ErrorOf("volume grid.type=u8 grid.samples=256"),
            "samples is \"256\"; whole numbers from 0 to 255 would be right for the type u8");
  EXPECT_EQ(ErrorOf("height_map height_type=u16 heights=1,-2"),
            "heights is \"-2\"; whole numbers from 0 to 65535 would be right for the type u16");
}

TEST(ShapeText, BoundariesBeginWithAxisAndForm) {
  const v1::Boundary boundary =
      Parsed("implicit boundary='y b_spline 1,0,0 0,0,1 0,0,0'").primitive().implicit().boundary();
  EXPECT_EQ(boundary.axis(), v1::Boundary::Y);
  EXPECT_EQ(boundary.form(), v1::Boundary::B_SPLINE);
  EXPECT_EQ(boundary.points_size(), 9);
  EXPECT_EQ(Parsed("implicit boundary='1,0,0 0,0,1 0,0,0'")
                .primitive()
                .implicit()
                .boundary()
                .points_size(),
            9);
  EXPECT_EQ(ErrorOf("implicit boundary='spline 1,0,0'"),
            "form is \"spline\"; one of polyline, catmull_rom, b_spline would be right");
  EXPECT_EQ(ErrorOf("implicit boundary='w 1,0,0'"), "axis is \"w\"; one of z, x, y would be right");
}

TEST(ShapeText, ClipsAreNoShapes) {
  v1::Clip clip;
  ASSERT_TRUE(*ParseClipText("clip_plane a=1 d=-0.5", &clip));
  ASSERT_TRUE(*ParseClipText("clip_box size=1,2,3 at=4,5,6 turn=0,0,90", &clip));
  ASSERT_TRUE(*ParseClipText("clip_cylinder start=0,0,-1 end=0,0,1 radius=0.5", &clip));
  EXPECT_FALSE(*ParseClipText("sphere radius=1", &clip));
  EXPECT_EQ(clip.planes(0).a(), 1);
  EXPECT_EQ(clip.planes(0).d(), -0.5);
  EXPECT_EQ(clip.boxes(0).size().y(), 2);
  EXPECT_EQ(clip.boxes(0).transform().m(3), 4);
  EXPECT_NEAR(clip.boxes(0).transform().m(1), -1, 1e-12);
  EXPECT_EQ(clip.cylinders(0).end().z(), 1);
  EXPECT_EQ(ParseClipText("clip_plane q=1", &clip).status().message(),
            "clip_plane has no q; known are a, b, c, d");
  EXPECT_EQ(ParseClipText("clip_plane a", &clip).status().message(),
            "after clip_plane is \"a\"; NAME=VALUE would be right");
  EXPECT_FALSE(ParseClipText("clip_cylinder at=1", &clip).ok()) << "its ends determine its place";
  EXPECT_EQ(ParseClipText("clip_plane a=1 a=2", &clip).status().message(),
            "clip_plane has a twice, \"1\" and \"2\"; one of them would be right");
}

TEST(AsTyped, ARefusalIsToldInTheWordsOfTheCommandLine) {
  const std::string strict =
      "the session is strict and 1 operation was refused, so nothing of the commit was applied; "
      "the first: ";
  const std::vector<std::string> shapes = {"clip_box size=1,1,1",  "object wheel: box size=1",
                                           "object wheel: sphere", "mask: sphere radius=0",
                                           "text text=HELLO",      "x^2+"};
  const auto said = [&](const std::string& rest) {
    const absl::Status status = AsTyped(absl::InvalidArgumentError(strict + rest), shapes);
    EXPECT_TRUE(absl::IsInvalidArgument(status));
    return std::string(status.message());
  };
  EXPECT_EQ(said("voxelctl/draw 1, operations[7].upsert.entity.primitive.text.height: height is 0; "
                 "give a number greater than 0"),
            "\"text text=HELLO\": height=… is missing; give a number greater than 0");
  EXPECT_EQ(said("voxelctl/draw 2, operations[7].upsert.entity.primitive.implicit.surface.text: "
                 "text at character 5: found the end where a number would be right"),
            "\"x^2+\": at character 5: found the end where a number would be right");
  EXPECT_EQ(said("voxelctl mask/mask 1, operations[0].upsert.entity.primitive.sphere.radius: "
                 "radius is 0; give more"),
            "\"mask: sphere radius=0\": radius is 0; give more");
  EXPECT_EQ(said("/wheel, operations[0].define_object.definition.parts[1].primitive.sphere.radius: "
                 "radius is 0; give more"),
            "\"object wheel: sphere\": radius=… is missing; give more");
  EXPECT_EQ(said("voxelctl/draw 9, operations[0].upsert.entity.primitive.sphere.radius: what"),
            strict + "voxelctl/draw 9, operations[0].upsert.entity.primitive.sphere.radius: what");
  EXPECT_EQ(AsTyped(absl::UnavailableError("gone"), shapes), absl::UnavailableError("gone"));
}

// The gallery has every existing shape.
TEST(ShapeText, EveryShapeHasAnExample) {
  std::set<std::string> shown;
  for (const ShapeExample& example : ShapeExamples()) {
    const std::vector<std::string> lines = absl::StrSplit(example.text, '\n');
    const absl::StatusOr<v1::ApplyUpdateRequest> request = ShapesRequest(lines);
    ASSERT_TRUE(request.ok()) << request.status();
    for (const v1::StreamRequest& operation : request->operations()) {
      if (!operation.has_upsert()) continue;
      const v1::Primitive& primitive = operation.upsert().entity().primitive();
      const auto* field = v1::Primitive::descriptor()->FindFieldByNumber(primitive.kind_case());
      ASSERT_NE(field, nullptr) << example.name;
      EXPECT_EQ(std::string(example.name).find(field->name()), 0u) << example.name;
      shown.insert(field->name());
    }
  }
  const auto& kinds = *v1::Primitive::descriptor()->oneof_decl(0);
  EXPECT_EQ(shown.size(), static_cast<size_t>(kinds.field_count()));
}

TEST(Drawings, ObjectsMasksAndClipsComeWithTheShapes) {
  const std::vector<std::string> texts = {
      "instance object=o at=1,0,0",         "mask: box size=1",     "clip_plane c=1",
      "object o: sphere radius=1 at=0,2,0", "object o: box size=2", "sphere radius=3"};
  const absl::StatusOr<v1::ApplyUpdateRequest> request = ShapesRequest(texts);
  ASSERT_TRUE(request.ok()) << request.status();
  ASSERT_EQ(request->operations_size(), 6);
  const v1::DefineObject& object = request->operations(0).define_object();
  EXPECT_EQ(object.object(), "o");
  ASSERT_EQ(object.definition().parts_size(), 2) << "which instances can find";
  EXPECT_EQ(object.definition().parts(0).transform().m(7), 2);
  EXPECT_EQ(request->operations(1).upsert().layer(), kMaskLayer);
  EXPECT_EQ(request->operations(2).upsert().entity().primitive().instance().object(), "o");
  EXPECT_EQ(request->operations(3).upsert().layer(), kLayer);
  EXPECT_FALSE(request->operations(4).layer_state().visible());
  EXPECT_EQ(request->operations(4).layer_state().layer(), kMaskLayer);
  EXPECT_EQ(request->operations(5).layer_state().mask_layer(), kMaskLayer);
  EXPECT_EQ(request->operations(5).layer_state().clip().planes(0).c(), 1);
  for (const char* wrong :
       {"object : sphere", "object o sphere", "mask: object o: sphere", "mask: clip_plane c=1",
        "object o: sphere", "mask: sphere", "clip_plane c=1"}) {
    EXPECT_FALSE(ShapesRequest(std::vector<std::string>{wrong}).ok()) << wrong;
  }
}

}  // namespace
}  // namespace voxeld::voxelctl
