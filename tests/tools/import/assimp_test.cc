// Tests formats that assimp reads: colours, textures, what it skips, and single precision.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <zlib.h>
#include <algorithm>

#include <cmath>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_replace.h"
#include "tests/tools/import/read_here.h"
#include "tests/tools/voxelctl/status_matchers.h"
#include "tests/tools/voxelctl/temp_folder.h"
#include "tools/voxelctl/scene/placement.h"

namespace voxeld::voxelctl {
namespace assimp_test {

using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::UnorderedElementsAre;

const std::string kPng("\x89PNG\r\n\x1a\n", 8);

class AssimpFormats : public testing::Test {
 protected:
  Model Good(const std::string& name, const std::string& bytes) {
    absl::StatusOr<Model> model = ReadHere(folder_.Write(name, bytes), {});
    EXPECT_THAT(model, IsOk());
    if (!model.ok()) return Model{.parts = {Part{.positions = {{}}, .colors = {{}}}}};
    return *std::move(model);
  }
  TempFolder folder_;
};

// ---------------------------------------------------------------------------------------- COLLADA, FBX

// A quad; `effect` is the content of <lambert>, `images` an image library, `extra` another source
// of the mesh.
std::string Dae(const std::string& effect, const std::string& positions, bool textured = false) {
  return absl::StrCat(
      "<?xml version='1.0'?><COLLADA xmlns='http://www.collada.org/2005/11/COLLADASchema' "
      "version='1.4.1'><asset><unit name='u' meter='1'/><up_axis>Y_UP</up_axis></asset>",
      textured ? "<library_images><image id='i'><init_from>my%20picture.png</init_from></image>"
                 "</library_images>"
               : "",
      "<library_effects><effect id='e'><profile_COMMON>",
      textured
          ? "<newparam sid='s'><surface type='2D'><init_from>i</init_from></surface></newparam>"
            "<newparam sid='t'><sampler2D><source>s</source></sampler2D></newparam>"
          : "",
      "<technique sid='x'><lambert>", effect,
      "</lambert></technique></profile_COMMON></effect></"
      "library_effects><library_materials><material "
      "id='m'><instance_effect "
      "url='#e'/></material></library_materials><library_geometries><geometry "
      "id='g'><mesh><source id='p'><float_array id='pa' count='12'>",
      positions,
      "</float_array><technique_common><accessor source='#pa' count='4' stride='3'><param name='X' "
      "type='float'/><param name='Y' type='float'/><param name='Z' type='float'/></accessor>"
      "</technique_common></source><source id='u'><float_array id='ua' count='8'>0 0 1 0 1 1 0 "
      "1</float_array><technique_common><accessor source='#ua' count='4' stride='2'><param "
      "name='S' "
      "type='float'/><param name='T' "
      "type='float'/></accessor></technique_common></source><vertices "
      "id='v'><input semantic='POSITION' source='#p'/></vertices><polylist count='1' material='s'>"
      "<input semantic='VERTEX' source='#v' offset='0'/><input semantic='TEXCOORD' source='#u' "
      "offset='0' set='0'/><vcount>4</vcount><p>0 1 2 3</p></polylist></mesh></geometry><geometry "
      "id='h'><spline closed='1'></spline></geometry></library_geometries><library_visual_scenes>"
      "<visual_scene id='sc'><node id='n'><instance_geometry url='#g'><bind_material>"
      "<technique_common><instance_material symbol='s' target='#m'><bind_vertex_input "
      "semantic='UV' "
      "input_semantic='TEXCOORD' input_set='0'/></instance_material></technique_common>"
      "</bind_material></instance_geometry></node></visual_scene></library_visual_scenes><scene>"
      "<instance_visual_scene url='#sc'/></scene></COLLADA>");
}

constexpr char kQuad[] = "0 0 0 1 0 0 1 4 0 0 4 0";

TEST_F(AssimpFormats, ColladaColoursAndLight) {
  const Model red =
      Good("a.dae", Dae("<emission><color>0 0.5 0 1</color></emission><diffuse><color>1 0 0 "
                        "1</color></diffuse>",
                        kQuad));
  EXPECT_EQ(red.parts[0].colors[0], (Rgb{255, 128, 0}));
  EXPECT_THAT(red.left_out, ElementsAre(LeftOut{"splines", 1}));
  const Model grey = Good("a.dae", Dae("<diffuse><color>0.6 0.6 0.6 1</color></diffuse>", kQuad));
  EXPECT_EQ(grey.parts[0].colors[0], (Rgb{153, 153, 153})) << "the file's own grey";
  EXPECT_THAT(Good("a.dae", Dae("", kQuad)).parts[0].colors, IsEmpty()) << "the library's grey";
}

// assimp gives a grey to materials without a diffuse colour, also beside others that have one.
TEST_F(AssimpFormats, ColladaMaterialsThatOnlyEmitLight) {
  const std::string light = "<emission><color>1 0 0 1</color></emission>";
  EXPECT_EQ(Good("a.dae", Dae(light, kQuad)).parts[0].colors.at(0), (Rgb{255, 0, 0}));
  const std::string constant = absl::StrReplaceAll(
      Dae(light, kQuad), {{"<lambert>", "<constant>"}, {"</lambert>", "</constant>"}});
  EXPECT_EQ(Good("a.dae", constant).parts[0].colors.at(0), (Rgb{255, 0, 0}));
  const std::string other = absl::StrReplaceAll(
      Dae(light, kQuad),
      {{"<library_effects>",
        "<library_effects><effect id='other'><profile_COMMON><technique sid='x'><lambert>"
        "<diffuse><color>0 0 1 1</color></diffuse></lambert></technique></profile_COMMON>"
        "</effect>"},
       {"<library_materials>",
        "<library_materials><material id='other'><instance_effect url='#other'/></material>"}});
  EXPECT_EQ(Good("a.dae", other).parts[0].colors.at(0), (Rgb{255, 0, 0}));
  // A colour that is a parameter is not read.
  const Model parameter = Good("a.dae", Dae("<diffuse><param ref='c'/></diffuse>", kQuad));
  EXPECT_THAT(parameter.parts[0].colors, IsEmpty());
  EXPECT_THAT(parameter.left_out, Contains(LeftOut{"colours that are parameters", 1}));
}

// The library gives this name, and often this grey, to materials of its own.
TEST_F(AssimpFormats, MaterialsWithTheNameOfTheLibrarysOwn) {
  const std::string grey = "<diffuse><color>0.6 0.6 0.6 1</color></diffuse>";
  const std::string named = absl::StrReplaceAll(
      Dae(grey, kQuad), {{"<material id='m'>", "<material id='m' name='DefaultMaterial'>"}});
  EXPECT_EQ(Good("a.dae", named).parts[0].colors.at(0), (Rgb{153, 153, 153}));
  const std::string mesh =
      "xof 0303txt 0032\nMesh m {\n4;\n0;0;0;,\n4;0;0;,\n4;1;0;,\n0;1;0;;\n1;\n4;0,1,2,3;;\n";
  const auto x = [&](const std::string& name) {
    return Good("a.x", absl::StrCat(mesh, "MeshMaterialList {1;1;0;;Material ", name,
                                    " {0.6;0.6;0.6;1.0;;0.0;0.0;0.0;0.0;;0.0;0.0;0.0;;}}\n}\n"))
        .parts.at(0)
        .colors;
  };
  EXPECT_EQ(x("DefaultMaterial").at(0), (Rgb{153, 153, 153}));
  EXPECT_EQ(x("grey").at(0), (Rgb{153, 153, 153}));
  EXPECT_THAT(Good("a.x", mesh + "}\n").parts.at(0).colors, IsEmpty()) << "the library's own";
}

TEST_F(AssimpFormats, ColladaOtherScenesAndHolesAreCounted) {
  const std::string scene =
      "<visual_scene id='t'><node id='o'><instance_geometry url='#g'/></node></visual_scene>";
  const Model two =
      Good("a.dae", absl::StrReplaceAll(Dae("", kQuad), {{"<library_visual_scenes>",
                                                          "<library_visual_scenes>" + scene}}));
  EXPECT_EQ(two.parts.size(), 1u);
  EXPECT_THAT(two.left_out,
              UnorderedElementsAre(LeftOut{"other scenes", 1}, LeftOut{"splines", 1}));
  const std::string input = "<input semantic='VERTEX' source='#v' offset='0'/>";
  const auto polygons = [&](const std::string& content) {
    std::string dae = Dae("", kQuad);
    const size_t from = dae.find("<polylist"), to = dae.find("</polylist>") + 11;
    dae.replace(from, to - from,
                absl::StrCat("<polygons count='1' material='s'>", input, content, "</polygons>"));
    return dae;
  };
  const Model filled = Good("a.dae", polygons("<ph><p>0 1 2 3</p><h>0 1 2</h><h\n>1 2 3</h></ph>"));
  EXPECT_EQ(filled.parts.at(0).indices.size(), 6u);
  EXPECT_THAT(filled.left_out, Contains(LeftOut{"holes of polygons, drawn filled", 2}));
  EXPECT_THAT(Good("a.dae", polygons("<p>0 1 2 3</p>")).left_out,
              ElementsAre(LeftOut{"splines", 1}));
}

// assimp takes another's material for them.
TEST_F(AssimpFormats, ColladaElementsWithoutAMaterialAreNoted) {
  const std::string dae = Dae("<diffuse><color>1 0 0 1</color></diffuse>", kQuad);
  EXPECT_THAT(Good("a.dae", dae).note, IsEmpty());
  EXPECT_THAT(Good("a.dae", absl::StrReplaceAll(dae, {{" material='s'>", ">"}})).note,
              HasSubstr("elements without a material (1)"));
}

TEST_F(AssimpFormats, ColoursOfOffThatAreNotShownAreCounted) {
  const std::string corners = "4 1 0\n0 0 0\n4 0 0\n4 1 0\n0 1 0\n";
  EXPECT_THAT(Good("a.off", "OFF\n" + corners + "4 0 1 2 3\n").left_out, IsEmpty());
  for (const char* color : {" 255 0 0", " 1.0 0 0 0.5", " 7"}) {
    EXPECT_THAT(Good("a.off", absl::StrCat("OFF\n", corners, "4 0 1 2 3", color, "\n")).left_out,
                ElementsAre(LeftOut{"colours of faces", 1}))
        << color;
  }
  EXPECT_THAT(
      Good("a.off", "OFF\n3 1 0\n0 0 0 255 0 0\n4 0 0 255 0 0\n0 1 0 255 0 0\n3 0 1 2\n").left_out,
      ElementsAre(LeftOut{"colours of vertices that the header does not announce", 3}));
}

// assimp has readers for many other formats, and looks at what a file holds.
TEST_F(AssimpFormats, NoOtherReaderIsRegistered) {
  const std::string ac3d =
      "AC3Db\nMATERIAL \"m\" rgb 1 0 0 amb 1 1 1 emis 0 0 0 spec 0 0 0 shi 0 trans 0\nOBJECT "
      "world\nkids 1\nOBJECT poly\nname \"q\"\nnumvert 3\n0 0 0\n4 0 0\n4 1 0\nnumsurf 1\nSURF "
      "0x0\nmat 0\nrefs 3\n0 0 0\n1 0 0\n2 0 0\nkids 0\n";
  for (const char* const extension : {"ac", "ac3d", "md2", "ase", "zae"}) {
    EXPECT_THAT(ReadHere(folder_.Write(absl::StrCat("a.", extension), ac3d), {}),
                Fails(Words{"are not read", ".fbx"}))
        << extension;
  }
  for (const char* const extension : {"fbx", "3ds", "lwo", "x", "amf", "blend"})
    EXPECT_FALSE(ReadHere(folder_.Write(absl::StrCat("a.", extension), ac3d), {}).ok())
        << extension;
  const std::string off = "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";
  EXPECT_THAT(ReadHere(folder_.Write("a.off", off), {}), IsOk());
  EXPECT_FALSE(ReadHere(folder_.Write("a.3ds", off), {}).ok());
}

TEST_F(AssimpFormats, ColladaTexturesStandInPlaceOfColours) {
  folder_.Write("my picture.png", kPng);
  const std::string dae =
      Dae("<diffuse><texture texture='t' texcoord='UV'/></diffuse>", kQuad, true);
  const Model model = Good("a.dae", dae);
  ASSERT_THAT(model.pictures, ElementsAre(kPng));
  const Part& part = model.parts[0];
  EXPECT_EQ(part.picture, 0u);
  EXPECT_EQ(part.colors[0], (Rgb{255, 255, 255}));
  // v increases upwards in COLLADA: the lower left corner is (0, 1) on the picture.
  for (size_t v = 0; v < part.positions.size(); ++v) {
    EXPECT_FLOAT_EQ(part.texture_coordinates[v][0], static_cast<float>(part.positions[v].x));
    EXPECT_FLOAT_EQ(part.texture_coordinates[v][1],
                    1 - static_cast<float>(part.positions[v].y) / 4);
  }
  const Model missing = Good("b.dae", absl::StrReplaceAll(dae, {{"my%20picture.png", "gone.png"}}));
  EXPECT_THAT(missing.parts[0].colors, IsEmpty()) << "the library's grey";
  EXPECT_THAT(missing.left_out, Contains(LeftOut{"textures that cannot be read", 1}));
}

TEST_F(AssimpFormats, SinglePrecisionIsReportedBeyondHalfAVoxel) {
  // 16777216 is 2²⁴: halves are lost there. The model is 4 high; half a voxel of 256 is 1/128.
  const Model far = Good("a.dae", Dae("", "9000000 0 0 9000001 0 0 9000001 4 0 9000000 4 0"));
  EXPECT_THAT(far.note, HasSubstr("single precision"));
  EXPECT_THAT(Good("a.dae", Dae("", kQuad)).note, IsEmpty());
  // 100 from its origin: 100·2⁻²⁴ is far below 1/128.
  EXPECT_THAT(Good("a.dae", Dae("", "100 0 0 101 0 0 101 4 0 100 4 0")).note, IsEmpty());
  EXPECT_THAT(
      Good("a.off", "OFF\n3 1 0\n70000000 0 0\n70000032 0 0\n70000032 900 0\n3 0 1 2\n").note,
      HasSubstr("single precision"));
}

// Three corners at distances 1, 2 and 3 from a fourth, along x, y and z: the direction of each of
// them in the display (x right, -y front, z up).
struct Axes {
  Point3 x, y, z;
};
constexpr char kArrow[] = "0 0 0 1 0 0 0 2 0 0 0 3";

Axes AxesInTheDisplay(Model model) {
  PlaceModels({&model, 1}, DisplaySpace(), {});
  // The corner that is nearest to the other three together, and those by their distance from it.
  std::vector<Point3> corners;
  for (const Part& part : model.parts) {
    for (const Point3& p : part.positions) {
      const auto is_there = [&p](const Point3& q) {
        return std::hypot(p.x - q.x, p.y - q.y, p.z - q.z) < 1e-6;
      };
      if (std::none_of(corners.begin(), corners.end(), is_there)) corners.push_back(p);
    }
  }
  EXPECT_EQ(corners.size(), 4u);
  if (corners.size() != 4) return {};
  const auto apart = [](const Point3& a, const Point3& b) {
    return std::hypot(a.x - b.x, a.y - b.y, a.z - b.z);
  };
  const auto sum = [&](const Point3& from) {
    double all = 0;
    for (const Point3& to : corners) all += apart(from, to);
    return all;
  };
  std::sort(corners.begin(), corners.end(),
            [&](const Point3& a, const Point3& b) { return sum(a) < sum(b); });
  const Point3 from = corners[0];
  std::sort(corners.begin(), corners.end(),
            [&](const Point3& a, const Point3& b) { return apart(from, a) < apart(from, b); });
  const double unit = apart(from, corners[1]);
  const auto along = [&](size_t corner) {
    const Point3& to = corners[corner];
    const auto rounded = [&](double length) {
      return std::round(length / unit * 1e5) / 1e5 / static_cast<double>(corner) + 0.0;
    };
    return Point3{rounded(to.x - from.x), rounded(to.y - from.y), rounded(to.z - from.z)};
  };
  return {along(1), along(2), along(3)};
}

void ExpectAxes(const Axes& axes, const Point3& x, const Point3& y, const Point3& z,
                const std::string& what) {
  EXPECT_EQ(axes.x, x) << what;
  EXPECT_EQ(axes.y, y) << what;
  EXPECT_EQ(axes.z, z) << what;
}

// COLLADA 1.4.1 names three axes for each: to the right, up, and to the viewer.
TEST_F(AssimpFormats, ColladaSaysWhichAxisIsUp) {
  const auto axes = [this](const std::string& up) {
    return AxesInTheDisplay(
        Good("a.dae", absl::StrReplaceAll(Dae("", kArrow), {{"<up_axis>Y_UP</up_axis>", up}})));
  };
  for (const char* y_up : {"<up_axis>Y_UP</up_axis>", ""})
    ExpectAxes(axes(y_up), {1, 0, 0}, {0, 0, 1}, {0, -1, 0}, y_up);
  ExpectAxes(axes("<up_axis>Z_UP</up_axis>"), {1, 0, 0}, {0, 1, 0}, {0, 0, 1}, "Z_UP");
  ExpectAxes(axes("<up_axis>X_UP</up_axis>"), {0, 0, 1}, {-1, 0, 0}, {0, -1, 0}, "X_UP");
}

std::string Fbx(const std::string& objects, const std::string& connections) {
  return absl::StrCat(R"(; FBX 7.3.0 project file
FBXHeaderExtension:  {
	FBXHeaderVersion: 1003
	FBXVersion: 7300
}
GlobalSettings:  {
	Version: 1000
	Properties70:  {
	}
}
Definitions:  {
	Version: 100
	Count: 3
}
Objects:  {
	Geometry: 100, "Geometry::", "Mesh" {
		Vertices: *12 {
			a: 0,0,0,1,0,0,1,0,4,0,0,4
		}
		PolygonVertexIndex: *4 {
			a: 0,1,2,-4
		}
		GeometryVersion: 124
		LayerElementUV: 0 {
			Version: 101
			Name: "m"
			MappingInformationType: "ByPolygonVertex"
			ReferenceInformationType: "Direct"
			UV: *8 {
				a: 0,0,1,0,1,1,0,1
			}
		}
		LayerElementMaterial: 0 {
			Version: 101
			Name: ""
			MappingInformationType: "AllSame"
			ReferenceInformationType: "IndexToDirect"
			Materials: *1 {
				a: 0
			}
		}
		Layer: 0 {
			Version: 100
			LayerElement:  {
				Type: "LayerElementUV"
				TypedIndex: 0
			}
			LayerElement:  {
				Type: "LayerElementMaterial"
				TypedIndex: 0
			}
		}
	}
	Model: 200, "Model::bar", "Mesh" {
		Version: 232
		Properties70:  {
		}
	}
)",
                      objects, "}\nConnections:  {\n\tC: \"OO\",200,0\n\tC: \"OO\",100,200\n",
                      connections, "}\n");
}

TEST_F(AssimpFormats, FbxTextures) {
  const std::string material =
      "\tMaterial: 300, \"Material::red\", \"\" {\n\t\tVersion: 102\n\t\tShadingModel: "
      "\"lambert\"\n\t\tProperties70:  {\n\t\t\tP: \"DiffuseColor\", \"Color\", \"\", "
      "\"A\",1,0,0\n\t\t}\n\t}\n";
  const std::string texture =
      "\tTexture: 400, \"Texture::t\", \"\" {\n\t\tType: \"TextureVideoClip\"\n\t\tVersion: "
      "202\n\t\tTextureName: \"Texture::t\"\n\t\tFileName: "
      "\"C:\\\\models\\\\p.png\"\n\t\tRelativeFilename: "
      "\"p.png\"\n\t\tModelUVTranslation: 0,0\n\t\tModelUVScaling: 1,1\n\t}\n";
  const std::string joined = "\tC: \"OO\",300,200\n";
  EXPECT_THAT(Good("a.fbx", Fbx("", "")).parts[0].colors, IsEmpty())
      << "the library's own material";
  EXPECT_EQ(Good("a.fbx", Fbx(material, joined)).parts[0].colors[0], (Rgb{255, 0, 0}));
  folder_.Write("p.png", kPng);
  const Model model =
      Good("a.fbx", Fbx(material + texture, joined + "\tC: \"OP\",400,300, \"DiffuseColor\"\n"));
  ASSERT_THAT(model.pictures, ElementsAre(kPng));
  EXPECT_EQ(model.parts[0].colors[0], (Rgb{255, 255, 255}));
  EXPECT_EQ(model.parts[0].texture_coordinates.size(), model.parts[0].positions.size());
}

// The library shows the part that exists.
TEST_F(AssimpFormats, FilesThatEndTooEarlyAreSaidToDo) {
  const std::string faces =
      "0\nSECTION\n2\nENTITIES\n0\n3DFACE\n8\n0\n10\n0\n20\n0\n30\n0\n11\n1\n21\n0\n"
      "31\n0\n12\n1\n22\n1\n32\n0\n13\n1\n23\n1\n33\n0\n0\nENDSEC\n";
  EXPECT_EQ(Good("a.dxf", faces + "0\nEOF\n").note, "");
  EXPECT_THAT(Good("a.dxf", faces).note, HasSubstr("it ends without EOF"));
  const std::string house = ReadAll(std::string(VOXELD_MODELS_DIR) + "/IFC/AC14-FZK-Haus.ifc");
  EXPECT_EQ(Good("a.ifc", house).note, "");
  EXPECT_THAT(Good("a.ifc", house.substr(0, house.rfind("ENDSEC"))).note,
              HasSubstr("it ends without END-ISO-10303-21"));
}

// The library replaces a missing corner by the first one.
TEST_F(AssimpFormats, FacesOfOffThatAreCutOff) {
  const std::string off = "OFF\n# a comment\n4 2 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n\n3 0 1 2\n";
  EXPECT_THAT(Good("a.off", off + "3 0 2 3 1 0 0").parts, testing::SizeIs(1));
  for (const std::string last : {"", "3", "3 0", "3 0 2", "3 0 2 # 3"}) {
    const auto model = ReadHere(folder_.Write("a.off", off + last), {});
    EXPECT_FALSE(model.ok()) << last;
    EXPECT_THAT(std::string(model.status().message()), HasSubstr("face 2 of 2")) << last;
  }
}

// The library follows a reference to a missing object to address 0.
TEST_F(AssimpFormats, IfcThatRefersToWhatIsMissing) {
  const auto error = [this](const std::string& data) {
    const std::string text =
        absl::StrCat("ISO-10303-21;\nHEADER;\nFILE_SCHEMA(('IFC2X3'));\nENDSEC;\nDATA;\n", data,
                     "\nENDSEC;\nEND-ISO-10303-21;\n");
    return std::string(ReadHere(folder_.Write("a.ifc", text), {}).status().message());
  };
  EXPECT_THAT(error("#1=IFCPROJECT(#2);"), HasSubstr("refers to #2, which it does not define"));
  EXPECT_THAT(error("#1 = IFCPROJECT(#12);\n#2=IFCX(#1);"), HasSubstr("refers to #12"));
  // Texts and comments are not references.
  EXPECT_THAT(error("#1=IFCPROJECT('#7','it''s #8'); /* #9 */"),
              testing::Not(HasSubstr("refers to")));
}

// It examines the contents of a file; its own readers of these formats crash where ours do not.
TEST_F(AssimpFormats, FormatsOfOtherReadersUnderAnotherName) {
  const std::pair<const char*, const char*> files[] = {
      {"ply",
       "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty "
       "float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 "
       "0\n0 1 0\n3 0 1 2\n"},
      {"obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"},
      {"stl",
       "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 "
       "0\nendloop\nendfacet\nendsolid a\n"}};
  for (const auto& [extension, bytes] : files) {
    EXPECT_THAT(ReadHere(folder_.Write(absl::StrCat("a.", extension), bytes), {}), IsOk());
    for (const char* const other : {"xml", "smd"}) {
      const auto model = ReadHere(folder_.Write(absl::StrCat("a.", other), bytes), {});
      EXPECT_FALSE(model.ok()) << extension << " as " << other;
      EXPECT_THAT(std::string(model.status().message()), testing::Not(HasSubstr("crashed")));
    }
  }
}

TEST_F(AssimpFormats, FbxSaysWhichAxisIsUp) {
  const auto axes = [this](const std::string& settings) {
    return AxesInTheDisplay(Good(
        "a.fbx",
        absl::StrReplaceAll(Fbx("", ""),
                            {{"0,0,0,1,0,0,1,0,4,0,0,4", absl::StrReplaceAll(kArrow, {{" ", ","}})},
                             {"\tVersion: 1000\n\tProperties70:  {\n",
                              absl::StrCat("\tVersion: 1000\n\tProperties70:  {\n", settings)}})));
  };
  const auto property = [](const char* name, int value) {
    return absl::StrCat("\t\tP: \"", name, "\", \"int\", \"Integer\", \"\",", value, "\n");
  };
  // As written by Maya and by 3ds Max.
  ExpectAxes(axes(property("UpAxis", 1) + property("UpAxisSign", 1) + property("FrontAxis", 2) +
                  property("FrontAxisSign", 1)),
             {1, 0, 0}, {0, 0, 1}, {0, -1, 0}, "y");
  ExpectAxes(axes(property("UpAxis", 2) + property("UpAxisSign", 1) + property("FrontAxis", 1) +
                  property("FrontAxisSign", -1)),
             {1, 0, 0}, {0, 1, 0}, {0, 0, 1}, "z");
  // Half a turn about x makes an axis that points down point up.
  ExpectAxes(axes(property("UpAxis", 1) + property("UpAxisSign", -1)), {1, 0, 0}, {0, 0, -1},
             {0, 1, 0}, "-y");
  ExpectAxes(axes(property("UpAxis", 2) + property("UpAxisSign", -1)), {1, 0, 0}, {0, -1, 0},
             {0, 0, -1}, "-z");
  EXPECT_EQ(axes(property("UpAxis", 0)).x, (Point3{0, 0, 1}));
  ExpectAxes(axes(""), {1, 0, 0}, {0, 0, 1}, {0, -1, 0}, "nothing");
  ExpectAxes(axes(property("UpAxis", 7)), {1, 0, 0}, {0, 0, 1}, {0, -1, 0}, "an axis that is none");
}

TEST_F(AssimpFormats, FramesOfBvhBeyondTheAnnouncedNumber) {
  const std::string bvh =
      "HIERARCHY\nROOT a\n{\nOFFSET 0 0 0\nCHANNELS 3 Xposition Yposition Zposition\nEnd "
      "Site\n{\nOFFSET 0 4 0\n}\n}\nMOTION\nFrames: 1\nFrame Time: 0.1\n0 0 0\n";
  EXPECT_THAT(Good("a.bvh", bvh).left_out, ElementsAre(LeftOut{"animations", 1}));
  EXPECT_THAT(Good("a.bvh", bvh + "1 0 0\n2 0 0\n").left_out,
              Contains(LeftOut{"frames beyond the announced number", 2}));
  EXPECT_THAT(Good("a.bvh", absl::StrReplaceAll(bvh + "1 0 0\n", {{"\n", "\r"}})).left_out,
              Contains(LeftOut{"frames beyond the announced number", 1}));
}

// ------------------------------------------------------------------------------------------------ 3MF

std::string Zip(const std::vector<std::pair<std::string, std::string>>& entries) {
  const auto number = [](uint64_t value, size_t bytes) {
    std::string text(reinterpret_cast<const char*>(&value), std::min(bytes, sizeof(value)));
    text.resize(bytes, '\0');
    return text;
  };
  std::string out, directory;
  for (const auto& [name, bytes] : entries) {
    const uint64_t crc =
        ::crc32(0, reinterpret_cast<const Bytef*>(bytes.data()), static_cast<uInt>(bytes.size()));
    const std::string common =
        absl::StrCat(number(20, 2), number(0, 8), number(crc, 4), number(bytes.size(), 4),
                     number(bytes.size(), 4), number(name.size(), 2), number(0, 2));
    absl::StrAppend(&directory, "PK\x01\x02", number(20, 2), common, number(0, 10),
                    number(out.size(), 4), name);
    absl::StrAppend(&out, "PK\x03\x04", common, name, bytes);
  }
  return absl::StrCat(out, directory, "PK\x05\x06", number(0, 4), number(entries.size(), 2),
                      number(entries.size(), 2), number(directory.size(), 4), number(out.size(), 4),
                      number(0, 2));
}

// A tetrahedron; `triangles` are the properties of each of its four triangles.
std::string ThreeMf(const std::string& resources, const std::string& object,
                    const std::vector<std::string>& triangles, const std::string& more = "",
                    const std::string& item = "", const std::string& unit = "unit='millimeter'") {
  static constexpr const char* kCorners[] = {"v1='0' v2='2' v3='1'", "v1='0' v2='1' v3='3'",
                                             "v1='1' v2='2' v3='3'", "v1='0' v2='3' v3='2'"};
  std::string all;
  for (size_t i = 0; i < 4; ++i)
    absl::StrAppend(&all, "<triangle ", kCorners[i], " ", i < triangles.size() ? triangles[i] : "",
                    "/>");
  return Zip(
      {{"[Content_Types].xml",
        "<?xml version='1.0'?><Types "
        "xmlns='http://schemas.openxmlformats.org/package/2006/content-types'/>"},
       {"_rels/.rels",
        "<?xml version='1.0' encoding='UTF-8'?><Relationships "
        "xmlns='http://schemas.openxmlformats.org/package/2006/relationships'><Relationship "
        "Target='/3D/3dmodel.model' Id='r' "
        "Type='http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel'/></Relationships>"},
       {"3D/3dmodel.model",
        absl::StrCat(
            "<?xml version='1.0' encoding='UTF-8'?><model ", unit,
            " xmlns='http://schemas.microsoft.com/3dmanufacturing/core/2015/02' "
            "xmlns:m='http://schemas.microsoft.com/3dmanufacturing/material/2015/02'><resources>",
            resources, "<object id='1' type='model' ", object,
            "><mesh><vertices><vertex x='0' y='0' z='0'/><vertex x='1' y='0' z='0'/><vertex x='0' "
            "y='1' z='0'/><vertex x='0' y='0' z='1'/></vertices><triangles>",
            all, "</triangles></mesh></object>", more, "</resources><build><item objectid='1' ",
            item, "/></build></model>")},
       {"3D/Textures/a.png", kPng}});
}

Rgb ColorOfTriangle(const Part& part, size_t triangle) {
  return part.colors[part.indices[3 * triangle]];
}

const char kBases[] =
    "<basematerials id='5'><base name='a' displaycolor='#FF0000'/><base name='b' "
    "displaycolor='#00FF00FF'/></basematerials>";

TEST_F(AssimpFormats, ThreeMfBaseMaterialsOfEveryTriangle) {
  const Part part = Good("a.3mf", ThreeMf(kBases, "pid='5' pindex='0'",
                                          {"", "pid='5' p1='1'", "pid='5' p1='1' p2='0'", ""}))
                        .parts.at(0);
  ASSERT_EQ(part.indices.size(), 12u);
  EXPECT_EQ(ColorOfTriangle(part, 0), (Rgb{255, 0, 0}));
  EXPECT_EQ(ColorOfTriangle(part, 1), (Rgb{0, 255, 0}));
  EXPECT_EQ(part.colors[part.indices[7]], (Rgb{0, 255, 0})) << "one material a triangle";
  EXPECT_EQ(ColorOfTriangle(part, 3), (Rgb{255, 0, 0}));
  for (size_t v = 0; v < part.positions.size(); ++v)
    EXPECT_NEAR(std::hypot(part.normals[v].x, part.normals[v].y, part.normals[v].z), 1, 1e-9);
}

TEST_F(AssimpFormats, ThreeMfColourGroupsOfEveryCorner) {
  const std::string group =
      "<m:colorgroup id='7'><m:color color='#0000FF'/><m:color color='#FFFF0080'/></m:colorgroup>";
  const Model model =
      Good("a.3mf", ThreeMf(kBases + group, "pid='7' pindex='0'",
                            {"", "p1='0' p2='1' p3='0'", "pid='5' p1='0'", "pid='9' p1='0'"}));
  // The last triangle's group does not exist: it has no colour.
  ASSERT_EQ(model.parts.size(), 2u);
  EXPECT_THAT(model.parts[0].colors, IsEmpty());
  EXPECT_EQ(model.parts[0].indices.size(), 3u);
  const Part& part = model.parts[1];
  EXPECT_EQ(ColorOfTriangle(part, 0), (Rgb{0, 0, 255}));
  EXPECT_EQ(part.colors[part.indices[4]], (Rgb{255, 255, 0}));
  EXPECT_EQ(part.colors[part.indices[5]], (Rgb{0, 0, 255}));
  EXPECT_EQ(ColorOfTriangle(part, 2), (Rgb{255, 0, 0}));
  EXPECT_THAT(model.left_out, ElementsAre(LeftOut{"transparency of materials", 1}));
}

TEST_F(AssimpFormats, ThreeMfTextureGroups) {
  const std::string group =
      "<m:texture2d id='3' path='/3D/Textures/a.png' contenttype='image/png'/><m:texture2dgroup "
      "id='4' texid='3'><m:tex2coord u='0' v='0'/><m:tex2coord u='1' v='0'/><m:tex2coord u='0' "
      "v='0.75'/></m:texture2dgroup>";
  const Model model = Good("a.3mf", ThreeMf(group, "", {"pid='4' p1='0' p2='1' p3='2'"}));
  ASSERT_THAT(model.pictures, ElementsAre(kPng));
  ASSERT_EQ(model.parts.size(), 2u) << "three triangles have no property";
  const Part& part = model.parts[1];
  ASSERT_EQ(part.picture, 0u);
  const auto at = [&part](size_t corner) { return part.texture_coordinates[part.indices[corner]]; };
  // v increases upwards in 3MF.
  EXPECT_EQ(at(0), (std::array<float, 2>{0, 1}));
  EXPECT_EQ(at(1), (std::array<float, 2>{1, 1}));
  EXPECT_EQ(at(2), (std::array<float, 2>{0, 0.25}));
}

// The core specification writes vectors as rows: a component's matrix is applied before that of its
// item.
TEST_F(AssimpFormats, ThreeMfItemsAndComponents) {
  const Model model = Good(
      "a.3mf",
      ThreeMf(
          "", "", {},
          "<object id='2'><components><component objectid='1' transform='1 0 0 0 1 0 0 0 1 10 0 "
          "0'/><component objectid='1' transform='3 0 0 0 3 0 0 0 3 20 0 0'/></components>"
          "</object><object id='3'><components><component objectid='2' transform='1 0 0 0 1 0 0 "
          "0 1 0 0 100'/></components></object>",
          // x becomes y and y becomes -x, and then 7 up.
          "/><item objectid='2' transform='0 1 0 -1 0 0 0 0 1 0 0 7'/><item objectid='3'"));
  std::vector<std::string> boxes;
  for (const Part& part : model.parts) {
    Point3 least = part.positions.at(0), most = least;
    for (const Point3& p : part.positions) {
      least = {std::min(least.x, p.x), std::min(least.y, p.y), std::min(least.z, p.z)};
      most = {std::max(most.x, p.x), std::max(most.y, p.y), std::max(most.z, p.z)};
    }
    boxes.push_back(
        absl::StrCat(least.x, ",", least.y, ",", least.z, " ", most.x, ",", most.y, ",", most.z));
  }
  EXPECT_THAT(boxes, UnorderedElementsAre("0,0,0 1,1,1", "-1,10,7 0,11,8", "-3,20,7 0,23,10",
                                          "10,0,100 11,1,101", "20,0,100 23,3,103"));
}

TEST_F(AssimpFormats, ThreeMfPlacesAndWhatIsNotShown) {
  const Model model =
      Good("a.3mf",
           ThreeMf("<m:compositematerials id='8' matid='5' matindices='0'/>", "", {},
                   "<object id='2'><components><component objectid='1' transform='1 0 0 0 1 0 0 0 "
                   "1 50 0 0'/></components></object>",
                   "transform='2 0 0 0 2 0 0 0 -2 10 0 0'"));
  ASSERT_EQ(model.parts.size(), 1u) << "no item shows the other object";
  double least = 1e9, most = -1e9;
  for (const Point3& p : model.parts[0].positions) {
    least = std::min(least, p.x);
    most = std::max(most, p.x);
  }
  EXPECT_EQ(least, 10);
  EXPECT_EQ(most, 12);
  // A mirror image: the bottom is the top, and its normal points up.
  EXPECT_THAT(model.parts[0].normals[model.parts[0].indices[0]].z, testing::DoubleNear(1, 1e-9));
  EXPECT_THAT(model.left_out, ElementsAre(LeftOut{"composite materials", 1}));
}

// The uppermost layer that has colours hides the others: they are mixed by its opacity, which a display has not.
TEST_F(AssimpFormats, ThreeMfLayersOfProperties) {
  const std::string colors = "<m:colorgroup id='7'><m:color color='#0000FF'/></m:colorgroup>";
  const auto read = [&](const std::string& layers) {
    return Good("a.3mf", ThreeMf(kBases + colors + layers, "pid='8' pindex='1'", {"", "p1='0'"}));
  };
  const Model one = read(
      "<m:multiproperties id='8' pids='5'><m:multi pindices='0'/><m:multi pindices='1'/>"
      "</m:multiproperties>");
  ASSERT_EQ(one.parts.size(), 1u);
  EXPECT_EQ(ColorOfTriangle(one.parts[0], 0), (Rgb{0, 255, 0}));
  EXPECT_EQ(ColorOfTriangle(one.parts[0], 1), (Rgb{255, 0, 0}));
  EXPECT_THAT(one.left_out, IsEmpty());
  // An entry that is missing is the first.
  const Model two = read(
      "<m:multiproperties id='8' pids='5 7'><m:multi pindices='0 0'/><m:multi pindices='1'/>"
      "</m:multiproperties>");
  EXPECT_EQ(ColorOfTriangle(two.parts.at(0), 0), (Rgb{0, 0, 255}));
  EXPECT_EQ(ColorOfTriangle(two.parts.at(0), 1), (Rgb{0, 0, 255}));
  EXPECT_THAT(two.left_out, ElementsAre(LeftOut{"lower layers of properties", 1}));
  // One that does not exist has no colour.
  EXPECT_THAT(read("<m:multiproperties id='8' pids='5 7'/>").parts.at(0).colors, IsEmpty());
}

// Files that are played together share one space, and formats differ in their units.
TEST_F(AssimpFormats, UnitsOfLength) {
  const auto three_mf = [this](const std::string& unit) {
    return Good("a.3mf", ThreeMf("", "", {}, "", "", unit)).unit;
  };
  EXPECT_EQ(three_mf("unit='millimeter'"), 0.001);
  EXPECT_EQ(three_mf("unit='inch'"), 0.0254);
  EXPECT_EQ(three_mf(""), 0.001);
  const auto amf = [this](const std::string& unit) {
    return Good("a.amf",
                absl::StrCat("<?xml version='1.0'?><amf ", unit,
                             "><object id='0'><mesh><vertices>"
                             "<vertex><coordinates><x>0</x><y>0</y><z>0</z></coordinates></vertex>"
                             "<vertex><coordinates><x>1</x><y>0</y><z>0</z></coordinates></vertex>"
                             "<vertex><coordinates><x>0</x><y>1</y><z>0</z></coordinates></"
                             "vertex></vertices><volume>"
                             "<triangle><v1>0</v1><v2>1</v2><v3>2</v3></triangle></volume></mesh></"
                             "object></amf>"))
        .unit;
  };
  EXPECT_EQ(amf("unit='inch'"), 0.0254);
  EXPECT_EQ(amf("unit=\"feet\""), 0.3048);
  EXPECT_EQ(amf(""), 0.001);
  // assimp scales COLLADA to metres.
  const auto width = [](const Model& model) {
    double most = 0;
    for (const Point3& p : model.parts.at(0).positions) most = std::max(most, p.x);
    return most * model.unit;
  };
  EXPECT_DOUBLE_EQ(width(Good("a.dae", Dae("", kQuad))), 1);
  EXPECT_NEAR(
      width(Good("a.dae", absl::StrReplaceAll(Dae("", kQuad), {{"meter='1'", "meter='0.01'"}}))),
      0.01, 1e-9);
  const auto fbx = [this](const std::string& settings) {
    return Good("a.fbx", absl::StrReplaceAll(
                             Fbx("", ""),
                             {{"\tVersion: 1000\n\tProperties70:  {\n",
                               absl::StrCat("\tVersion: 1000\n\tProperties70:  {\n", settings)}}))
        .unit;
  };
  EXPECT_NEAR(fbx("\t\tP: \"UnitScaleFactor\", \"double\", \"Number\", \"\",2.54\n"), 0.0254, 1e-7);
  EXPECT_NEAR(fbx(""), 0.01, 1e-9);
  EXPECT_EQ(Good("a.off", "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n").unit, 0);
}

}  // namespace assimp_test
}  // namespace voxeld::voxelctl
