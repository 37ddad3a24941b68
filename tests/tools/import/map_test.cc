// Tests shapefiles, GPX and KML, flat and on the globe.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "tests/tools/import/read_here.h"
#include "tests/tools/voxelctl/status_matchers.h"
#include "tests/tools/voxelctl/temp_folder.h"
#include "tools/import/gdal_map.h"
#include "tools/voxelctl/import/importer.h"

namespace voxeld::voxelctl {
namespace map_test {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::IsNan;
using ::testing::UnorderedElementsAre;

// Numbers in both byte orders.
template <typename T>
std::string Little(T value) {
  return std::string(reinterpret_cast<const char*>(&value), sizeof(value));
}
std::string Big(uint32_t value) { return Little(__builtin_bswap32(value)); }

// Returns a file according to ESRI's Shapefile Technical Description (1998): a header of 100 bytes
// with the length in words of 16 bits, the shape type and eight bounds, then records: number and
// length (big-endian), type and contents (little-endian).
std::string Shapefile(uint32_t type, const std::vector<std::string>& shapes) {
  std::string records;
  for (size_t i = 0; i < shapes.size(); ++i) {
    absl::StrAppend(&records, Big(static_cast<uint32_t>(i + 1)),
                    Big(static_cast<uint32_t>(shapes[i].size() / 2)), shapes[i]);
  }
  std::string out = Big(9994) + std::string(20, '\0') +
                    Big(static_cast<uint32_t>(50 + records.size() / 2)) + Little<uint32_t>(1000) +
                    Little(type);
  for (const double bound : {-180., -90., 180., 90., 0., 0., 0., 0.}) out += Little(bound);
  return out + records;
}

using Line = std::vector<std::array<double, 2>>;

// Returns the contents of a record: type 3 is a line, 5 an area; bounds, numbers of parts and
// points, where parts begin, points.
std::string Shape(uint32_t type, const std::vector<Line>& parts) {
  std::string begins, points;
  uint32_t count = 0;
  for (const Line& part : parts) {
    begins += Little(count);
    count += static_cast<uint32_t>(part.size());
    for (const auto& [x, y] : part) points += Little(x) + Little(y);
  }
  std::string bounds;
  for (const double bound : {-180., -90., 180., 90.}) bounds += Little(bound);
  return Little(type) + bounds + Little(static_cast<uint32_t>(parts.size())) + Little(count) +
         begins + points;
}

std::string PointShape(double x, double y) { return Little<uint32_t>(1) + Little(x) + Little(y); }

// dBASE III: header, a descriptor of 32 bytes for each field (name, type, length, decimals), and records of text.
struct Field {
  std::string name;
  char type;
  uint8_t size, decimals;
};
std::string Dbf(const std::vector<Field>& fields, const std::vector<std::string>& rows) {
  uint16_t width = 1;
  std::string described;
  for (const Field& field : fields) {
    std::string one = field.name;
    one.resize(11, '\0');
    one += field.type + std::string(4, '\0') + static_cast<char>(field.size) +
           static_cast<char>(field.decimals);
    one.resize(32, '\0');
    described += one;
    width = static_cast<uint16_t>(width + field.size);
  }
  std::string out = std::string("\x03\x7a\x01\x01", 4) +
                    Little(static_cast<uint32_t>(rows.size())) +
                    Little(static_cast<uint16_t>(33 + described.size())) + Little(width) +
                    std::string(20, '\0') + described + "\r";
  for (const std::string& row : rows) out += " " + row;
  return out + "\x1a";
}

// UTM zone 33N as written by ESRI.
constexpr char kUtm[] =
    R"(PROJCS["WGS_1984_UTM_Zone_33N",GEOGCS["GCS_WGS_1984",DATUM["D_WGS_1984",)"
    R"(SPHEROID["WGS_1984",6378137.0,298.257223563]],PRIMEM["Greenwich",0.0],)"
    R"(UNIT["Degree",0.0174532925199433]],PROJECTION["Transverse_Mercator"],)"
    R"(PARAMETER["False_Easting",500000.0],PARAMETER["False_Northing",0.0],)"
    R"(PARAMETER["Central_Meridian",15.0],PARAMETER["Scale_Factor",0.9996],)"
    R"(PARAMETER["Latitude_Of_Origin",0.0],UNIT["Meter",1.0]])";

std::vector<std::pair<Point3, Point3>> Segments(const Part& part) {
  std::vector<std::pair<Point3, Point3>> segments;
  for (size_t i = 0; i + 1 < part.indices.size(); i += 2)
    segments.emplace_back(part.positions[part.indices[i]], part.positions[part.indices[i + 1]]);
  return segments;
}

std::vector<double> ValuesOf(const Part& part, const std::string& name) {
  for (const Attribute& one : part.attributes) {
    if (one.name == name) return one.values;
  }
  return {};
}

std::string Kml(const std::string& inside) {
  return R"(<?xml version="1.0"?><kml xmlns="http://www.opengis.net/kml/2.2"><Document>)" + inside +
         "</Document></kml>";
}
std::string Gpx(const std::string& inside) {
  return R"(<?xml version="1.0"?><gpx version="1.1" creator="x" xmlns="http://www.topografix.com/GPX/1/1">)" +
         inside + "</gpx>";
}

class Maps : public testing::Test {
 protected:
  absl::StatusOr<Model> Import(const std::string& name, const std::string& bytes,
                               bool globe = false) {
    return ReadHere(folder_.Write(name, bytes), {.globe = globe, .attributes = true});
  }
  std::string Error(const std::string& name, const std::string& bytes, bool globe = false) {
    return std::string(Import(name, bytes, globe).status().message());
  }

