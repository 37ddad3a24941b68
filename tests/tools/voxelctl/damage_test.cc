// Every importer on files that are cut off, damaged, or of another kind than their names say: it ends, with a model or with a
// message that names the file, and with little memory.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cstdint>
#include <functional>
#include <iterator>
#include <random>
#include <string>
#include <vector>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "tests/tools/voxelctl/status_matchers.h"
#include "tests/tools/voxelctl/volume_files.h"

// assimp does not free all of what it made of a file that it then refuses; LeakSanitizer asks this.
extern "C" const char* __lsan_default_suppressions();  // NOLINT: its name
extern "C" const char* __lsan_default_suppressions() { return "leak:libassimp"; }  // NOLINT

namespace voxeld::voxelctl {
namespace {

struct Sample {
  std::string name;    // the file's, with the extension that decides who reads it
  std::string bytes;   // a file that is read
  bool apart = false;  // in a process of its own, which takes time
};

std::string Real(const std::string& path) {
  const std::string bytes = ReadAll(path);
  EXPECT_FALSE(bytes.empty()) << path;
  return bytes;
}

std::string Las() {
  std::string out = "LASF";
  Put<uint8_t>(&out, 24, 1);
  Put<uint8_t>(&out, 25, 2);
  Put<uint16_t>(&out, 94, 227);  // the header's size
  Put<uint32_t>(&out, 96, 227);  // where points begin
  Put<uint16_t>(&out, 105, 20);  // a point's size
  Put<uint32_t>(&out, 107, 3);   // how many
  for (size_t axis = 0; axis < 3; ++axis) Put<double>(&out, 131 + 8 * axis, 0.01);
  for (size_t i = 0; i < 3; ++i) {
    for (size_t axis = 0; axis < 3; ++axis)
      Put<int32_t>(&out, 227 + 20 * i + 4 * axis, static_cast<int32_t>(100 * i + axis));
  }
  out.resize(227 + 60);
  return out;
}

std::string Vox() {
  const auto chunk = [](const std::string& id, const std::string& content) {
    std::string out = id;
    Put<uint32_t>(&out, 4, static_cast<uint32_t>(content.size()));
    Put<uint32_t>(&out, 8, 0);
    return out + content;
  };
  const auto numbers = [](const std::vector<uint32_t>& all) {
    std::string out;
    for (const uint32_t number : all) Put<uint32_t>(&out, out.size(), number);
    return out;
  };
  const std::string models =
      chunk("SIZE", numbers({3, 3, 3})) + chunk("XYZI", numbers({2, 0x01010101, 0x05020202}));
  std::string out = "VOX ";
  Put<uint32_t>(&out, 4, 150);
  out += "MAIN";
  Put<uint32_t>(&out, 12, 0);
  Put<uint32_t>(&out, 16, static_cast<uint32_t>(models.size()));
  return out + models;
}

std::string Nifti() {
  std::string out(352, '\0');
  Put<int32_t>(&out, 0, 348);
  for (const size_t i : {0, 1, 2, 3}) Put<int16_t>(&out, 40 + 2 * i, i == 0 ? 3 : 2);
  Put<int16_t>(&out, 70, 2);
  for (const size_t i : {0, 1, 2, 3}) Put<float>(&out, 76 + 4 * i, 1);
  Put<float>(&out, 108, 352);
  out.replace(344, 3, "n+1");
  return out + "12345678";
}

std::string Nifti2() {
  std::string out(544, '\0');
  Put<int32_t>(&out, 0, 540);
  out.replace(4, 3, "n+2");
  Put<int16_t>(&out, 12, 128);
  for (const size_t i : {0, 1, 2, 3}) Put<int64_t>(&out, 16 + 8 * i, i == 0 ? 3 : 2);
  for (const size_t i : {0, 1, 2, 3}) Put<double>(&out, 104 + 8 * i, 1);
  Put<int64_t>(&out, 168, 544);
  return out + std::string(24, 'c');
}

std::vector<Sample> Samples() {
  const std::string models = std::string(VOXELD_MODELS_DIR) + "/";
  const std::string dicoms = "/usr/lib/python3/dist-packages/pydicom/data/test_files/";
  const std::string molecule =
      "ATOM      1  N   ALA A   1      11.104   6.134  -6.504  1.00  0.00           N\n"
      "ATOM      2  CA  ALA A   1      11.639   6.071  -5.147  1.00  0.00           C\n"
      "CONECT    1    2\nEND\n";
  const std::string pcd =
      "VERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH 2\nHEIGHT 1\n"
      "VIEWPOINT 0 0 0 1 0 0 0\nPOINTS 2\nDATA ";
  return {
      {"a.obj", Real(DataFile("arrow.obj"))},
      {"a.stl", Real(DataFile("arrow.stl"))},
      {"b.stl", Real(models + "STL/triangle.stl")},
      {"a.ply", Real(DataFile("points.ply"))},
      {"b.ply", Real(models + "PLY/cube.ply")},
      {"c.ply", Real(models + "PLY/cube_binary.ply")},
      {"a.glb", Real(models + "glTF2/BoxTextured-glTF-Binary/BoxTextured.glb")},
      {"a.gltf", Real(models + "glTF2/BoxTextured-glTF-Embedded/BoxTextured.gltf")},
      {"a.vox", Vox()},
      {"a.xyz", "# points\n1 2 3\n4 5 6\n7 8 9.5\n"},
      {"a.csv", "x,y,z,r,g,b\n1,2,3,255,0,0\n4,5,6,0,255,0\n"},
      {"a.pts", "2\n0 0 0 -5 1 2 3\n1 1 1 9 4 5 6\n"},
      {"a.pcd", pcd + "ascii\n1 2 3\n4 5 6\n"},
      {"b.pcd", pcd + "binary\n" + std::string(24, 'A')},
      {"a.las", Las()},
      {"a.geojson", Real(DataFile("places.geojson"))},
      {"a.topojson", Real(DataFile("quad.topojson"))},
      {"a.nii", Nifti()},
      {"b.nii", Nifti2()},
      {"a.nii.gz", Gzip(Nifti())},
      {"a.nrrd",
       "NRRD0004\ntype: short\ndimension: 4\nsizes: 2 1 2 2\nendian: big\nspace: RAS\nspace "
       "directions: "
       "(1,0,0) (0,1,0) (0,0,1) none\nspace origin: (1,2,3)\nencoding: raw\n\n1234567812345678"},
      {"b.nrrd",
       "NRRD0004\ntype: uchar\ndimension: 2\nsizes: 2 2\nencoding: gzip\n\n" + Gzip("1234")},
      {"a.dcm", Real(dicoms + "MR_small_implicit.dcm")},
      {"b.dcm", Real(dicoms + "SC_rgb_dcmtk_+eb+cr.dcm"), true},
      {"c.dcm", Real(dicoms + "MR_small_jp2klossless.dcm"), true},
      {"d.dcm", Real(dicoms + "MR_small_jpeg_ls_lossless.dcm"), true},
      {"e.dcm", Real(dicoms + "SC_rgb_jpeg_dcmtk.dcm"), true},
      {"f.dcm", Real(dicoms + "MR_small_RLE.dcm"), true},
      {"g.dcm", Real(dicoms + "MR_small_expb.dcm")},
      {"h.dcm", Real(dicoms + "image_dfl.dcm")},
      {"a.pdb", molecule},
      {"a.svg",
       "<svg xmlns='http://www.w3.org/2000/svg'><style>.a{fill:red;opacity:.5}</style>"
       "<linearGradient id='g'><stop stop-color='blue'/></linearGradient><g transform='rotate(5 1 "
       "2)'>"
       "<path class='a' d='M0 0c1 2 3 4 5 6a1 2 3 0 1 5 5z'/><path fill='url(#g)' "
       "fill-rule='evenodd' "
       "stroke='lime' d='M0 0h9v9zm1 1h4v4z'/></g></svg>"},
      {"a.off", Real(models + "OFF/Cube.off"), true},
      {"a.3mf", Real(models + "3MF/box.3mf"), true},
      {"a.dae", Real(models + "Collada/cube_emptyTags.dae"), true},
      {"a.fbx", Real(models + "FBX/phong_cube.fbx"), true},
      {"a.amf", Real(models + "AMF/test1.amf"), true},
  };
}

class Damage : public testing::Test {
 protected:
  absl::StatusOr<Model> Import(const std::string& name, const std::string& bytes) {
    const auto model = ImportFile(folder_.Write(name, bytes), {});
    if (!model.ok()) {
      EXPECT_TRUE(absl::StartsWith(model.status().message(), folder_.Path(name))) << model.status();
      EXPECT_LT(model.status().message().size(), 1000u) << "is it for people?";
    }
    return model;
  }

