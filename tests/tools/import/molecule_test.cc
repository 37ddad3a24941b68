// Molecules: atoms and bonds of real files, and what is said of broken ones.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <random>
#include <string>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "tests/tools/import/read_here.h"
#include "tests/tools/voxelctl/status_matchers.h"
#include "tests/tools/voxelctl/temp_folder.h"
#include "tools/voxelctl/import/importer.h"
#include "tools/voxelctl/scene/pack.h"
#include "tools/voxelctl/scene/placement.h"

namespace voxeld::voxelctl {
namespace molecule_test {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

std::string Atom(int serial, const std::string& name, double x, double y, double z,
                 const std::string& element = "", char location = ' ') {
  return absl::StrFormat("HETATM%5d %-4s%cXXX A   1    %8.3f%8.3f%8.3f  1.00  0.00          %2s\n",
                         serial, name, location, x, y, z, element);
}

class Molecules : public testing::Test {
 protected:
  absl::StatusOr<Model> Import(const std::string& bytes,
                               MoleculeStyle style = MoleculeStyle::kBalls) {
    return ReadHere(folder_.Write("a.pdb", bytes), {.style = style});
  }
  // Of the first part, which are the rods, if there are any.
  size_t Bonds(const std::string& bytes) {
    const auto model = Import(bytes);
    EXPECT_TRUE(model.ok()) << model.status();
    return model.ok() && model->parts[0].kind == Kind::kSegments
               ? model->parts[0].indices.size() / 4
               : 0;
  }
  std::string Error(const std::string& bytes) {
    return std::string(Import(bytes).status().message());
  }

