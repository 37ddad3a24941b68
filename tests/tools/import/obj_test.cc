// Tests Wavefront OBJ: statements, materials and pictures, with values computed by hand.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <filesystem>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "tests/tools/import/read_here.h"
#include "tests/tools/voxelctl/status_matchers.h"
#include "tests/tools/voxelctl/temp_folder.h"
#include "tools/voxelctl/scene/placement.h"

namespace voxeld::voxelctl {
namespace obj_test {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::UnorderedElementsAre;

constexpr char kQuad[] = "v 0 0 0\nv 4 0 0\nv 4 1 0\nv 0 1 0\n";

class ObjFiles : public testing::Test {
 protected:
  absl::StatusOr<Model> Read(const std::string& text) {
    return ReadHere(folder_.Write("a.obj", text), {});
  }
  Model Good(const std::string& text) {
    absl::StatusOr<Model> model = Read(text);
    EXPECT_THAT(model, IsOk()) << text;
    if (!model.ok()) return Model{.parts = {Part{.positions = {{}}, .colors = {{}}}}};
    return *std::move(model);
  }
  TempFolder folder_;
};

double AreaOf(const Model& model) {
  double area = 0;
  for (const Part& part : model.parts) {
    if (part.kind != Kind::kTriangles) continue;
    for (size_t t = 0; t < part.indices.size(); t += 3) {
      const Point3 &a = part.positions[part.indices[t]], &b = part.positions[part.indices[t + 1]],
                   &c = part.positions[part.indices[t + 2]];
      area += 0.5 * std::abs((b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x));
    }
  }
  return area;
}

const Part* FindKind(const Model& model, Kind kind) {
  for (const Part& part : model.parts) {
    if (part.kind == kind) return &part;
  }
  return nullptr;
}

TEST_F(ObjFiles, ReferencesBackwardsAndForwards) {
  EXPECT_DOUBLE_EQ(AreaOf(Good(absl::StrCat(kQuad, "f -4 -3 -2 -1\n", kQuad, "f -4 -3 -2 -1\n"))),
                   8);
  EXPECT_DOUBLE_EQ(AreaOf(Good(absl::StrCat("f 1 2 3 4\n", kQuad))), 4) << "before its vertices";
  EXPECT_DOUBLE_EQ(AreaOf(Good(absl::StrCat(kQuad, "vt 0 0\nvn 0 0 1\nf 1/1/1 2//1 3/1 4/\n"))), 4);
  EXPECT_DOUBLE_EQ(AreaOf(Good(absl::StrCat(kQuad, "f 1 2 \\\r\n 3 4 # a comment\r\n"))), 4);
  EXPECT_DOUBLE_EQ(AreaOf(Good("v 0 0 0\rv 4 0 0\rv 4 1 0\rf 1 2 3\r")), 2) << "CR alone";
  EXPECT_DOUBLE_EQ(AreaOf(Good(absl::StrCat("\xef\xbb\xbf", kQuad, "f 1 2 3 4"))), 4);
}

TEST_F(ObjFiles, ConcavePolygonsAndThoseOfManyCorners) {
  // A square of 16 with a notch of 6 in its upper edge.
  EXPECT_DOUBLE_EQ(AreaOf(Good("v 0 0 0\nv 4 0 0\nv 4 4 0\nv 2 1 0\nv 0 4 0\nf 1 2 3 4 5\n")), 10);
  // The same, started at every corner and reversed.
  EXPECT_DOUBLE_EQ(AreaOf(Good("v 0 0 0\nv 4 0 0\nv 4 4 0\nv 2 1 0\nv 0 4 0\nf 4 3 2 1 5\n")), 10);
  // A concave quad.
  EXPECT_DOUBLE_EQ(AreaOf(Good("v 0 0 0\nv 4 4 0\nv 0 1 0\nv -4 4 0\nf 1 2 3 4\n")), 4);
  // The library by itself keeps a count of corners in a byte.
  std::string many, face = "f";
  for (int i = 0; i < 400; ++i) {
    const double angle = 2 * M_PI * i / 400;
    absl::StrAppend(&many, "v ", std::cos(angle), " ", std::sin(angle), " 0\n");
    absl::StrAppend(&face, " ", i + 1);
  }
  EXPECT_NEAR(AreaOf(Good(many + face)), M_PI, 1e-3);
}

TEST_F(ObjFiles, PointsAndLinesBesideFacesInEveryOrder) {
  for (const char* text :
       {"p 1 3\nl 1 2 3\nf 1 2 3 4\n", "f 1 2 3 4\ng a\np 1\ng b\np 3\ng c\nl 1 2 3\n",
        "usemtl x\nl 1 2 3\nusemtl y\np 1 3\nusemtl z\nf 1 2 3 4\nusemtl w\n"}) {
    const Model model = Good(absl::StrCat(kQuad, text));
    EXPECT_DOUBLE_EQ(AreaOf(model), 4) << text;
    EXPECT_EQ(FindKind(model, Kind::kPoints)->positions.size(), 2u) << text;
    EXPECT_THAT(FindKind(model, Kind::kSegments)->indices, ElementsAre(0, 1, 1, 2)) << text;
  }
  EXPECT_EQ(Good(kQuad).parts[0].kind, Kind::kPoints) << "a cloud";
  EXPECT_EQ(Good(kQuad).parts[0].positions.size(), 4u);
}

TEST_F(ObjFiles, WhatNothingRefersToIsNotThere) {
  const Model model = Good(absl::StrCat("o nothing\nv 99 99 99\no quad\n", kQuad, "f 2 3 4 5\n"));
  ASSERT_EQ(model.parts.size(), 1u);
  for (const Point3& p : model.parts[0].positions) EXPECT_LE(p.x, 4);
}

TEST_F(ObjFiles, TrianglesWithoutAnAreaAreCounted) {
  const Model model = Good(
      absl::StrCat(kQuad, "v 2 2 0\nv 2 3 0\nv 2 9 0\nf 1 2 3 4\n", "f 5 5 5\nf 5 5 6\nf 5 6 7\n"));
  ASSERT_EQ(model.parts.size(), 1u);
  EXPECT_EQ(model.parts[0].positions.size(), 4u);
  EXPECT_DOUBLE_EQ(AreaOf(model), 4);
  EXPECT_THAT(model.left_out, ElementsAre(LeftOut{"triangles without an area", 1}));
}

// Thin is not empty: a rotated square of a thousand slivers keeps its area.
TEST_F(ObjFiles, SliversAreTriangles) {
  for (const double width : {1e-3, 1e-6}) {
    std::string text;
    for (int i = 0; i <= 500; ++i) {
      const double along = width * i, x = 0.6 * along, y = 0.8 * along;
      absl::StrAppend(&text, absl::StrFormat("v %.17g %.17g 0\n", x, y),
                      absl::StrFormat("v %.17g %.17g 0\n", x - 0.8, y + 0.6));
    }
    for (int i = 0; i < 500; ++i) {
      const int at = 2 * i + 1;
      absl::StrAppend(&text, "f ", at, " ", at + 2, " ", at + 1, "\nf ", at + 1, " ", at + 2, " ",
                      at + 3, "\n");
    }
    const Model model = Good(text);
    EXPECT_EQ(model.parts[0].indices.size(), 3000u) << width;
    EXPECT_NEAR(AreaOf(model), 500 * width, 1e-9) << width;
    EXPECT_THAT(model.left_out, IsEmpty()) << width;
  }
}

TEST_F(ObjFiles, CoordinatesOfASurvey) {
  const Model model = Good(
      "v 500000.001 4600000.002 0\nv 500000.003 4600000.002 0\nv 500000.003 4600000.004 0\nf 1 2 "
      "3");
  EXPECT_NEAR(AreaOf(model), 2e-6, 1e-9);
}

TEST_F(ObjFiles, ASurveyIsPlacedAsTheSameAtZero) {
  // A fan of a thousandth of a unit to four units, far from zero along each axis, and at zero.
  const auto placed = [this](int64_t x, int64_t y, int64_t z) {
    std::string text;
    for (const auto& [u, v] :
         {std::pair("000", "000"), {"001", "000"}, {"500", "250"}, {"000", "999"}})
      absl::StrAppend(&text, "v ", x, ".", u, " ", y, ".", v, " ", z, ".", u, "\n");
    Model model = Good(text + "f 1 2 3\nf 1 3 4\n");
    PlaceModels({&model, 1}, DisplaySpace(), {});
    return model.parts[0].positions;
  };
  const std::vector<Point3> near = placed(0, 0, 0), far = placed(500000, 4600000, 123456789);
  ASSERT_EQ(near.size(), far.size());
  for (size_t i = 0; i < near.size(); ++i) {
    EXPECT_NEAR(near[i].x, far[i].x, 1e-6);
    EXPECT_NEAR(near[i].y, far[i].y, 1e-6);
    EXPECT_NEAR(near[i].z, far[i].z, 1e-6);
  }
}

TEST_F(ObjFiles, ColoursOfVerticesAreFactorsOfTheMaterial) {
  folder_.Write("m.mtl", "newmtl half\nKd 0.5 1 1\nnewmtl one\nKd 0.5\nnewmtl plain\nNs 5\n");
  const std::string quad =
      "v 0 0 0 1 0 0\nv 4 0 0 0 1 0\nv 4 1 0 1 1 1\nv 0 1 0 0 0 1\nmtllib m.mtl\n";
  const auto colors = [&](const std::string& rest) { return Good(quad + rest).parts[0].colors; };
  EXPECT_THAT(colors("f 1 2 3 4"),
              ElementsAre(Rgb{255, 0, 0}, Rgb{0, 255, 0}, Rgb{255, 255, 255}, Rgb{0, 0, 255}));
  EXPECT_THAT(colors("usemtl half\nf 1 2 3 4"),
              ElementsAre(Rgb{128, 0, 0}, Rgb{0, 255, 0}, Rgb{128, 255, 255}, Rgb{0, 0, 255}));
  EXPECT_EQ(colors("usemtl plain\nf 1 2 3 4")[0], (Rgb{255, 0, 0}));
  const auto plain = [&](const std::string& rest) {
    return Good(absl::StrCat(kQuad, "mtllib m.mtl\n", rest)).parts[0].colors;
  };
  EXPECT_EQ(plain("usemtl one\nf 1 2 3 4")[0], (Rgb{128, 128, 128})) << "one number applies to all";
  EXPECT_THAT(plain("usemtl plain\nf 1 2 3 4"), IsEmpty()) << "the file gives no colour";
  EXPECT_THAT(plain("f 1 2 3 4"), IsEmpty());
  // Up to 255; with an opacity.
  EXPECT_EQ(Good("v 0 0 0 255 128 0\nv 4 0 0 0 0 0\nv 4 1 0 0 0 0\nf 1 2 3").parts[0].colors[0],
            (Rgb{255, 128, 0}));
  EXPECT_EQ(Good("v 0 0 0 1 0 0 1\nv 4 0 0 1 0 0 1\nv 4 1 0 1 0 0 1\nf 1 2 3").parts[0].colors[0],
            (Rgb{255, 0, 0}));
  EXPECT_THAT(Good("v 0 0 0 1\nv 4 0 0 1\nv 4 1 0 1\nf 1 2 3").parts[0].colors, IsEmpty())
      << "a weight is not a colour";
}

TEST_F(ObjFiles, NamesWithBlanks) {
  folder_.Write("my materials.mtl", "newmtl my red  \nKd 1 0 0\nnewmtl green\nKd 0 1 0\n");
  folder_.Write("b.mtl", "newmtl blue\nKd 0 0 1\n");
  folder_.Write("c.mtl", "newmtl grey\nKd 0.6 0.6 0.6\n");
  const auto color = [&](const std::string& library, const std::string& name) {
    const Model model =
        Good(absl::StrCat(kQuad, "mtllib ", library, "\nusemtl ", name, "\nf 1 2 3 4\n"));
    return model.parts[0].colors.empty() ? Rgb{1, 2, 3} : model.parts[0].colors[0];
  };
  EXPECT_EQ(color("my materials.mtl", "my red"), (Rgb{255, 0, 0}));
  EXPECT_EQ(color("\"my materials.mtl\"", "green\r"), (Rgb{0, 255, 0}));
  EXPECT_EQ(color("b.mtl c.mtl", "blue"), (Rgb{0, 0, 255}));
  EXPECT_EQ(color("b.mtl c.mtl", "grey"), (Rgb{153, 153, 153}));
  EXPECT_EQ(color("b.mtl c.mtl", "red"), (Rgb{1, 2, 3}));
}

TEST_F(ObjFiles, LightIsAdded) {
  folder_.Write("m.mtl", "newmtl a\nKd 1 0 0\nKe 0 0.5 0\n");
  EXPECT_EQ(Good(absl::StrCat(kQuad, "mtllib m.mtl\nusemtl a\nf 1 2 3 4")).parts[0].colors[0],
            (Rgb{255, 128, 0}));
}

TEST_F(ObjFiles, LightAloneIsAColour) {
  folder_.Write("m.mtl", "newmtl a\nKe 1 0 0\nnewmtl b\nKe 0 0 0\nnewmtl c\nKe 0 0.25 0\n");
  const auto colors = [this](const std::string& name, const std::string& vertices = kQuad) {
    return Good(absl::StrCat("mtllib m.mtl\n", vertices, "usemtl ", name, "\nf 1 2 3\n"))
        .parts.at(0)
        .colors;
  };
  EXPECT_EQ(colors("a").at(0), (Rgb{255, 0, 0}));
  EXPECT_THAT(colors("b"), IsEmpty()) << "no light is no colour";
  // Vertices' colours are lit in addition.
  EXPECT_EQ(colors("c", "v 0 0 0 1 0 0\nv 4 0 0 1 0 0\nv 4 1 0 1 0 0\n").at(0), (Rgb{255, 64, 0}));
}

TEST_F(ObjFiles, NamesOfMaterialsEndAtAComment) {
  folder_.Write("m.mtl",
                "newmtl red # old\nKd 1 0 0\nnewmtl Wire #25\nKd 0 1 0\nnewmtl Wire #26\n"
                "Kd 0 0 1\nnewmtl a#b\nKd 1 1 0\n");
  const auto color = [this](const std::string& name) {
    const Model model =
        Good(absl::StrCat("mtllib m.mtl # ours\n", kQuad, "usemtl ", name, "\nf 1 2 3 4\n"));
    EXPECT_THAT(model.left_out, IsEmpty()) << name;
    return model.parts.at(0).colors.empty() ? Rgb{} : model.parts[0].colors[0];
  };
  EXPECT_EQ(color("red # paint"), (Rgb{255, 0, 0}));
  EXPECT_EQ(color("red"), (Rgb{255, 0, 0}));
  EXPECT_EQ(color("Wire #25"), (Rgb{0, 255, 0}));
  EXPECT_EQ(color("Wire #26"), (Rgb{0, 0, 255})) << "a whole name comes first";
  EXPECT_EQ(color("a#b # c"), (Rgb{255, 255, 0}));
}

TEST_F(ObjFiles, TexturesInAllSpellings) {
  const std::string png("\x89PNG\r\n\x1a\n", 8);
  folder_.Write("a b.png", png);
  std::filesystem::create_directory(folder_.Path("tex"));
  folder_.Write("tex/2.png", png);
  folder_.Write("a.tga", "not a picture that is shown");
  const auto read = [&](const std::string& map) {
    folder_.Write("m.mtl", absl::StrCat("newmtl a\n", map, "\n"));
    return Good(absl::StrCat(kQuad, "vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nmtllib m.mtl\nusemtl a\n",
                             "f 1/1 2/2 3/3 4/4\n"));
  };
  for (const char* map :
       {"map_Kd a b.png", "map_Kd -clamp off a b.png", "map_Kd tex/2.png", "map_Kd tex\\2.png",
        "map_Kd C:\\models\\a b.png", "map_Kd -s 1 1 1 a b.png", "map_Kd -s 1 1 a b.png"}) {
    const Model model = read(map);
    ASSERT_THAT(model.pictures, ElementsAre(png)) << map;
    // v increases upwards in OBJ.
    EXPECT_THAT(model.parts[0].texture_coordinates,
                ElementsAre(std::array<float, 2>{0, 1}, std::array<float, 2>{1, 1},
                            std::array<float, 2>{1, 0}, std::array<float, 2>{0, 0}))
        << map;
    EXPECT_EQ(model.parts[0].colors[0], (Rgb{255, 255, 255})) << map;
    EXPECT_THAT(model.left_out, IsEmpty()) << map;
  }
  EXPECT_EQ(read("Kd 1 0 0\nmap_Kd a b.png").parts[0].colors[0], (Rgb{255, 0, 0}));
  // Scaled by 2 and moved by 0.25 along u, where v increases upwards.
  EXPECT_THAT(read("map_Kd -s 2 4 -o 0.25 a b.png").parts[0].texture_coordinates,
              ElementsAre(std::array<float, 2>{0.25, 1}, std::array<float, 2>{2.25, 1},
                          std::array<float, 2>{2.25, -3}, std::array<float, 2>{0.25, -3}));
  EXPECT_THAT(read("map_Kd a.tga").left_out,
              ElementsAre(LeftOut{"textures that are neither PNG nor JPEG", 1}));
  EXPECT_THAT(read("map_Kd missing.png").left_out,
              ElementsAre(LeftOut{"textures that cannot be read", 1}));
  EXPECT_THAT(read("map_Kd missing.png").note, HasSubstr("cannot read missing.png"));
  EXPECT_THAT(read("Kd 1 1 1\nmap_Bump -bm 2 a b.png\nmap_d a b.png\nd 0.5").left_out,
              UnorderedElementsAre(LeftOut{"bump maps", 1}, LeftOut{"opacity maps", 1},
                                   LeftOut{"transparency of materials", 1}));
}

TEST_F(ObjFiles, SmoothingGroups) {
  // Two triangles at a right angle.
  const std::string text = "v 0 0 0\nv 0 1 0\nv 1 0 0\nv 0 0 1\n";
  const auto normal = [&](const std::string& smoothing) {
    const Part part = Good(absl::StrCat(text, smoothing, "f 1 3 2\nf 1 2 4\n")).parts[0];
    return part.normals[part.indices[0]];
  };
  EXPECT_NEAR(normal("s off\n").z, 1, 1e-9);
  EXPECT_NEAR(normal("s 0\n").z, 1, 1e-9);
  EXPECT_NEAR(normal("s 1\n").z, std::sqrt(0.5), 1e-9);
  EXPECT_NEAR(normal("").z, 1, 1e-9) << "an edge this sharp stays one";
}

TEST_F(ObjFiles, WhatIsNotShownIsCounted) {
  const Model model = Good(absl::StrCat(
      kQuad, "f 1 2 3 4\nf 1 2\nmtllib nowhere.mtl\nusemtl red\nf 1 2 3\ncstype bspline\ndeg 3\n",
      "curv 0 1 1 2 3 4\nparm u 0 1\nend\nsurf 0 1 0 1 1 2 3 4\nend\nfrobnicate 7\nvn nan nan "
      "nan\n"));
  EXPECT_THAT(model.left_out,
              UnorderedElementsAre(LeftOut{"faces and lines with too few corners", 1},
                                   LeftOut{"material files that cannot be read", 1},
                                   LeftOut{"materials that no file defines", 1},
                                   LeftOut{"free-form curves", 1}, LeftOut{"free-form surfaces", 1},
                                   LeftOut{"unknown statements", 1},
                                   LeftOut{"normals that are not numbers", 1}));
  EXPECT_EQ(model.note, "cannot read nowhere.mtl, which it names; put it beside the file");
}

TEST_F(ObjFiles, NumbersThatAreNotNumbersAreRefused) {
  for (const char* bad : {"nan", "-inf", "1,5", "1e", "--1", ".", "0x10", "1.#QNAN", "1e99999"}) {
    EXPECT_THAT(Read(absl::StrCat(kQuad, "v 0 ", bad, " 0\nf 1 2 3\n")),
                Fails(Words{"line 5", bad, "finite"}))
        << bad;
  }
  for (const char* good : {"+1", ".5", "5.", "-1e-3", "1E+2"})
    EXPECT_THAT(Read(absl::StrCat(kQuad, "v 0 ", good, " 0\nf 1 2 3\n")), IsOk()) << good;
  EXPECT_THAT(Read(absl::StrCat(kQuad, "f 1 2 3a\n")), Fails(Words{"line 5", "\"3a\""}));
  EXPECT_THAT(Read(absl::StrCat(kQuad, "f 1/9 2/9 3/9\n")),
              Fails(Words{"line 5", "texture coordinates 9"}));
  EXPECT_THAT(Read(absl::StrCat(kQuad, "f 1//9 2//9 3//9\n")), Fails(Words{"line 5", "normals 9"}));
}

TEST_F(ObjFiles, DamageAnywhereEndsWell) {
  const std::string obj = absl::StrCat(
      "mtllib m.mtl\n", kQuad, "v 1 2 3 1 0 0\nvt 0 0\nvt 1 1\nvn 0 0 1\nusemtl a\ns 1\n",
      "f 1/1/1 2/2/1 3/1/1 4/2/1\nl 1 2 -1\np 3\ncurv 0 1 1 2\nf -1 -2 -3 \\\n -4\n");
  const std::string mtl = "newmtl a\nKd 1 0 0\nmap_Kd -s 1 2 -o 1 a.png\nKe .5 1 1\nd 0.5\nTr 1\n";
  folder_.Write("a.png", "\x89PNG\r\n\x1a\n");
  std::mt19937 random(77);
  static constexpr char kBytes[] = "0123456789-./ \n\r\\#vfltnpse";
  for (int i = 0; i < 800; ++i) {
    const auto damage = [&](std::string bytes) {
      for (uint32_t k = 1 + random() % 4; k > 0; --k)
        bytes[random() % bytes.size()] = random() % 4 == 0
                                             ? static_cast<char>(random())
                                             : kBytes[random() % (sizeof(kBytes) - 1)];
      if (i % 8 == 0) bytes.resize(random() % bytes.size());
      return bytes;
    };
    folder_.Write("m.mtl", damage(mtl));
    const std::string path = folder_.Write("a.obj", "# a\n" + damage(obj));
    const auto model = ReadHere(path, {});
    if (!model.ok()) {
      EXPECT_THAT(std::string(model.status().message()), testing::StartsWith(path));
    }
  }
}

}  // namespace obj_test
}  // namespace voxeld::voxelctl