  TempFolder folder_;
};

TEST_F(Damage, EverySampleIsRead) {
  for (const Sample& sample : Samples())
    EXPECT_THAT(Import(sample.name, sample.bytes), IsOk()) << sample.name;
}

TEST_F(Damage, CutOffAnywhere) {
  for (const Sample& sample : Samples()) {
    SCOPED_TRACE(sample.name);
    const size_t cuts = sample.apart ? 10 : 50;
    for (size_t i = 1; i <= cuts; ++i)
      (void)Import(sample.name, sample.bytes.substr(0, sample.bytes.size() * i / (cuts + 1)));
  }
}

TEST_F(Damage, BytesThatAreOthers) {
  std::mt19937 random(17);
  // Numbers that are on the edge of something, and any.
  const auto byte = [&random] {
    static constexpr uint8_t kEdges[] = {0, 1, 0x7f, 0x80, 0xff, '-', '9'};
    const uint32_t draw = random();
    return static_cast<char>(draw % 2 == 0 ? kEdges[draw / 2 % std::size(kEdges)] : draw / 2);
  };
  for (const Sample& sample : Samples()) {
    SCOPED_TRACE(sample.name);
    // Most of what may go wrong is in the beginning.
    const size_t head = std::min<size_t>(sample.bytes.size(), 2048);
    for (int i = 0; i < (sample.apart ? 30 : 200); ++i) {
      std::string bytes = sample.bytes;
      for (uint32_t k = 1 + random() % 6; k > 0; --k)
        bytes[random() % (k % 2 == 0 ? bytes.size() : head)] = byte();
      (void)Import(sample.name, bytes);
    }
  }
}

TEST_F(Damage, OfAnotherKind) {
  const std::vector<Sample> samples = Samples();
  std::string last;
  for (const Sample& name : samples) {
    if (name.name.substr(1) == last) continue;
    last = name.name.substr(1);
    for (const Sample& content : samples) {
      if (name.apart && content.apart) continue;
      SCOPED_TRACE(absl::StrCat(content.name, " as ", name.name));
      (void)Import(name.name, content.bytes);
    }
    for (const std::string& content :
         {std::string(1, '\0'), std::string(5000, '\0'), std::string(5000, '\xff'),
          std::string("\x89PNG\r\n\x1a\n", 8), std::string(100'000, '['), std::string(100'000, '('),
          std::string("nan nan nan\ninf inf inf\n"), std::string(100'000, '9')}) {
      SCOPED_TRACE(absl::StrCat(content.substr(0, 4), "… as ", name.name));
      (void)Import(name.name, content);
    }
  }
}

// How much more memory a process has at its height that does this than one that does nothing; MiB.
double MegabytesOf(const std::function<void()>& work) {
  const auto height = [](const std::function<void()>& done) {
    const pid_t child = ::fork();
    if (child == 0) {
      done();
      ::_exit(0);
    }
    int state = 0;
    rusage usage = {};
    EXPECT_EQ(::wait4(child, &state, 0, &usage), child);
    EXPECT_TRUE(WIFEXITED(state) && WEXITSTATUS(state) == 0);
    return static_cast<double>(usage.ru_maxrss) / 1024;
  };
  const double nothing = height([] {});
  return height(work) - nothing;
}

// What says that it is huge, or becomes huge, and is not.
TEST_F(Damage, HugeOnesTakeLittleMemory) {
  const auto set16 = [](std::string bytes, size_t at, int16_t value) {
    Put<int16_t>(&bytes, at, value);
    return bytes;
  };
  std::string wide = Nifti();
  for (const size_t i : {1, 2, 3}) wide = set16(wide, 40 + 2 * i, 640);
  std::string las = Las();
  Put<uint32_t>(&las, 107, 0xfffffff0);
  std::string vox = Vox();
  Put<uint32_t>(&vox, vox.find("XYZI") + 12, 0xfffffff0);
  std::string lzf;
  Put<uint32_t>(&lzf, 0, 40);
  Put<uint32_t>(&lzf, 4, 360'000'000);
  lzf.resize(48, '\x1f');
  const std::string zeros(size_t{100} << 20, '\0');
  const std::vector<Sample> huge = {
      {"a.nii", wide},
      {"b.nii.gz", Gzip(wide)},
      {"c.nii.gz", Gzip(Nifti() + zeros)},
      {"a.nrrd",
       "NRRD0004\ntype: double\ndimension: 3\nsizes: 640 640 640\nendian: big\nencoding: gzip\n\n" +
           Gzip("1")},
      {"b.nrrd",
       "NRRD0004\ntype: double\ndimension: 3\nsizes: 640 640 640\nencoding: ascii\n\n1 2 3"},
      {"b.pcd",
       "VERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 0 0 0\nWIDTH 30000000\nHEIGHT "
       "1\nPOINTS 30000000\nDATA binary\n"},
      {"c.pcd",
       "VERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH 30000000\nHEIGHT "
       "1\nPOINTS 30000000\nDATA binary_compressed\n" +
           lzf},
      {"a.las", las},
      {"a.vox", vox},
      {"a.ply",
       "ply\nformat ascii 1.0\nelement vertex 4000000000\nproperty float x\nproperty float "
       "y\nproperty float z\nend_header\n1 2 3\n"},
      {"a.pcd",
       "VERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH 4000000000\nHEIGHT "
       "1\nPOINTS 4000000000\nDATA ascii\n1 2 3\n"},
  };
  for (const Sample& sample : huge) {
    EXPECT_LT(MegabytesOf([&] { (void)ImportFile(folder_.Write(sample.name, sample.bytes), {}); }),
              40)
        << sample.name;
    const auto model = Import(sample.name, sample.bytes);
    EXPECT_EQ(model.ok(), sample.name == "c.nii.gz") << sample.name << " " << model.status();
  }
}

}  // namespace
}  // namespace voxeld::voxelctl
