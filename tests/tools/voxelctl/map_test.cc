// Tests GeoJSON and TopoJSON, flat and on the globe.
#include <gtest/gtest.h>

#include <cmath>

#include <string>

#include "tests/tools/voxelctl/read_here.h"
#include "tests/tools/voxelctl/status_matchers.h"
#include "tests/tools/voxelctl/temp_folder.h"
#include "tools/voxelctl/import/importer.h"

namespace voxeld::voxelctl {
namespace {

using testing::ElementsAre;

// Returns the segments of a part as pairs of ends.
std::vector<std::pair<Point3, Point3>> Segments(const Part& part) {
  std::vector<std::pair<Point3, Point3>> segments;
  for (size_t i = 0; i + 1 < part.indices.size(); i += 2) {
    segments.emplace_back(part.positions[part.indices[i]], part.positions[part.indices[i + 1]]);
  }
  return segments;
}

absl::StatusOr<Model> ImportText(const std::string& text, bool globe,
                                 const std::string& name = "map.geojson") {
  TempFolder folder;
  return ReadHere(folder.Write(name, text), {.globe = globe, .attributes = true});
}

std::string Line(const std::string& coordinates) {
  return R"({"type":"LineString","coordinates":)" + coordinates + "}";
}

double Distance(const Point3& a, const Point3& b) {
  return std::hypot(a.x - b.x, a.y - b.y, a.z - b.z);
}

TEST(GeoJson, FlatMap) {
  const absl::StatusOr<Model> model = ReadHere(DataFile("places.geojson"), {});
  ASSERT_THAT(model, IsOk());
  EXPECT_EQ(model->up, Up::kY);
  EXPECT_FALSE(model->globe);
  ASSERT_EQ(model->parts.size(), 2u);
  EXPECT_THAT(Segments(model->parts[0]),
              ElementsAre(std::pair(Point3{0, 0, 0}, Point3{10, 0, 0}),
                          std::pair(Point3{10, 0, 0}, Point3{10, 10, 0}),
                          std::pair(Point3{10, 10, 0}, Point3{0, 0, 0}),
                          std::pair(Point3{20, 0, 0}, Point3{30, 5, 0})));
  EXPECT_EQ(model->parts[1].kind, Kind::kPoints);
  EXPECT_THAT(model->parts[1].positions, ElementsAre(Point3{-90, 0, 0}, Point3{0, 90, 0}));
}

TEST(GeoJson, GeometriesWithoutCoordinatesAreCounted) {
  std::string features = R"({"type":"Feature","geometry":null})";
  for (const char* type :
       {"Point", "MultiPoint", "LineString", "MultiLineString", "Polygon", "MultiPolygon"}) {
    features += std::string(R"(,{"type":"Feature","geometry":{"type":")") + type +
                R"(","coordinates":[]}})";
  }
  const absl::StatusOr<Model> model =
      ImportText(R"({"type":"FeatureCollection","features":[)" + features +
                     R"(,{"type":"Feature","geometry":)" + Line("[[0,0],[10,0]]") + "}]}",
                 false);
  ASSERT_THAT(model, IsOk());
  EXPECT_EQ(Segments(model->parts[0]).size(), 1u);
  EXPECT_EQ(model->left_out, (std::vector<LeftOut>{{"geometries without coordinates", 7}}));
}

TEST(GeoJson, EmptyPartsOfAGeometryAreCounted) {
  const absl::StatusOr<Model> model = ImportText(
      R"({"type":"GeometryCollection","geometries":[{"type":"Polygon","coordinates":[[]]},)"
      R"({"type":"MultiPolygon","coordinates":[[[]],[]]},)"
      R"({"type":"MultiLineString","coordinates":[[],[[0,0],[10,0]]]}]})",
      false);
  ASSERT_THAT(model, IsOk());
  EXPECT_EQ(Segments(model->parts[0]).size(), 1u);
  EXPECT_EQ(model->left_out, (std::vector<LeftOut>{{"geometries without coordinates", 4}}));
}