  TempFolder folder_;
};

TEST_F(Maps, LinesAndAreasOfAShapefile) {
  auto model = Import("a.shp", Shapefile(3, {Shape(3, {{{0, 0}, {10, 0}}, {{20, 5}, {30, 5}}})}));
  ASSERT_THAT(model, IsOk());
  EXPECT_EQ(model->format, "Shapefile");
  EXPECT_EQ(model->up, Up::kY);
  EXPECT_THAT(Segments(model->parts.at(0)),
              ElementsAre(std::pair(Point3{0, 0, 0}, Point3{10, 0, 0}),
                          std::pair(Point3{20, 5, 0}, Point3{30, 5, 0})));
  // An area with a hole: outer rings run clockwise.
  const std::string area =
      Shape(5, {{{0, 0}, {0, 9}, {9, 9}, {9, 0}, {0, 0}}, {{2, 2}, {4, 2}, {4, 4}, {2, 2}}});
  model = Import("a.shp", Shapefile(5, {area, Little<uint32_t>(0)}));
  ASSERT_THAT(model, IsOk());
  EXPECT_EQ(Segments(model->parts.at(0)).size(), 7u);
  EXPECT_EQ(model->left_out, (std::vector<LeftOut>{{"features without a geometry", 1}}));
}

TEST_F(Maps, NumbersBesideAShapefile) {
  folder_.Write("a.dbf", Dbf({{"NAME", 'C', 4, 0}, {"POP", 'N', 6, 0}, {"RATE", 'F', 5, 2}},
                             {"aaaa   120 1.50", "bbbb      *****"}));
  const auto model = Import("a.shp", Shapefile(1, {PointShape(1, 2), PointShape(3, 4)}));
  ASSERT_THAT(model, IsOk());
  const Part& part = model->parts.at(0);
  EXPECT_THAT(part.positions, ElementsAre(Point3{1, 2, 0}, Point3{3, 4, 0}));
  EXPECT_THAT(ValuesOf(part, "POP"), ElementsAre(120.f, IsNan()));
  EXPECT_THAT(ValuesOf(part, "RATE"), ElementsAre(1.5f, IsNan()));
  EXPECT_TRUE(ValuesOf(part, "NAME").empty());
  EXPECT_TRUE(part.colors.empty());
}

TEST_F(Maps, FilesBesideWithOtherSpellingAndForbiddenOnes) {
  folder_.Write("B.DBF", Dbf({{"N", 'N', 3, 0}}, {"  7"}));
  const std::string path = folder_.Write("B.SHP", Shapefile(1, {PointShape(1, 2)}));
  auto model = ReadHere(path, {.attributes = true});
  ASSERT_THAT(model, IsOk());
  EXPECT_THAT(ValuesOf(model->parts.at(0), "N"), ElementsAre(7.f));
  model = ReadHere(path, {.attributes = true, .other_files = OtherFiles::kNone});
  ASSERT_THAT(model, IsOk());
  EXPECT_TRUE(model->parts.at(0).attributes.empty());
}

// At the equator, 500,000 m east in zone 33 is longitude 15; the other place was computed with the
// series of Krüger (to n³) for 52° N, 16° E.
TEST_F(Maps, ProjectedCoordinatesGoOnTheGlobe) {
  const std::string shape =
      Shapefile(1, {PointShape(500000, 0), PointShape(568649.705, 5761510.317)});
  folder_.Write("a.prj", kUtm);
  auto model = Import("a.shp", shape, true);
  ASSERT_THAT(model, IsOk());
  const auto on_sphere = [](double lon, double lat) {
    lon *= M_PI / 180, lat *= M_PI / 180;
    return Point3{std::cos(lat) * std::sin(lon), -std::cos(lat) * std::cos(lon), std::sin(lat)};
  };
  const std::vector<Point3>& at = model->parts.at(0).positions;
  ASSERT_EQ(at.size(), 2u);
  EXPECT_NEAR(at[0].x, on_sphere(15, 0).x, 1e-9);
  EXPECT_NEAR(at[0].y, on_sphere(15, 0).y, 1e-9);
  EXPECT_NEAR(at[1].x, on_sphere(16, 52).x, 1e-6);
  EXPECT_NEAR(at[1].z, on_sphere(16, 52).z, 1e-6);
  // A flat map is in metres, so that a town keeps its proportions.
  model = Import("a.shp", shape);
  ASSERT_THAT(model, IsOk());
  EXPECT_EQ(model->parts.at(0).positions[0], (Point3{500000, 0, 0}));
  // Without a .prj, the meaning of the metres is unknown.
  EXPECT_THAT(Error("b.shp", shape, true), HasSubstr("the map is projected"));
  folder_.Write("c.prj", R"(LOCAL_CS["a ship's grid",UNIT["Meter",1.0]])");
  EXPECT_THAT(Error("c.shp", shape, true),
              HasSubstr("its coordinate system a ship's grid cannot become longitude"));
}

TEST_F(Maps, InTheSandboxOfTheProgram) {
  folder_.Write("a.prj", kUtm);
  folder_.Write("a.dbf", Dbf({{"N", 'N', 3, 0}}, {"  7"}));
  const auto model =
      ImportFile(folder_.Write("a.shp", Shapefile(1, {PointShape(500000, 0)})), {.globe = true});
  ASSERT_THAT(model, IsOk());
  EXPECT_NEAR(model->parts.at(0).positions.at(0).x, std::sin(15 * M_PI / 180), 1e-9);
}

TEST_F(Maps, ALineOverTheDateLine) {
  const std::string shape = Shapefile(3, {Shape(3, {{{170, 0}, {-170, 10}}})});
  auto model = Import("a.shp", shape);
  ASSERT_THAT(model, IsOk());
  EXPECT_THAT(Segments(model->parts.at(0)),
              ElementsAre(std::pair(Point3{170, 0, 0}, Point3{180, 5, 0}),
                          std::pair(Point3{-180, 5, 0}, Point3{-170, 10, 0})));
  model = Import("a.shp", shape, true);
  ASSERT_THAT(model, IsOk());
  for (const Point3& p : model->parts.at(0).positions) EXPECT_GT(p.y, 0.9);
}

TEST_F(Maps, TracksOfGpx) {
  const auto model =
      Import("a.gpx",
             Gpx(R"(<wpt lat="48" lon="9"><ele>300</ele><name>start</name></wpt>)"
                 R"(<rte><rtept lat="1" lon="2"/><rtept lat="3" lon="4"/></rte>)"
                 R"(<trk><number>3</number><trkseg><trkpt lat="48" lon="9"><ele>300</ele></trkpt>)"
                 R"(<trkpt lat="49" lon="9"><ele>400.5</ele></trkpt></trkseg>)"
                 R"(<trkseg><trkpt lat="50" lon="9"/><trkpt lat="51" lon="9"/></trkseg></trk>)"));
  ASSERT_THAT(model, IsOk());
  EXPECT_EQ(model->format, "GPX");
  ASSERT_EQ(model->parts.size(), 2u);
  EXPECT_THAT(Segments(model->parts[0]),
              ElementsAre(std::pair(Point3{2, 1, 0}, Point3{4, 3, 0}),
                          std::pair(Point3{9, 48, 0}, Point3{9, 49, 0}),
                          std::pair(Point3{9, 50, 0}, Point3{9, 51, 0})));
  EXPECT_THAT(model->parts[1].positions, ElementsAre(Point3{9, 48, 0}));
  EXPECT_EQ(ValuesOf(model->parts[0], "height").at(2), 300.f);
  EXPECT_EQ(ValuesOf(model->parts[0], "height").at(3), 400.5f);
  EXPECT_THAT(ValuesOf(model->parts[0], "number"),
              ElementsAre(IsNan(), IsNan(), 3.f, 3.f, 3.f, 3.f));
  EXPECT_THAT(model->left_out, IsEmpty());
}

TEST_F(Maps, PlacesOfGpxThatAreNone) {
  const auto error = [this](const std::string& point) {
    return std::string(ReadHere(folder_.Write("a.gpx", Gpx(point)), {}).status().message());
  };
  EXPECT_THAT(
      error("\n<wpt lat=\"abc\" lon=\"9\"/>"),
      HasSubstr("line 2 has a <wpt> with lat=\"abc\"; degrees from -90 to 90 are expected"));
  EXPECT_THAT(error(R"(<rte><rtept lat="1" lon=""/></rte>)"), HasSubstr("<rtept> with lon=\"\""));
  EXPECT_THAT(error(R"(<trk><trkseg><trkpt lat="1"/></trkseg></trk>)"),
              HasSubstr("<trkpt> without lon; degrees from -180 to 180"));
  EXPECT_THAT(error(R"(<wpt lat="91" lon="9"/>)"), HasSubstr("with lat=\"91\""));
  EXPECT_THAT(error(R"(<wpt lat="nan" lon="9"/>)"), HasSubstr("with lat=\"nan\""));
}

// The library gives elements and data the same names.
TEST_F(Maps, DataOfKmlMayHaveTheNamesOfElements) {
  for (const std::string name : {"icon", "visibility", "begin", "drawOrder", "Name"}) {
    const auto model = Import(
        "a.kml", Kml(absl::StrCat("<Placemark><ExtendedData><Data name=\"", name,
                                  "\"><value>0</value></Data></ExtendedData>"
                                  "<Point><coordinates>1,2</coordinates></Point></Placemark>")));
    ASSERT_THAT(model, IsOk()) << name;
    ASSERT_EQ(model->parts.size(), 1u) << name;
    EXPECT_THAT(ValuesOf(model->parts[0], name), ElementsAre(0)) << name;
    EXPECT_THAT(model->left_out, IsEmpty()) << name;
  }
}

TEST_F(Maps, HeightsThatNothingShowsAreCounted) {
  const auto model = ReadHere(
      folder_.Write("a.gpx", Gpx(R"(<trk><trkseg><trkpt lat="48" lon="9"><ele>300</ele></trkpt>)"
                                 R"(<trkpt lat="49" lon="9"><ele>400.5</ele></trkpt>)"
                                 R"(<trkpt lat="50" lon="9"/></trkseg></trk>)")),
      {});
  ASSERT_THAT(model, IsOk());
  EXPECT_EQ(model->left_out, (std::vector<LeftOut>{{"heights", 2}}));
}

TEST_F(Maps, ColoursAndNumbersOfKml) {
  // KML writes alpha, blue, green, red.
  const auto model = Import(
      "a.kml",
      Kml(R"(<Style id="s"><LineStyle><color>ff0000ff</color></LineStyle></Style>)"
          R"(<Placemark><styleUrl>#s</styleUrl><ExtendedData><Data name="n"><value>5</value></Data>)"
          R"(</ExtendedData><LineString><coordinates>0,0,7 10,0,0</coordinates></LineString></Placemark>)"
          R"(<Placemark><Style><LineStyle><color>8000ff00</color></LineStyle></Style>)"
          R"(<LineString><coordinates>0,5 10,5</coordinates></LineString></Placemark>)"
          R"(<Placemark><Style><PolyStyle><color>ffff0000</color></PolyStyle></Style><Polygon>)"
          R"(<outerBoundaryIs><LinearRing><coordinates>0,0 1,0 1,1 0,0</coordinates></LinearRing>)"
          R"(</outerBoundaryIs></Polygon></Placemark>)"
          R"(<Placemark><visibility>0</visibility><Point><coordinates>3,3</coordinates></Point></Placemark>)"
          R"(<Placemark><MultiGeometry><Point><coordinates>1,2</coordinates></Point></MultiGeometry></Placemark>)"
          R"(<GroundOverlay><Icon><href>a.png</href></Icon><LatLonBox><north>1</north><south>0</south>)"
          R"(<east>1</east><west>0</west></LatLonBox></GroundOverlay>)"
          R"(<NetworkLink><Link><href>http://example.com/</href></Link></NetworkLink>)"));
  ASSERT_THAT(model, IsOk());
  ASSERT_EQ(model->parts.size(), 2u);
  EXPECT_THAT(model->parts[0].colors,
              ElementsAre(Rgb{255, 0, 0}, Rgb{255, 0, 0}, Rgb{0, 128, 0}, Rgb{0, 128, 0},
                          Rgb{0, 0, 255}, Rgb{0, 0, 255}, Rgb{0, 0, 255}, Rgb{0, 0, 255}));
  EXPECT_THAT(model->parts[1].positions, ElementsAre(Point3{1, 2, 0}));
  EXPECT_TRUE(ValuesOf(model->parts[0], "tessellate").empty());
  const std::vector<double> numbers = ValuesOf(model->parts[0], "n");
  ASSERT_EQ(numbers.size(), 8u);
  EXPECT_EQ(numbers[1], 5.f);
  EXPECT_THAT(numbers[2], IsNan());
  EXPECT_EQ(model->left_out, (std::vector<LeftOut>{{"ground overlays", 1},
                                                   {"network links", 1},
                                                   {"hidden features", 1},
                                                   {"fills of areas", 1}}));
}

// In KML, a feature is visible only if all folders and documents around it are visible, too.
TEST_F(Maps, WhatIsInHiddenFoldersOfKmlIsHidden) {
  const auto line = [](int y, const std::string& before = "") {
    return absl::StrCat("<Placemark>", before, "<LineString><coordinates>0,", y, " 10,", y,
                        "</coordinates></LineString></Placemark>");
  };
  const std::string hidden = "<visibility>0</visibility>";
  const auto model = Import(
      "a.kml",
      Kml("<Folder>" + hidden + line(1) + "<Folder><visibility>1</visibility>" + line(2) +
          "<Placemark><visibility>1</visibility><MultiGeometry><Point><coordinates>1,1"
          "</coordinates></Point></MultiGeometry></Placemark></Folder></Folder><Folder>" +
          line(3) + line(4, hidden) + "<Folder>" + line(5) + "<visibility> false </visibility>" +
          "</Folder><!-- " + hidden + " --></Folder>" + line(6)));
  ASSERT_THAT(model, IsOk());
  ASSERT_EQ(model->parts.size(), 1u);
  EXPECT_THAT(Segments(model->parts[0]),
              UnorderedElementsAre(std::pair(Point3{0, 3, 0}, Point3{10, 3, 0}),
                                   std::pair(Point3{0, 6, 0}, Point3{10, 6, 0})));
  EXPECT_EQ(model->left_out, (std::vector<LeftOut>{{"hidden features", 5}}));
  EXPECT_THAT(Error("a.kml", "<Document>" + hidden + line(1) + "</Document>"),
              HasSubstr("hidden features (1)"));
  // A root without a namespace, and an undeclared prefix.
  const auto loose =
      Import("a.kml", "<kml><Document><gx:balloonVisibility>0</gx:balloonVisibility>" + line(1) +
                          "<Folder>" + hidden + line(2) + "</Folder></Document></kml>");
  ASSERT_THAT(loose, IsOk());
  EXPECT_EQ(Segments(loose->parts.at(0)).size(), 1u);
  EXPECT_EQ(loose->left_out, (std::vector<LeftOut>{{"hidden features", 1}}));
}

TEST_F(Maps, StylesOfKmlThatAreNotShownAreCounted) {
  const auto model = Import(
      "a.kml",
      Kml(R"(<Style id="s"><LineStyle><color>ff0000ff</color><width>4</width></LineStyle>)"
          R"(<IconStyle><scale>2</scale><Icon><href>a.png</href></Icon></IconStyle></Style>)"
          R"(<Style id="plain"><LineStyle><color>ff0000ff</color><width>1</width></LineStyle>)"
          R"(<IconStyle><color>ff00ff00</color><scale>1</scale></IconStyle></Style>)"
          R"(<Placemark><styleUrl>#s</styleUrl><LineString><coordinates>0,0 9,0</coordinates></LineString></Placemark>)"
          R"(<Placemark><styleUrl>#s</styleUrl><Point><coordinates>1,1</coordinates></Point></Placemark>)"
          R"(<Placemark><styleUrl>#plain</styleUrl><LineString><coordinates>0,0 9,0</coordinates></LineString></Placemark>)"
          R"(<Placemark><styleUrl>#plain</styleUrl><Point><coordinates>1,1</coordinates></Point></Placemark>)"
          R"(<gx:Tour xmlns:gx="http://www.google.com/kml/ext/2.2"><gx:Playlist/></gx:Tour>)"
          R"(<!-- <NetworkLink/> -->)"));
  ASSERT_THAT(model, IsOk());
  EXPECT_EQ(
      model->left_out,
      (std::vector<LeftOut>{
          {"tours", 1}, {"widths of lines", 1}, {"sizes of points", 1}, {"symbols of points", 1}}));
}

TEST_F(Maps, ColoursOfGpxTracksAreCounted) {
  const std::string segment =
      R"(<trkseg><trkpt lat="0" lon="0"><extensions><hr>90</hr></extensions></trkpt>)"
      R"(<trkpt lat="5" lon="10"/></trkseg>)";
  const auto model = Import(
      "a.gpx",
      Gpx(R"(<trk><extensions><g:TrackExtension xmlns:g="http://www.garmin.com/xmlschemas/GpxExtensions/v3">)"
          R"(<g:DisplayColor>Red</g:DisplayColor></g:TrackExtension></extensions>)" +
          segment + R"(</trk><trk><extensions><color>#00ff00</color></extensions>)" + segment +
          "</trk><trk>" + segment + "</trk>"));
  ASSERT_THAT(model, IsOk());
  EXPECT_EQ(Segments(model->parts.at(0)).size(), 3u);
  EXPECT_EQ(model->left_out, (std::vector<LeftOut>{{"colours of tracks", 2}}));
}

TEST_F(Maps, KmlWithoutItsRoot) {
  const std::string placemark =
      "<Placemark><Point><coordinates>1,2</coordinates></Point></Placemark>";
  for (const std::string& text :
       {"<!-- <kml> --><Folder>" + placemark + "</Folder>",
        "<?xml version=\"1.0\"?>\n<Document>" + placemark + "</Document>", placemark}) {
    const auto model = Import("a.kml", text);
    ASSERT_THAT(model, IsOk()) << text;
    EXPECT_THAT(model->parts.at(0).positions, ElementsAre(Point3{1, 2, 0}));
  }
}

TEST_F(Maps, ThatAreWrong) {
  EXPECT_THAT(Error("a.shp", "hello"), HasSubstr("which GDAL does not read as Shapefile"));
  EXPECT_THAT(Error("a.gpx", "<gpx"), HasSubstr("a map in the format GPX is expected"));
  EXPECT_THAT(Error("a.kml", Kml("<Placemark>").substr(0, 80)),
              HasSubstr("which GDAL does not read as KML"));
  EXPECT_THAT(Error("a.gpx", Gpx("")), HasSubstr("no line and no point"));
  EXPECT_THAT(Error("a.kml", Kml("<Placemark><Model id='m'></Model></Placemark>")),
              HasSubstr("no line and no point that is shown: left out: models (1)"));
  EXPECT_THAT(Error("a.gpx", Gpx(R"(<wpt lat="1" lon="2"/><trk)")), HasSubstr("a.gpx"));
  std::string deep;
  for (int i = 0; i < 10'000; ++i) deep += "<Folder>";
  EXPECT_THAT(Error("a.kml", Kml(deep)), HasSubstr("more than 100 deep"));
  // A Shapefile whose length and whose number of points are too large.
  std::string cut = Shapefile(3, {Shape(3, {{{0, 0}, {10, 0}}})});
  EXPECT_THAT(Error("a.shp", cut.substr(0, cut.size() - 8)), HasSubstr("a.shp"));
  cut.replace(100 + 8 + 40, 4, Little<uint32_t>(0x7fffffff));
  EXPECT_THAT(Error("a.shp", cut), HasSubstr("a.shp"));
}

TEST_F(Maps, TheEnvironmentAndOtherDriversDoNotMatter) {
  // Other formats that GDAL supports are not read, whatever their names say.
  EXPECT_THAT(Error("a.kml",
                    "<OGRVRTDataSource><OGRVRTLayer name='a'><SrcDataSource>/etc/passwd"
                    "</SrcDataSource></OGRVRTLayer></OGRVRTDataSource>"),
              HasSubstr("a map in the format KML is expected"));
  EXPECT_THAT(Error("a.shp", R"({"type":"Point","coordinates":[1,2]})"),
              HasSubstr("a map in the format Shapefile is expected"));
  EXPECT_EQ(std::getenv("GDAL_DRIVER_PATH"), nullptr);
}

TEST_F(Maps, DamagedOnesEndWell) {
  folder_.Write("a.prj", kUtm);
  const std::string dbf = Dbf({{"NAME", 'C', 4, 0}, {"POP", 'N', 6, 0}}, {"aaaa   120"});
  const std::string shape = Shapefile(
      5, {Shape(5, {{{0, 0}, {0, 9}, {9, 9}, {9, 0}, {0, 0}}, {{2, 2}, {4, 2}, {4, 4}, {2, 2}}})});
  const std::string gpx =
      Gpx(R"(<wpt lat="48" lon="9"><ele>300</ele></wpt><trk><trkseg>)"
          R"(<trkpt lat="48" lon="9"/><trkpt lat="49" lon="9"/></trkseg></trk>)");
  const std::string kml = Kml(
      R"(<Style id="s"><LineStyle><color>ff0000ff</color></LineStyle></Style><Placemark>)"
      R"(<styleUrl>#s</styleUrl><LineString><coordinates>0,0 10,0</coordinates></LineString></Placemark>)");
  std::mt19937 random(7);
  const auto damage = [&random](std::string bytes, int i) {
    for (uint32_t k = 1 + random() % 4; k > 0; --k)
      bytes[random() % bytes.size()] = static_cast<char>(random());
    if (i % 4 == 0) bytes.resize(1 + random() % bytes.size());
    return bytes;
  };
  for (const auto& [name, good] : std::vector<std::pair<std::string, std::string>>{
           {"a.shp", shape}, {"a.gpx", gpx}, {"a.kml", kml}}) {
    ASSERT_THAT(Import(name, good), IsOk());
    for (int i = 0; i < 300; ++i) {
      folder_.Write("a.dbf", i % 2 == 0 ? dbf : damage(dbf, i));
      const auto model = Import(name, damage(good, i), i % 3 == 0);
      if (!model.ok()) {
        EXPECT_THAT(model.status().message(), HasSubstr(name));
        EXPECT_LT(model.status().message().size(), 1000u);
      }
    }
  }
}

}  // namespace map_test
}  // namespace voxeld::voxelctl
