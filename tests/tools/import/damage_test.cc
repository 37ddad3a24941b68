// Tests every importer with files that are truncated, damaged, or of another kind than their names
// say: it ends, with a model or with a message that names the file, and with little memory.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <initializer_list>
#include <iterator>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "tests/tools/import/read_here.h"
#include "tests/tools/import/volume_files.h"
#include "tests/tools/voxelctl/status_matchers.h"
#include "tools/voxelctl/import/frames.h"

// assimp does not free everything that it made of a file that it then refuses, nor libxml2 all
// texts of entities of damaged drawings; fontconfig keeps its configuration. A reader process ends
// after its file. LeakSanitizer calls this.
extern "C" const char* __lsan_default_suppressions();  // NOLINT: its name
extern "C" const char* __lsan_default_suppressions() {
  return "leak:libassimp\nleak:libfontconfig\nleak:FcConfigCreate\nleak:xmlParseEntityValue\n";
}  // NOLINT

namespace voxeld::voxelctl {
namespace damage_test {

struct Sample {
  std::string name;    // the file's name, with the extension that selects the reader
  std::string bytes;   // a valid file
  bool apart = false;  // in a process of its own, which takes time
  // A file beside it, which is not damaged.
  std::string beside, beside_bytes;
  size_t tries = 200;  // how many damaged copies are read
};

Sample Apart(const std::string& name, const std::string& bytes, size_t tries = 30) {
  return {.name = name, .bytes = bytes, .apart = true, .tries = tries};
}

// AddressSanitizer keeps freed memory for a while.
#if defined(__SANITIZE_ADDRESS__)
constexpr double kLittleMegabytes = 300;
#elif defined(__has_feature)
#if __has_feature(address_sanitizer)
constexpr double kLittleMegabytes = 300;
#else
constexpr double kLittleMegabytes = 40;
#endif
#else
constexpr double kLittleMegabytes = 40;
#endif

constexpr char kDicoms[] = "/usr/lib/python3/dist-packages/pydicom/data/test_files/";

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

std::string Mrc() {
  std::string out(1024, '\0');
  for (const size_t i : {0, 1, 2}) {
    Put<int32_t>(&out, 4 * i, 2);
    Put<int32_t>(&out, 28 + 4 * i, 2);
    Put<float>(&out, 40 + 4 * i, 2);
    Put<float>(&out, 52 + 4 * i, 90);
    Put<int32_t>(&out, 64 + 4 * i, static_cast<int32_t>(i + 1));
  }
  out.replace(208, 4, "MAP ");
  out.replace(212, 2, "\x44\x44");
  return out + "12345678";
}

// Pages of 2 by 1 bytes.
std::string Tiff(uint16_t pages, uint16_t width = 2) {
  std::string out(
      "II*\0\x0a\0\0\0"
      "12",
      10);
  for (uint16_t page = 1; page <= pages; ++page) {
    const size_t at = out.size();
    Put<uint16_t>(&out, at, 7);
    size_t tag = at + 2;
    for (const auto& [number, value] :
         std::initializer_list<std::pair<uint16_t, uint32_t>>{{256, width},
                                                              {257, 1u * width / 2},
                                                              {258, 8},
                                                              {262, 1},
                                                              {273, 8},
                                                              {278, 1u * width / 2},
                                                              {279, 2}}) {
      Put<uint16_t>(&out, tag, number);
      Put<uint16_t>(&out, tag + 2, 4);
      if (number == 258 || number == 262) Put<uint16_t>(&out, tag + 2, 3);
      Put<uint32_t>(&out, tag + 4, 1);
      Put<uint32_t>(&out, tag + 8, value);
      tag += 12;
    }
    Put<uint32_t>(&out, tag, page < pages ? static_cast<uint32_t>(tag + 4) : 0);
  }
  return out;
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

// The bones of a real file, and as many moments as requested.
std::string Bvh(int moments) {
  const std::string real = Real(std::string(VOXELD_MODELS_DIR) + "/BVH/01_01.bvh");
  const size_t motion = real.find("Frames:"), lines = real.find('\n', real.find("Frame Time:")) + 1;
  size_t end = lines;
  for (int i = 0; i < moments; ++i) end = real.find('\n', end) + 1;
  return absl::StrCat(real.substr(0, motion), "Frames: ", moments, "\nFrame Time: .0083333\n",
                      real.substr(lines, end - lines));
}

std::vector<Sample> Samples() {
  const std::string models = std::string(VOXELD_MODELS_DIR) + "/";
  const std::string dicoms = kDicoms;
  const std::string molecule =
      "ATOM      1  N   ALA A   1      11.104   6.134  -6.504  1.00  0.00           N\n"
      "ATOM      2  CA  ALA A   1      11.639   6.071  -5.147  1.00  0.00           C\n"
      "CONECT    1    2\nEND\n";
  const std::string pcd =
      "VERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH 2\nHEIGHT 1\n"
      "VIEWPOINT 0 0 0 1 0 0 0\nPOINTS 2\nDATA ";
  const std::string points = "# points\n1 2 3\n4 5 6\n7 8 9.5\n";
  std::string head = Nifti().substr(0, 352);
  head.replace(344, 3, "ni1");
  Put<float>(&head, 108, 0);
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
      {"a.xyz", points},
      {"a.txt", points},
      {"a.asc", points},
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
      {.name = "c.hdr", .bytes = head, .beside = "c.img", .beside_bytes = "12345678"},
      {.name = "d.img", .bytes = "12345678", .beside = "d.hdr", .beside_bytes = head},
      {"a.raw", "12345678"},
      {"a.mha",
       "NDims = 3\nDimSize = 2 2 2\nElementSpacing = 1 2 3\nTransformMatrix = 1 0 0 0 1 0 0 0 1\n"
       "ElementType = MET_UCHAR\nElementDataFile = LOCAL\n12345678"},
      {.name = "b.mhd",
       .bytes = "NDims = 3\nDimSize = 2 2 2\nElementType = MET_UCHAR\nHeaderSize = "
                "1\nElementDataFile = a.bytes\n",
       .beside = "a.bytes",
       .beside_bytes = "123456789"},
      {"a.mrc", Mrc()},
      {"a.tif", Tiff(3)},
      {.name = "a.nhdr",
       .bytes = "NRRD0004\ntype: uchar\ndimension: 3\nsizes: 2 2 2\nencoding: raw\nbyte skip: "
                "1\ndata file: a.bytes\n",
       .beside = "a.bytes",
       .beside_bytes = "123456789"},
      {"a.nrrd",
       "NRRD0004\ntype: short\ndimension: 4\nsizes: 2 1 2 2\nendian: big\nspace: RAS\nspace "
       "directions: "
       "(1,0,0) (0,1,0) (0,0,1) none\nspace origin: (1,2,3)\nencoding: raw\n\n1234567812345678"},
      {"b.nrrd",
       "NRRD0004\ntype: uchar\ndimension: 2\nsizes: 2 2\nencoding: gzip\n\n" + Gzip("1234")},
      {"a.dcm", Real(dicoms + "MR_small_implicit.dcm")},
      Apart("b.dcm", Real(dicoms + "SC_rgb_dcmtk_+eb+cr.dcm")),
      Apart("c.dcm", Real(dicoms + "MR_small_jp2klossless.dcm")),
      Apart("d.dcm", Real(dicoms + "MR_small_jpeg_ls_lossless.dcm")),
      Apart("e.dcm", Real(dicoms + "SC_rgb_jpeg_dcmtk.dcm")),
      Apart("f.dcm", Real(dicoms + "MR_small_RLE.dcm")),
      {"g.dcm", Real(dicoms + "MR_small_expb.dcm")},
      {"h.dcm", Real(dicoms + "image_dfl.dcm")},
      {"a.pdb", molecule},
      {"a.cif",
       "data_a\nloop_\n_atom_site.type_symbol\n_atom_site.label_atom_id\n_atom_site.Cartn_x\n"
       "_atom_site.Cartn_y\n_atom_site.Cartn_z\nN N 0 0 0\nC 'CA' 1.4 0 0\n"},
      {"b.xyz", "2\n\nC 0 0 0 1\nN 1 0 0 2\n"},
      {"a.svg",
       "<svg xmlns='http://www.w3.org/2000/svg'><style>.a{fill:red;opacity:.5}</style>"
       "<linearGradient id='g'><stop stop-color='blue'/></linearGradient><g transform='rotate(5 1 "
       "2)'>"
       "<path class='a' d='M0 0c1 2 3 4 5 6a1 2 3 0 1 5 5z'/><path fill='url(#g)' "
       "fill-rule='evenodd' "
       "stroke='lime' d='M0 0h9v9zm1 1h4v4z'/></g></svg>"},
      Apart("a.off", Real(models + "OFF/Cube.off")),
      Apart("a.3mf", Real(models + "3MF/box.3mf")),
      Apart("a.dae", Real(models + "Collada/cube_emptyTags.dae")),
      Apart("a.fbx", Real(models + "FBX/phong_cube.fbx")),
      Apart("a.amf", Real(models + "AMF/test1.amf")),
      Apart("a.blend", Real(models + "BLEND/BlenderDefault_248.blend")),
      Apart("b.blend", Real(models + "BLEND/BlenderDefault_250_Compressed.blend")),
      Apart("a.bvh", Bvh(3)),
      // A wall, which is extruded, and a beam, which is made of faces.
      Apart("a.ifc", Real(DataFile("house.ifc")), 60),
      // Four megabytes.
      Apart("b.ifc", Real(models + "IFC/AC14-FZK-Haus.ifc"), 3),
  };
}

class Damage : public testing::Test {
 protected:
  // `beside`: the error may be in the file beside it.
  absl::StatusOr<Model> Import(const std::string& name, const std::string& bytes,
                               const std::string& beside = "") {
    const auto model = ReadHere(folder_.Write(name, bytes), {.raw = RawLayout{.size = {2, 2, 2}}});
    if (!model.ok()) {
      const absl::string_view message = model.status().message();
      EXPECT_TRUE(absl::StartsWith(message, folder_.Path(name)) ||
                  (!beside.empty() && absl::StartsWith(message, folder_.Path(beside))))
          << model.status();
      EXPECT_LT(message.size(), 1000u) << "is it readable?";
    }
    return model;
  }