TEST(TopoJson, GeometriesWithoutArcsOrCoordinatesAreCounted) {
  const absl::StatusOr<Model> model = ImportText(
      R"({"type":"Topology","objects":{"a":{"type":"GeometryCollection","geometries":[{"type":null},)"
      R"({"type":"LineString","arcs":[]},{"type":"Polygon","arcs":[]},{"type":"Polygon","arcs":[[]]},)"
      R"({"type":"MultiPolygon","arcs":[[[]]]},{"type":"MultiLineString","arcs":[[],[0]]},)"
      R"({"type":"Point","coordinates":[]},{"type":"MultiPoint","coordinates":[]}]}},)"
      R"("arcs":[[[0,0],[10,0]]]})",
      false, "map.topojson");
  ASSERT_THAT(model, IsOk());
  ASSERT_EQ(model->parts.size(), 1u);
  EXPECT_EQ(Segments(model->parts[0]).size(), 1u);
  EXPECT_EQ(model->left_out, (std::vector<LeftOut>{{"geometries without coordinates", 8}}));
}

TEST(MapText, MayBeginWithAByteOrderMarkOfUtf8) {
  const std::string topology =
      R"({"type":"Topology","objects":{"a":{"type":"LineString","arcs":[0]}},"arcs":[[[0,0],[9,0]]]})";
  for (const std::string& text : {Line("[[0,0],[9,0]]"), topology}) {
    for (const char* name : {"map.geojson", "map.topojson", "map.json"}) {
      for (const char* before : {"\xef\xbb\xbf", "\xef\xbb\xbf \r\n", " \n"}) {
        const absl::StatusOr<Model> model = ImportText(before + text, false, name);
        ASSERT_THAT(model, IsOk()) << name;
        EXPECT_EQ(Segments(model->parts[0]).size(), 1u);
      }
    }
  }
}

std::vector<double> ValuesOf(const Part& part, const std::string& name) {
  for (const Attribute& one : part.attributes) {
    if (one.name == name) return one.values;
  }
  return {};
}

std::string Feature(const std::string& properties, const std::string& geometry) {
  return R"({"type":"Feature","properties":)" + properties + R"(,"geometry":)" + geometry + "}";
}
std::string Collection(const std::string& features) {
  return R"({"type":"FeatureCollection","features":[)" + features + "]}";
}