  TempFolder folder_;
};

TEST_F(Molecules, WaterInBothStyles) {
  const std::string water = Atom(1, " O  ", 0, 0, 0, "O") + Atom(2, " H1 ", 0.96, 0, 0, "H") +
                            Atom(3, " H2 ", -0.24, 0.93, 0, "H");
  auto model = Import(water);
  ASSERT_THAT(model, IsOk());
  ASSERT_EQ(model->parts.size(), 3u);
  EXPECT_EQ(model->parts[0].indices.size(), 8u) << "two bonds, half and half";
  EXPECT_EQ(model->parts[0].colors[0], (Rgb{255, 13, 13}));
  EXPECT_EQ(model->parts[0].colors[2], (Rgb{255, 255, 255}));
  EXPECT_DOUBLE_EQ(model->parts[0].thickness, 0.3);
  EXPECT_EQ(model->parts[1].positions.size(), 2u);
  EXPECT_DOUBLE_EQ(model->parts[2].thickness, 0.76);
  model = Import(water, MoleculeStyle::kSpace);
  ASSERT_THAT(model, IsOk());
  ASSERT_EQ(model->parts.size(), 2u);
  EXPECT_DOUBLE_EQ(model->parts[1].thickness, 3.04);
}

TEST_F(Molecules, ElementsOfOldFilesByTheirNames) {
  const auto color = [this](const std::string& name) {
    return Import(Atom(1, name, 0, 0, 0))->parts.back().colors[0];
  };
  EXPECT_EQ(color(" CA "), (Rgb{144, 144, 144}));
  EXPECT_EQ(color("CA  "), (Rgb{61, 255, 0}));
  EXPECT_EQ(color("HG11"), (Rgb{255, 255, 255}));
  EXPECT_EQ(color("1HB "), (Rgb{255, 255, 255}));
  EXPECT_EQ(color(" Q1 "), (Rgb{255, 20, 147}));
}

TEST_F(Molecules, Bonds) {
  const std::string far = Atom(1, " C  ", 0, 0, 0, "C") + Atom(2, " C  ", 5, 0, 0, "C");
  EXPECT_EQ(Bonds(far), 0u);
  EXPECT_EQ(Bonds(far + "CONECT    1    2    9\nCONECT    2    1\n"), 1u);
  EXPECT_EQ(Bonds(Atom(1, "NA  ", 0, 0, 0, "NA") + Atom(2, " O  ", 2.4, 0, 0, "O")), 0u);
  EXPECT_EQ(Bonds(Atom(1, "SE  ", -3.5, 0, 0, "SE") + Atom(2, " C  ", -3.7, 0, 1.9, "C")), 1u)
      << "across cells";
}

TEST_F(Molecules, OneModelAndOneLocation) {
  const std::string atom = Atom(1, " C  ", 0, 0, 0, "C");
  const auto model = Import("MODEL        1\n" + atom + Atom(2, " N  ", 9, 0, 0, "N", 'B') +
                            "ENDMDL\nMODEL        2\n" + atom + "ENDMDL\n");
  ASSERT_THAT(model, IsOk());
  EXPECT_EQ(model->parts.at(0).positions.size(), 1u);
  EXPECT_THAT(model->note, HasSubstr("the first of its models"));
}

TEST_F(Molecules, FramesThatEndDivides) {
  for (const char* end : {"END\n", "END   \n", "ENDMDL\n"}) {
    const auto model = Import(
        absl::StrCat(Atom(1, " C  ", 0, 0, 0, "C"), end, Atom(1, " C  ", 5, 0, 0, "C"), end));
    ASSERT_THAT(model, IsOk());
    EXPECT_EQ(model->parts.at(0).positions.size(), 1u) << end;
    EXPECT_THAT(model->note, HasSubstr("the first of its models is shown"));
  }
}

TEST_F(Molecules, AResidueHasOneLocationWhateverItsLetter) {
  const auto model = Import(Atom(1, " N  ", 0, 0, 0, "N") + Atom(2, " CA ", 9, 0, 0, "C", 'B') +
                            Atom(3, " CA ", 9, 1, 0, "C", 'C') + Atom(4, " C  ", 20, 0, 0, "C"));
  ASSERT_THAT(model, IsOk());
  size_t atoms = 0;
  for (const Part& part : model->parts)
    atoms += part.kind == Kind::kPoints ? part.positions.size() : 0;
  EXPECT_EQ(atoms, 3u);
  EXPECT_THAT(model->note, HasSubstr("atoms at alternate locations, not shown: 1"));
}

TEST_F(Molecules, RealProteins) {
  const auto model = ReadHere("/usr/share/pymol/data/tut/1hpv.pdb", {});
  ASSERT_THAT(model, IsOk()) << "tools/setup --import installs pymol-data";
  size_t atoms = 0;
  for (const Part& part : model->parts) {
    if (part.kind == Kind::kPoints) atoms += part.positions.size();
  }
  EXPECT_EQ(atoms, 1631u);
  // A chain of amino acids has about as many bonds as atoms, and a few for rings.
  EXPECT_GT(model->parts[0].indices.size() / 4, 1500u);
  EXPECT_LT(model->parts[0].indices.size() / 4, 1800u);
}

TEST_F(Molecules, ThatAreWrong) {
  EXPECT_THAT(Error("hello"), HasSubstr("without an atom; records ATOM or HETATM"));
  const std::string good = Atom(1, " C  ", 0, 0, 0, "C");
  EXPECT_THAT(Error(good + good.substr(0, 40)), HasSubstr("line 2 is cut off before column 39"));
  EXPECT_THAT(Error(good + good.substr(0, 30)), HasSubstr("line 2 is cut off before column 31"));
  std::string bad = good;
  bad.replace(30, 8, "   1e300");
  EXPECT_THAT(Error(bad), HasSubstr("line 1 has \"1e300\" in column 31"));
  std::string crowd;
  for (int i = 0; i < 1002; ++i) crowd += good;
  EXPECT_THAT(Error(crowd), HasSubstr("more than 100 atoms near (0, 0, 0)"));
}

TEST_F(Molecules, DamagedOnesEndWell) {
  const std::string good =
      Atom(1, " C  ", 0, 0, 0, "C") + Atom(2, " N  ", 1.4, 0, 0, "N") + "CONECT    1    2\nEND\n";
  std::mt19937 random(5);
  for (int i = 0; i < 500; ++i) {
    std::string bytes = good;
    bytes[random() % bytes.size()] = static_cast<char>(random());
    if (i % 4 == 0) bytes.resize(1 + random() % bytes.size());
    (void)Import(bytes);
  }
}

TEST_F(Molecules, BallsStayWithinTheDisplay) {
  auto model = Import(Atom(1, " C  ", 0, 0, 0, "C") + Atom(2, " C  ", 1.5, 0, 0, "C"),
                      MoleculeStyle::kSpace);
  ASSERT_THAT(model, IsOk());
  PlaceModels({&*model, 1}, DisplaySpace(), {});
  const Part& part = model->parts[0];
  EXPECT_NEAR(part.positions[1].x + part.thickness / 2, 0.97, 1e-9);
  // And are sent as balls of that size.
  std::vector<client::Shape> shapes;
  const ObjectSink sink = [&](const std::string&, std::vector<client::Part> parts, uint64_t) {
    for (client::Part& p : parts) shapes.push_back(p.shape);
    return absl::OkStatus();
  };
  ASSERT_TRUE(PackObject(*model, "a", {}, sink).ok());
  const auto& points = std::get<client::Points>(shapes.at(0));
  EXPECT_FLOAT_EQ(points.thickness.value, static_cast<float>(part.thickness));
  EXPECT_EQ(points.thickness.unit, client::Thickness::Unit::kUnits);
}

}  // namespace molecule_test
}  // namespace voxeld::voxelctl
