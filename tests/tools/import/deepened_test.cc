// Nests each recursive construct of each format deeper and deeper: the file is read, or refused
// with a message, on a small stack.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>
#include <string>

#include "absl/strings/str_cat.h"
#include "tests/small_stack.h"
#include "tests/tools/import/read_here.h"
#include "tests/tools/voxelctl/temp_folder.h"
#include "tools/voxelctl/import/importer.h"

namespace voxeld::voxelctl {
namespace deepened_test {

using ::testing::HasSubstr;
using ::testing::Not;

struct Construct {
  const char* name;
  const char* file;
  std::function<std::string(int)> deep;
  bool reads = false;  // a file that is ten levels deep can be read
  size_t stack_bytes = kSmallStack;
};

std::string Times(const std::string& text, int count) {
  std::string all;
  all.reserve(text.size() * static_cast<size_t>(count));
  for (int i = 0; i < count; ++i) all += text;
  return all;
}

std::string Svg(const std::string& inside) {
  return absl::StrCat("<svg xmlns='http://www.w3.org/2000/svg' viewBox='0 0 9 9'>", inside,
                      "</svg>");
}

std::string Gltf(const std::string& more) {
  return absl::StrCat(R"({"asset":{"version":"2.0"},)", more, "}");
}

const Construct kConstructs[] = {
    {"GeometryCollections", "a.geojson",
     [](int n) {
       return absl::StrCat(Times(R"({"type":"GeometryCollection","geometries":[)", n),
                           R"({"type":"Point","coordinates":[1,2]})", Times("]}", n));
     },
     true},
    {"Coordinates", "a.geojson",
     [](int n) {
       return absl::StrCat(R"({"type":"LineString","coordinates":)", Times("[", n), "1",
                           Times("]", n), "}");
     }},
    {"TopologyArcs", "a.topojson",
     [](int n) {
       return absl::StrCat(
           R"({"type":"Topology","arcs":[],"objects":{"a":{"type":"Polygon","arcs":)",
           Times("[", n), Times("]", n), "}}}");
     }},
    {"Groups", "a.svg",
     [](int n) { return Svg(Times("<g>", n) + "<rect width='1' height='1'/>" + Times("</g>", n)); },
     true},
    {"InnerDrawings", "a.svg",
     [](int n) {
       return Svg(Times("<svg>", n) + "<rect width='1' height='1'/>" + Times("</svg>", n));
     },
     true},
    {"Uses", "a.svg",
     [](int n) {
       std::string all = "<defs><g id='a0'><rect width='1' height='1'/></g>";
       for (int i = 1; i <= n; ++i)
         absl::StrAppend(&all, "<g id='a", i, "'><use href='#a", i - 1, "'/></g>");
       return Svg(absl::StrCat(all, "</defs><use href='#a", n, "'/>"));
     },
     true},
    {"Transforms", "a.svg",
     [](int n) {
       return Svg(absl::StrCat("<rect width='1' height='1' transform='", Times("translate(", n),
                               "1", Times(")", n), "'/>"));
     }},
    {"Entities", "a.svg",
     [](int n) {
       return absl::StrCat("<!DOCTYPE svg [<!ENTITY a '", Times("&#60;g>", n), "'>]>", Svg("&a;"));
     }},
    {"GltfExtras", "a.gltf",
     [](int n) { return Gltf(absl::StrCat(R"("extras":)", Times("[", n), Times("]", n))); }},
    {"GltfNodes", "a.gltf",
     [](int n) {
       std::string nodes;
       for (int i = 0; i < n; ++i) absl::StrAppend(&nodes, R"({"children":[)", i + 1, "]},");
       return Gltf(absl::StrCat(R"("scene":0,"scenes":[{"nodes":[0]}],"nodes":[)", nodes, "{}]"));
     }},
    {"ColladaNodes", "a.dae",
     [](int n) {
       return absl::StrCat(
           "<?xml version='1.0'?><COLLADA version='1.4.1'><library_visual_scenes><visual_scene "
           "id='s'>",
           Times("<node>", n), Times("</node>", n),
           "</visual_scene></library_visual_scenes></COLLADA>");
     }},
    {"StepLists", "a.ifc",
     [](int n) {
       return absl::StrCat(
           "ISO-10303-21;\nHEADER;\nFILE_SCHEMA(('IFC2X3'));\nENDSEC;\nDATA;\n#1=IFCPROJECT(",
           Times("(", n), Times(")", n), ");\nENDSEC;\nEND-ISO-10303-21;\n");
     }},
    {"Bones", "a.bvh",
     [](int n) {
       return absl::StrCat("HIERARCHY\nROOT a\n{\nOFFSET 0 0 0\nCHANNELS 0\n",
                           Times("JOINT b\n{\nOFFSET 0 0 0\nCHANNELS 0\n", n),
                           "End Site\n{\nOFFSET 0 0 0\n}\n", Times("}\n", n),
                           "}\nMOTION\nFrames: 1\nFrame Time: 0.1\n");
     }},
};

class Deepened : public ::testing::TestWithParam<Construct> {};

TEST_P(Deepened, IsReadOrRefusedWithWords) {
  const TempFolder folder;
  for (const int depth : {1, 10, 100, 1'000, 10'000, 100'000}) {
    const std::string path = folder.Write(GetParam().file, GetParam().deep(depth));
    absl::Status status;
    // The process that reads inherits the stack of the thread that calls ReadApart.
    OnSmallStack([&] { status = ReadApart(path).status(); }, GetParam().stack_bytes);
    EXPECT_THAT(std::string(status.message()), Not(HasSubstr("crashed"))) << depth;
    if (depth <= 10 && GetParam().reads) {
      EXPECT_TRUE(status.ok()) << depth << ": " << status;
    }
    if (!status.ok()) {
      EXPECT_THAT(std::string(status.message()), HasSubstr(GetParam().file)) << depth;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Constructs, Deepened, ::testing::ValuesIn(kConstructs),
                         [](const auto& info) { return std::string(info.param.name); });

}  // namespace deepened_test
}  // namespace voxeld::voxelctl