// simplestyle 1.1.0: colours are #rgb or #rrggbb, also without the mark; opacities are 0 to 1.
TEST(GeoJson, ColoursOfSimplestyle) {
  const std::string point = R"({"type":"Point","coordinates":[1,2]})";
  const std::string area = R"({"type":"Polygon","coordinates":[[[0,0],[4,0],[0,4],[0,0]]]})";
  const absl::StatusOr<Model> model = ImportText(
      Collection(Feature(R"({"stroke":"#f00"})", Line("[[0,0],[1,0]]")) + "," +
                 Feature(R"({"stroke":"00ff00","stroke-opacity":0.5})", Line("[[0,1],[1,1]]")) +
                 "," + Feature(R"({"stroke":"RebeccaPurple"})", Line("[[0,2],[1,2]]")) + "," +
                 Feature("null", Line("[[0,3],[1,3]]")) + "," +
                 Feature(R"({"stroke":"no colour"})", Line("[[0,4],[1,4]]")) + "," +
                 Feature(R"({"fill":"blue","fill-opacity":0.2,"stroke":"#ffffff"})", area) + "," +
                 Feature(R"({"fill":"blue"})", area) + "," +
                 Feature(R"({"marker-color":"#123456","marker-symbol":"bus"})", point)),
      false);
  ASSERT_THAT(model, IsOk());
  ASSERT_EQ(model->parts.size(), 2u);
  const std::vector<Rgb>& colors = model->parts[0].colors;
  const std::vector<Rgb> expected = {{255, 0, 0},     {0, 128, 0},     {0x66, 0x33, 0x99},
                                     {255, 255, 255}, {255, 255, 255}, {255, 255, 255},
                                     {255, 255, 255}, {0, 0, 255},     {0, 0, 255}};
  ASSERT_EQ(colors.size(), 18u);  // 5 lines of two ends, two areas of four corners
  for (size_t i = 0; i < 9; ++i) EXPECT_EQ(colors[2 * i], expected[i]) << i;
  EXPECT_THAT(model->parts[1].colors, ElementsAre(Rgb{0x12, 0x34, 0x56}));
  EXPECT_EQ(model->left_out, (std::vector<LeftOut>{{"colours that are not colours", 1},
                                                   {"fills of areas", 2},
                                                   {"symbols of points", 1}}));
}

TEST(GeoJson, WidthsSizesAndFurtherNumbersAreCounted) {
  const auto point = [](const std::string& properties) {
    return Feature(properties, R"({"type":"Point","coordinates":[1,2]})");
  };
  const absl::StatusOr<Model> model = ImportText(
      Collection(Feature(R"({"stroke-width":20})", Line("[[0,0,1,2],[1,0,1,2,3]]")) + "," +
                 Feature(R"({"stroke-width":"0.5"})", Line("[[0,0],[1,0]]")) + "," +
                 Feature(R"({"stroke-width":2,"marker-size":"medium"})", Line("[[0,0],[1,0]]")) +
                 "," + point(R"({"marker-size":"large"})") + "," +
                 point(R"({"marker-size":"","marker-symbol":""})")),
      false);
  ASSERT_THAT(model, IsOk());
  EXPECT_EQ(model->left_out, (std::vector<LeftOut>{{"widths of lines", 2},
                                                   {"further numbers of positions", 3},
                                                   {"sizes of points", 1}}));
}

TEST(GeoJson, MapsWithoutColoursHaveNone) {
  const absl::StatusOr<Model> model =
      ImportText(Feature(R"({"name":"red"})", Line("[[0,0],[1,0]]")), false);
  ASSERT_THAT(model, IsOk());
  EXPECT_TRUE(model->parts.at(0).colors.empty());
  EXPECT_TRUE(model->parts.at(0).attributes.empty());
}

TEST(GeoJson, NumbersOfFeaturesAreAttributes) {
  const absl::StatusOr<Model> model = ImportText(
      Collection(Feature(R"({"pop":5,"name":"a","mixed":1,"yes":true,"none":null})",
                         Line("[[0,0],[1,0]]")) +
                 "," + Feature(R"({"pop":7.5,"mixed":"two"})", Line("[[0,1],[1,1]]")) + "," +
                 Feature(R"({"pop":1})", R"({"type":"Point","coordinates":[1,2,30]})")),
      true);
  ASSERT_THAT(model, IsOk());
  EXPECT_THAT(ValuesOf(model->parts[0], "pop"), ElementsAre(5.f, 5.f, 7.5f, 7.5f));
  EXPECT_THAT(ValuesOf(model->parts[0], "mixed"),
              ElementsAre(1.f, 1.f, testing::IsNan(), testing::IsNan()));
  EXPECT_TRUE(ValuesOf(model->parts[0], "name").empty());
  EXPECT_TRUE(ValuesOf(model->parts[0], "yes").empty());
  EXPECT_THAT(ValuesOf(model->parts[1], "pop"), ElementsAre(1.f));
  EXPECT_THAT(ValuesOf(model->parts[1], "height"), ElementsAre(30.f));
  EXPECT_TRUE(model->left_out.empty()) << "heights are an attribute";
}

TEST(TopoJson, ColoursAndNumbersOfTheFirstThatHasAnArc) {
  const absl::StatusOr<Model> model =
      ImportText(R"({"type":"Topology","objects":{"a":{"type":"GeometryCollection","geometries":[)"
                 R"({"type":"LineString","arcs":[0],"properties":{"stroke":"#f00","n":1}},)"
                 R"({"type":"LineString","arcs":[0,1],"properties":{"stroke":"#0f0","n":2}},)"
                 R"({"type":null}]}},"arcs":[[[0,0],[1,0]],[[1,0],[2,0]]]})",
                 false, "map.topojson");
  ASSERT_THAT(model, IsOk());
  EXPECT_THAT(model->parts[0].colors,
              ElementsAre(Rgb{255, 0, 0}, Rgb{255, 0, 0}, Rgb{0, 255, 0}, Rgb{0, 255, 0}));
  EXPECT_THAT(ValuesOf(model->parts[0], "n"), ElementsAre(1.f, 1.f, 2.f, 2.f));
  EXPECT_EQ(model->left_out, (std::vector<LeftOut>{{"geometries without coordinates", 1}}));
}

// TopoJSON's specification allows properties of every geometry object, including collections.
TEST(TopoJson, GeometriesHaveThePropertiesOfTheirCollection) {
  const absl::StatusOr<Model> model = ImportText(
      R"({"type":"Topology","objects":{"a":{"type":"GeometryCollection","properties":{"stroke":"#f00","v":3},)"
      R"("geometries":[{"type":"LineString","arcs":[0]},)"
      R"({"type":"GeometryCollection","properties":{"stroke":"#0f0","w":1},"geometries":[)"
      R"({"type":"LineString","arcs":[1]},{"type":"LineString","arcs":[2],"properties":{"v":5}}]},)"
      R"({"type":"Point","coordinates":[1,1],"properties":{}}]},)"
      R"("b":{"type":"LineString","arcs":[3],"properties":{"stroke":"#00f"}}},)"
      R"("arcs":[[[0,0],[1,0]],[[1,0],[2,0]],[[2,0],[3,0]],[[3,0],[4,0]]]})",
      false, "map.topojson");
  ASSERT_THAT(model, IsOk());
  const Rgb red = {255, 0, 0}, green = {0, 255, 0}, blue = {0, 0, 255};
  EXPECT_THAT(model->parts.at(0).colors,
              ElementsAre(red, red, green, green, green, green, blue, blue));
  const auto none = testing::IsNan();
  EXPECT_THAT(ValuesOf(model->parts[0], "v"), ElementsAre(3., 3., 3., 3., 5., 5., none, none));
  EXPECT_THAT(ValuesOf(model->parts[0], "w"), ElementsAre(none, none, 1., 1., 1., 1., none, none));
  EXPECT_THAT(ValuesOf(model->parts.at(1), "v"), ElementsAre(3.));
  EXPECT_TRUE(model->left_out.empty());
}

// TopoJSON's specification defines transforms and deltas for x and y only.
TEST(TopoJson, HeightsAreAnAttribute) {
  const std::string objects =
      R"({"type":"Topology","objects":{"a":{"type":"LineString","arcs":[0]},"b":)"
      R"({"type":"Point","coordinates":[1,1,7]}},)";
  for (const char* rest :
       {R"("arcs":[[[0,0,100],[10,0,200],[10,10]]]})",
        R"("transform":{"scale":[2,2],"translate":[0,0]},"arcs":[[[0,0,100],[5,0,200],[0,5]]]})"}) {
    const absl::StatusOr<Model> model = ImportText(objects + rest, false, "map.topojson");
    ASSERT_THAT(model, IsOk());
    EXPECT_THAT(Segments(model->parts.at(0)),
                ElementsAre(std::pair(Point3{0, 0, 0}, Point3{10, 0, 0}),
                            std::pair(Point3{10, 0, 0}, Point3{10, 10, 0})));
    EXPECT_THAT(ValuesOf(model->parts[0], "height"), ElementsAre(100., 200., testing::IsNan()));
    EXPECT_THAT(ValuesOf(model->parts.at(1), "height"), ElementsAre(7.));
    TempFolder folder;
    const absl::StatusOr<Model> plain = ReadHere(folder.Write("a.topojson", objects + rest), {});
    ASSERT_THAT(plain, IsOk());
    EXPECT_EQ(plain->left_out, (std::vector<LeftOut>{{"heights", 3}}));
  }
}

TEST(TopoJson, AnArcOfOnePositionIsNotShown) {
  const absl::StatusOr<Model> model = ImportText(
      R"({"type":"Topology","objects":{"a":{"type":"MultiLineString","arcs":[[0],[1]]}},)"
      R"("arcs":[[[0,0],[10,0],[10,10]],[[5,5]]]})",
      false, "map.topojson");
  ASSERT_THAT(model, IsOk());
  EXPECT_EQ(Segments(model->parts[0]).size(), 2u);
  EXPECT_EQ(model->left_out, (std::vector<LeftOut>{{"arcs of one position", 1}}));
}

TEST(GeoJson, ARingThatIsNotClosedIsClosed) {
  const absl::StatusOr<Model> model =
      ImportText(R"({"type":"Polygon","coordinates":[[[0,0],[4,0],[0,4]]]})", false);
  ASSERT_THAT(model, IsOk());
  EXPECT_EQ(Segments(model->parts[0]).size(), 3u);
  EXPECT_EQ(Segments(model->parts[0]).back(), std::pair(Point3({0, 4, 0}), Point3({0, 0, 0})));
}

TEST(GeoJson, FlatLineOverTheDateLineIsSplit) {
  const absl::StatusOr<Model> model = ImportText(Line("[[170,0],[-170,10]]"), false);
  ASSERT_THAT(model, IsOk());
  EXPECT_THAT(Segments(model->parts[0]),
              ElementsAre(std::pair(Point3{170, 0, 0}, Point3{180, 5, 0}),
                          std::pair(Point3{-180, 5, 0}, Point3{-170, 10, 0})));
}

TEST(GeoJson, LinesOverTheDateLineOfOtherSpellings) {
  const auto segments = [](const std::string& coordinates) {
    const absl::StatusOr<Model> model = ImportText(Line(coordinates), false);
    EXPECT_THAT(model, IsOk());
    return model.ok() ? Segments(model->parts[0]) : std::vector<std::pair<Point3, Point3>>();
  };
  // Westward, through the cut itself, and along it.
  EXPECT_THAT(segments("[[-170,10],[170,0]]"),
              ElementsAre(std::pair(Point3{-170, 10, 0}, Point3{-180, 5, 0}),
                          std::pair(Point3{180, 5, 0}, Point3{170, 0, 0})));
  EXPECT_THAT(segments("[[170,0],[180,5],[-180,5],[-170,10]]"),
              ElementsAre(std::pair(Point3{170, 0, 0}, Point3{180, 5, 0}),
                          std::pair(Point3{-180, 5, 0}, Point3{-170, 10, 0})));
  EXPECT_EQ(segments("[[180,-10],[180,10]]").size(), 1u);
  // Longitudes from 0 to 360: the map is cut at Greenwich.
  EXPECT_THAT(segments("[[350,0],[10,10],[190,10]]"),
              ElementsAre(std::pair(Point3{350, 0, 0}, Point3{360, 5, 0}),
                          std::pair(Point3{0, 5, 0}, Point3{10, 10, 0}),
                          std::pair(Point3{10, 10, 0}, Point3{190, 10, 0})));
  // Longitudes that continue beyond 180 state their direction themselves.
  EXPECT_EQ(segments("[[-10,0],[190,0]]").size(), 1u);
}

// The first line alone could be degrees.
TEST(GeoJson, AProjectedMapIsKnownByAllItsLines) {
  const absl::StatusOr<Model> model = ImportText(
      R"({"type":"MultiLineString","coordinates":[[[-150,0],[150,10]],[[0,0],[500000,20]]]})",
      false);
  ASSERT_THAT(model, IsOk());
  EXPECT_EQ(Segments(model->parts[0]).size(), 2u);
}

TEST(GeoJson, ProjectedMapsAreNotSplit) {
  const absl::StatusOr<Model> model = ImportText(Line("[[-500000,100],[500000,200]]"), false);
  ASSERT_THAT(model, IsOk());
  EXPECT_EQ(Segments(model->parts[0]).size(), 1u);
}

TEST(Globe, PolesLieOnZAndGreenwichInFront) {
  const absl::StatusOr<Model> model = ImportText(
      R"({"type":"MultiPoint","coordinates":[[0,0],[90,0],[180,0],[-90,0],[12,90],[0,-90],[0,45]]})",
      true);
  ASSERT_THAT(model, IsOk());
  EXPECT_TRUE(model->globe);
  EXPECT_EQ(model->up, Up::kZ);
  const double half = std::sqrt(0.5);
  const std::vector<Point3> expected = {{0, -1, 0}, {1, 0, 0},  {0, 1, 0},       {-1, 0, 0},
                                        {0, 0, 1},  {0, 0, -1}, {0, -half, half}};
  ASSERT_EQ(model->parts[0].positions.size(), expected.size());
  for (size_t i = 0; i < expected.size(); ++i)
    EXPECT_LT(Distance(model->parts[0].positions[i], expected[i]), 1e-12) << i;
}

TEST(Globe, LongEdgesFollowTheSphere) {
  const absl::StatusOr<Model> model = ImportText(Line("[[0,60],[90,60]]"), true);
  ASSERT_THAT(model, IsOk());
  EXPECT_EQ(Segments(model->parts[0]).size(), 45u);
  for (const Point3& p : model->parts[0].positions) {
    EXPECT_NEAR(std::hypot(p.x, p.y, p.z), 1, 1e-12);
    EXPECT_NEAR(p.z, std::sin(M_PI / 3), 1e-12);
  }
}

TEST(Globe, TheShortWayOverTheDateLine) {
  const absl::StatusOr<Model> model = ImportText(Line("[[179,0],[-179,0]]"), true);
  ASSERT_THAT(model, IsOk());
  for (const Point3& p : model->parts[0].positions) EXPECT_GT(p.y, 0.99);
}

TEST(Globe, EdgesOfThePaperAreLeftOut) {
  const absl::StatusOr<Model> model =
      ImportText(Line("[[-180,-70],[-180,-90],[180,-90],[180,-70],[170,-70]]"), true);
  ASSERT_THAT(model, IsOk());
  EXPECT_EQ(Segments(model->parts[0]).size(), 5u);  // only the last edge, in steps of 2°
}

TEST(Globe, WantsDegrees) {
  EXPECT_THAT(ImportText(Line("[[500000,100],[500100,200]]"), true),
              Fails(Words{"500000", "projected"}));
  EXPECT_THAT(ImportText(Line("[[0,91],[0,0]]"), true), Fails(Words{"91"}));
}

TEST(TopoJson, DecodesDeltasAndTransformAndDrawsSharedArcsOnce) {
  const absl::StatusOr<Model> model = ReadHere(DataFile("quad.topojson"), {});
  ASSERT_THAT(model, IsOk());
  EXPECT_EQ(model->format, "TopoJSON");
  ASSERT_EQ(model->parts.size(), 2u);
  EXPECT_THAT(Segments(model->parts[0]),
              ElementsAre(std::pair(Point3{-10, 20, 0}, Point3{-10, 21, 0}),  // arc 0, shared
                          std::pair(Point3{-10, 21, 0}, Point3{-11, 21, 0}),
                          std::pair(Point3{-11, 21, 0}, Point3{-11, 20, 0}),  // arc 1
                          std::pair(Point3{-11, 20, 0}, Point3{-10, 20, 0}),
                          std::pair(Point3{-10, 20, 0}, Point3{-9, 20, 0}),  // arc 2
                          std::pair(Point3{-9, 20, 0}, Point3{-9, 21, 0}),
                          std::pair(Point3{-9, 21, 0}, Point3{-10, 21, 0})));
  EXPECT_THAT(model->parts[1].positions, ElementsAre(Point3{-8, 22, 0}));
}

TEST(TopoJson, WithoutTransformArcsAreAbsolute) {
  const absl::StatusOr<Model> good = ImportText(
      R"({"type":"Topology","objects":{"a":{"type":"LineString","arcs":[-1]}},"arcs":[[[1,2],[3,4]]]})",
      false, "map.topojson");
  ASSERT_THAT(good, IsOk());
  EXPECT_THAT(Segments(good->parts[0]), ElementsAre(std::pair(Point3{1, 2, 0}, Point3{3, 4, 0})));
}

TEST(WorldAtlas, CountriesOnTheGlobe) {
  const absl::StatusOr<Model> model =
      ReadHere(std::string(VOXELD_DATA_DIR) + "/world-atlas/countries-50m.json", {.globe = true});
  ASSERT_THAT(model, IsOk()) << "tools/setup fetches world-atlas into build/data";
  ASSERT_EQ(model->parts.size(), 1u);
  const Part& part = model->parts[0];
  EXPECT_GT(part.positions.size(), 80000u);
  double longest = 0;
  for (const auto& [a, b] : Segments(part)) longest = std::max(longest, Distance(a, b));
  // No chord through the Earth: each edge spans at most 2° in each coordinate.
  EXPECT_LT(longest, 2 * std::sin(1.5 * M_PI / 180));
  // Dakar (14.7 N, 17.5 W), on Africa's west coast, is close to some point, in front and to the
  // left.
  const Point3 dakar = {std::cos(14.7 * M_PI / 180) * std::sin(-17.5 * M_PI / 180),
                        -std::cos(14.7 * M_PI / 180) * std::cos(17.5 * M_PI / 180),
                        std::sin(14.7 * M_PI / 180)};
  double nearest = 2;
  for (const Point3& p : part.positions) nearest = std::min(nearest, Distance(p, dakar));
  EXPECT_LT(nearest, 0.01);
}

TEST(WorldAtlas, LandOnAFlatMap) {
  const absl::StatusOr<Model> model =
      ReadHere(std::string(VOXELD_DATA_DIR) + "/world-atlas/land-110m.json", {});
  ASSERT_THAT(model, IsOk()) << "tools/setup fetches world-atlas into build/data";
  // No line runs across the map: lines that cross the date line were split.
  for (const auto& [a, b] : Segments(model->parts[0])) EXPECT_LT(std::abs(a.x - b.x), 60);
}

struct BadMap {
  const char* name;
  std::string text;
  Words words;
};

class BadMaps : public testing::TestWithParam<BadMap> {};

TEST_P(BadMaps, AreRefusedWithWords) {
  TempFolder folder;
  const std::string path = folder.Write("bad.json", GetParam().text);
  Words words = GetParam().words;
  words.push_back(path);
  EXPECT_THAT(ReadHere(path, {}), Fails(words));
}

std::string Topology(const std::string& objects, const std::string& arcs) {
  return R"({"type":"Topology","objects":)" + objects + R"(,"arcs":)" + arcs + "}";
}

INSTANTIATE_TEST_SUITE_P(
    Table, BadMaps,
    testing::Values(
        BadMap{"white", "   \n ", {"nothing but white space"}},
        BadMap{"picture", "GIF89a", {"a GIF picture", "JSON"}},
        BadMap{"utf16", std::string("\xff\xfe{\0", 4), {"UTF-16 text", "UTF-8"}},
        BadMap{"utf16_big", std::string("\xfe\xff\0{", 4), {"UTF-16 text", "UTF-8"}},
        BadMap{"two_marks", "\xef\xbb\xbf\xef\xbb\xbf{}", {"JSON in UTF-8 is expected"}},
        BadMap{"truncated",
               R"({"type":"FeatureCollection","features":[{"type":)",
               {"unfinished", "truncated"}},
        BadMap{"two_documents",
               "{\"type\":\"Point\",\"coordinates\":[0,0]}\n{\"type\":\"Point\",\"coordinates\":[1,"
               "0]}\n",
               {"has a second JSON document at byte 38", "FeatureCollection"}},
        BadMap{"malformed", R"({"type":"Point" "coordinates":[0,0]})", {"malformed at byte"}},
        BadMap{"deep",
               std::string(100000, '[') + std::string(100000, ']'),
               {"nests 100000 deep", "64"}},
        BadMap{"deep_unclosed", std::string(1000000, '['), {"nests 1000000 deep"}},
        BadMap{"huge_number", R"({"type":"Point","coordinates":[1e999,0]})", {"out of range"}},
        BadMap{"nan", R"({"type":"Point","coordinates":[NaN,0]})", {"malformed"}},
        BadMap{"no_type", R"({"a":1})", {"without a \"type\""}},
        BadMap{"type_is_number", R"({"type":3})", {"without a \"type\""}},
        BadMap{"array", R"([1,2])", {"without a \"type\""}},
        BadMap{"unknown_type",
               R"({"type":"Blob\u001b[31m"})",
               {"Blob\\u{1b}[31m", "FeatureCollection"}},
        BadMap{"no_coordinates", R"({"type":"LineString"})", {"document.coordinates"}},
        BadMap{"words_for_numbers",
               R"({"type":"LineString","coordinates":[[0,0],["a",1]]})",
               {"document.coordinates[1]", "[longitude, latitude]"}},
        BadMap{"one_number",
               R"({"type":"Feature","geometry":{"type":"Point","coordinates":[1]}})",
               {"document.geometry.coordinates"}},
        BadMap{"features_no_array",
               R"({"type":"FeatureCollection","features":{}})",
               {"document.features"}},
        BadMap{
            "nothing", R"({"type":"FeatureCollection","features":[]})", {"no line and no point"}},
        BadMap{"arc_out_of_range",
               Topology(R"({"a":{"type":"LineString","arcs":[1]}})", "[[[0,0],[1,1]]]"),
               {"objects.a.arcs", "arc 1", "there are 1 arcs"}},
        BadMap{"arc_backwards_out_of_range",
               Topology(R"({"a":{"type":"Polygon","arcs":[[-3]]}})", "[[[0,0],[1,1]]]"),
               {"arc -3"}},
        BadMap{"arc_absurd",
               Topology(R"({"a":{"type":"LineString","arcs":[9223372036854775807]}})",
                        "[[[0,0],[1,1]]]"),
               {"9223372036854775807"}},
        BadMap{"arc_text",
               Topology(R"({"a":{"type":"LineString","arcs":["x"]}})", "[[[0,0],[1,1]]]"),
               {"objects.a.arcs"}},
        BadMap{"arc_short",
               Topology(R"({"a":{"type":"LineString","arcs":[0]}})", "[[[0,0]]]"),
               {"no line and no point"}},
        BadMap{"no_arcs", R"({"type":"Topology","objects":{}})", {"arcs"}},
        BadMap{"no_objects", R"({"type":"Topology","arcs":[]})", {"objects"}},
        BadMap{"transform",
               R"({"type":"Topology","objects":{},"arcs":[],"transform":{"scale":[1]}})",
               {"transform"}}),
    [](const auto& info) { return info.param.name; });

}  // namespace
}  // namespace voxeld::voxelctl