  // Returns the samples, and writes the files beside them.
  std::vector<Sample> Prepared() {
    std::vector<Sample> samples = Samples();
    for (const Sample& sample : samples) {
      if (!sample.beside.empty()) folder_.Write(sample.beside, sample.beside_bytes);
    }
    return samples;
  }

  void OtherBytes(uint32_t seed, size_t divisor);

  // Imports samples under the file extensions of other formats (every `step`-th pair), and contents of no known format under every
  // extension.
  void OtherKinds(size_t step);

  TempFolder folder_;
};

TEST_F(Damage, EverySampleIsRead) {
  for (const Sample& sample : Prepared())
    EXPECT_THAT(Import(sample.name, sample.bytes), IsOk()) << sample.name;
}

TEST_F(Damage, CutOffAnywhere) {
  for (const Sample& sample : Prepared()) {
    SCOPED_TRACE(sample.name);
    const size_t cuts = (sample.tries + 2) / (sample.apart ? 3 : 4);
    for (size_t i = 1; i <= cuts; ++i)
      (void)Import(sample.name, sample.bytes.substr(0, sample.bytes.size() * i / (cuts + 1)),
                   sample.beside);
  }
}

// Imports randomly damaged copies of every sample; makes 1/`divisor` of the sample's usual number of attempts.
void Damage::OtherBytes(uint32_t seed, size_t divisor) {
  std::mt19937 random(seed);
  // Numbers that are at a limit, and random ones.
  const auto byte = [&random] {
    static constexpr uint8_t kEdges[] = {0, 1, 0x7f, 0x80, 0xff, '-', '9'};
    const uint32_t draw = random();
    return static_cast<char>(draw % 2 == 0 ? kEdges[draw / 2 % std::size(kEdges)] : draw / 2);
  };
  for (const Sample& sample : Prepared()) {
    SCOPED_TRACE(sample.name);
    // Most errors are possible in the beginning.
    const size_t head = std::min<size_t>(sample.bytes.size(), 2048);
    for (size_t i = 0; i < (sample.tries + divisor - 1) / divisor; ++i) {
      std::string bytes = sample.bytes;
      for (uint32_t k = 1 + random() % 6; k > 0; --k)
        bytes[random() % (k % 2 == 0 ? bytes.size() : head)] = byte();
      (void)Import(sample.name, bytes, sample.beside);
    }
  }
}

TEST_F(Damage, BytesThatAreOthers) { OtherBytes(18, 10); }

TEST_F(Damage, ChangedBytesAllAttempts) { OtherBytes(17, 1); }

// One of three slices is damaged, or one of three consecutive pictures.
TEST_F(Damage, FoldersAndSequences) {
  const std::string slices = absl::StrCat(kDicoms, "dicomdirtests/98892001/CT5N/");
  std::vector<std::string> good;
  std::filesystem::create_directory(folder_.Path("slices"));
  for (const auto& entry : std::filesystem::directory_iterator(slices)) {
    good.push_back(Real(entry.path().string()));
    folder_.Write(absl::StrCat("slices/", good.size()), good.back());
    if (good.size() == 3) break;
  }
  ASSERT_EQ(good.size(), 3u);
  const std::string folder = folder_.Path("slices");
  ASSERT_THAT(ReadHere(folder, {}), IsOk());
  const std::string cube = Real(std::string(VOXELD_MODELS_DIR) + "/OFF/Cube.off");
  for (const int i : {1, 2, 3}) folder_.Write(absl::StrCat("frame_", i, ".off"), cube);
  std::mt19937 random(23);
  const auto damage = [&random](std::string bytes, int i) {
    if (i % 4 == 0) bytes.resize(random() % bytes.size());
    for (int k = 0; k < 4 && !bytes.empty(); ++k)
      bytes[random() % (k % 2 == 0 ? bytes.size() : std::min<size_t>(bytes.size(), 2048))] =
          static_cast<char>(random());
    return bytes;
  };
  for (int i = 0; i < 40; ++i) {
    folder_.Write("slices/2", damage(good[1], i));
    const auto model = ReadHere(folder, {});
    if (!model.ok()) {
      EXPECT_TRUE(absl::StartsWith(model.status().message(), folder)) << model.status();
    }
  }
  for (int i = 0; i < 20; ++i) {
    folder_.Write("frame_2.off", damage(cube, i));
    const auto paths = FindSequence(folder_.Path("frame_#.off"));
    ASSERT_THAT(paths, IsOk());
    FileFrames frames(*paths, {}, nullptr);
    ASSERT_EQ(frames.count(), 3);
    EXPECT_THAT(frames.Read(0), IsOk());
    const auto model = frames.Read(1);
    if (!model.ok()) {
      EXPECT_TRUE(absl::StartsWith(model.status().message(), folder_.Path("frame_2.off")))
          << model.status();
    }
    EXPECT_THAT(frames.Read(2), IsOk());
  }
}

void Damage::OtherKinds(size_t step) {
  const std::vector<Sample> samples = Prepared();
  std::string last;
  size_t turn = 0;
  for (const Sample& name : samples) {
    if (name.name.substr(1) == last) continue;
    last = name.name.substr(1);
    for (const Sample& content : samples) {
      if ((name.apart && content.apart) || turn++ % step != 0) continue;
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

// The step 7 and the number of samples are coprime, so the contents of every sample are tested.
TEST_F(Damage, OfAnotherKind) { OtherKinds(7); }

TEST_F(Damage, WrongExtensionsAllPairs) { OtherKinds(1); }

// Returns how much more memory, in MiB, a process that does this has at its peak than one that does
// nothing.
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

// Files that claim to be huge, or expand to something huge, but are not.
TEST_F(Damage, HugeOnesTakeLittleMemory) {
  const auto set16 = [](std::string bytes, size_t at, int16_t value) {
    Put<int16_t>(&bytes, at, value);
    return bytes;
  };
  std::string wide = Nifti();
  for (const size_t i : {1, 2, 3}) wide = set16(wide, 40 + 2 * i, 640);
  std::string wide_mrc = Mrc();
  for (const size_t i : {0, 1, 2}) Put<int32_t>(&wide_mrc, 4 * i, 640);
  std::string las = Las();
  Put<uint32_t>(&las, 107, 0xfffffff0);
  std::string vox = Vox();
  Put<uint32_t>(&vox, vox.find("XYZI") + 12, 0xfffffff0);
  std::string lzf;
  Put<uint32_t>(&lzf, 0, 40);
  Put<uint32_t>(&lzf, 4, 360'000'000);
  lzf.resize(48, '\x1f');
  const std::string zeros(size_t{100} << 20, '\0');
  std::string wide_dicom = Real(absl::StrCat(kDicoms, "MR_small.dcm"));
  for (const char* element : {"\x10", "\x11"}) {
    const size_t at = wide_dicom.find(
        absl::StrCat(std::string("\x28\0", 2), element, std::string("\0US\2\0", 5)));
    ASSERT_NE(at, std::string::npos);
    wide_dicom = set16(wide_dicom, at + 8, 16000);
  }
  std::string laughs = "<!DOCTYPE svg [<!ENTITY a 'M0 0 1 1 '>";
  for (char c = 'b'; c < 'k'; ++c) {
    absl::StrAppend(&laughs, "<!ENTITY ", std::string(1, c), " '");
    for (int i = 0; i < 10; ++i)
      absl::StrAppend(&laughs, "&", std::string(1, static_cast<char>(c - 1)), ";");
    laughs += "'>";
  }
  laughs += "]><svg xmlns='http://www.w3.org/2000/svg'><path d='&j;'/></svg>";
  std::string nested = "<svg xmlns='http://www.w3.org/2000/svg'>";
  for (int i = 0; i < 90; ++i)
    absl::StrAppend(&nested, "<g", i == 0 ? " fill='" + std::string(2'000'000, 'x') + "'" : "",
                    ">");
  nested += "<rect width='0'/>";
  for (int i = 0; i < 90; ++i) nested += "</g>";
  nested += "</svg>";
  const auto gltf = [](const std::string& accessor) {
    return "{\"asset\":{\"version\":\"2.0\"},\"scenes\":[{\"nodes\":[0]}],\"nodes\":[{\"mesh\":0}],"
           "\"meshes\":[{\"primitives\":[{\"attributes\":{\"POSITION\":0}}]}],\"accessors\":[{" +
           accessor + "\"componentType\":5126,\"type\":\"VEC3\",\"count\":1000000000}]}";
  };
  const std::vector<Sample> huge = {
      {"a.dcm", wide_dicom},
      {"a.svg", laughs},
      {"b.svg", nested},
      {"a.gltf", gltf("")},
      {"b.gltf",
       gltf("\"sparse\":{\"count\":1,\"indices\":{\"bufferView\":0,\"componentType\":5125},"
            "\"values\":{\"bufferView\":0}},")},
      // Far from each other, where touching atoms are searched for.
      {"a.pdb",
       "ATOM      1  N   ALA A   1    -999.999-999.999-999.999  1.00  0.00           N\n"
       "ATOM      2  CA  ALA A   1    9999.9999999.9999999.999  1.00  0.00           C\nEND\n"},
      {"a.nii", wide},
      {"b.nii.gz", Gzip(wide)},
      {"c.nii.gz", Gzip(Nifti() + zeros)},
      {"a.nrrd",
       "NRRD0004\ntype: double\ndimension: 3\nsizes: 640 640 640\nendian: big\nencoding: gzip\n\n" +
           Gzip("1")},
      {"b.nrrd",
       "NRRD0004\ntype: double\ndimension: 3\nsizes: 640 640 640\nencoding: ascii\n\n1 2 3"},
      {"a.mha",
       "NDims = 3\nDimSize = 640 640 640\nCompressedData = True\nElementType = "
       "MET_DOUBLE\nElementDataFile = LOCAL\n" +
           Gzip("1")},
      {"b.mha",
       "NDims = 3\nDimSize = 640 640 640\nBinaryData = False\nElementType = "
       "MET_DOUBLE\nElementDataFile = LOCAL\n1 2 3"},
      {"a.mrc", wide_mrc},
      {"a.tif", Tiff(1, 16000)},
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
    EXPECT_LT(MegabytesOf([&] { (void)ReadHere(folder_.Write(sample.name, sample.bytes), {}); }),
              kLittleMegabytes)
        << sample.name;
    const auto model = Import(sample.name, sample.bytes);
    EXPECT_EQ(model.ok(), sample.name == "c.nii.gz" || sample.name == "a.pdb")
        << sample.name << " " << model.status();
  }
}

}  // namespace damage_test
}  // namespace voxeld::voxelctl
