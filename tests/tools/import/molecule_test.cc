// Tests molecules: atoms and bonds of real files, and the errors for broken ones.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <random>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_split.h"
#include "absl/strings/string_view.h"
#include "tests/tools/import/read_here.h"
#include "tests/tools/import/volume_files.h"
#include "tests/tools/voxelctl/status_matchers.h"
#include "tests/tools/voxelctl/temp_folder.h"
#include "tools/voxelctl/import/importer.h"
#include "tools/voxelctl/scene/pack.h"
#include "tools/voxelctl/scene/placement.h"

namespace voxeld::voxelctl {
namespace molecule_test {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsNan;

std::string Atom(int serial, const std::string& name, double x, double y, double z,
                 const std::string& element = "", char location = ' ') {
  return absl::StrFormat("HETATM%5d %-4s%cLIG A   1    %8.3f%8.3f%8.3f  1.00  0.00          %2s\n",
                         serial, name, location, x, y, z, element);
}

size_t AtomsOf(const Model& model) {
  size_t atoms = 0;
  for (const Part& part : model.parts)
    atoms += part.kind == Kind::kPoints ? part.positions.size() : 0;
  return atoms;
}

// Returns the values of an attribute of all atoms, part by part.
std::vector<double> ValuesOf(const Model& model, const std::string& name) {
  std::vector<double> values;
  for (const Part& part : model.parts) {
    for (const Attribute& one : part.attributes) {
      if (part.kind == Kind::kPoints && one.name == name)
        values.insert(values.end(), one.values.begin(), one.values.end());
    }
  }
  return values;
}

// A table _atom_site; `rows` have: element, name, alternate location, residue, chain, residue
// number, x, y, z, model.
std::string Cif(const std::string& rows) {
  return absl::StrCat(
      "data_X\nloop_\n_atom_site.type_symbol\n_atom_site.label_atom_id\n_atom_site.label_alt_id\n"
      "_atom_site.label_comp_id\n_atom_site.auth_asym_id\n_atom_site.auth_seq_id\n"
      "_atom_site.Cartn_x\n_atom_site.Cartn_y\n_atom_site.Cartn_z\n"
      "_atom_site.pdbx_PDB_model_num\n",
      rows);
}

class Molecules : public testing::Test {
 protected:
  absl::StatusOr<Model> Import(const std::string& bytes,
                               MoleculeStyle style = MoleculeStyle::kBalls) {
    return ReadHere(folder_.Write("a.pdb", bytes), {.style = style, .attributes = true});
  }
  // Counts the bonds of the first part, which has the rods, if there are any.
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
  absl::StatusOr<Model> ImportAs(const std::string& name, const std::string& bytes) {
    return ReadHere(folder_.Write(name, bytes), {.attributes = true});
  }
  std::string ErrorOf(const std::string& name, const std::string& bytes) {
    return std::string(ImportAs(name, bytes).status().message());
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
  EXPECT_EQ(model->left_out, (std::vector<LeftOut>{{"further models", 1}}));
}

TEST_F(Molecules, FramesThatEndDivides) {
  for (const char* end : {"END\n", "END   \n", "ENDMDL\n"}) {
    const auto model = Import(
        absl::StrCat(Atom(1, " C  ", 0, 0, 0, "C"), end, Atom(1, " C  ", 5, 0, 0, "C"), end));
    ASSERT_THAT(model, IsOk());
    EXPECT_EQ(model->parts.at(0).positions.size(), 1u) << end;
    EXPECT_EQ(model->left_out, (std::vector<LeftOut>{{"further models", 1}}));
  }
}

TEST_F(Molecules, AnEndBeforeTheFirstAtomDoesNotDivide) {
  const auto model =
      Import("END\n" + Atom(1, " C  ", 0, 0, 0, "C") + Atom(2, " C  ", 5, 0, 0, "C"));
  ASSERT_THAT(model, IsOk());
  EXPECT_EQ(AtomsOf(*model), 2u);
  EXPECT_TRUE(model->left_out.empty());
}

TEST_F(Molecules, ModelsThatOnlyBegin) {
  const std::string atom = Atom(1, " C  ", 0, 0, 0, "C");
  for (const char* begin : {"MODEL        2\n", "MODEL 2\n", "MODEL\n"}) {
    for (const char* end : {"", "TER\n", "ENDMDL\n"}) {
      const auto model = Import(
          absl::StrCat("MODEL        1\n", atom, end, begin, atom, end, begin, atom, "END\n"));
      ASSERT_THAT(model, IsOk());
      EXPECT_EQ(model->parts.at(0).positions.size(), 1u) << begin << end;
      EXPECT_EQ(model->left_out, (std::vector<LeftOut>{{"further models", 2}}));
    }
  }
}

// CRYST1 has the cell in columns 7 to 54 and the space group in 56 to 66 (wwPDB's format 3.3).
TEST_F(Molecules, CopiesByTheSymmetryOfACrystalAreCounted) {
  const std::string atom = Atom(1, " C  ", 0, 0, 0, "C");
  const auto copies = [&](const std::string& group, double gamma = 90) {
    const auto model = Import(absl::StrFormat("CRYST1%9.3f%9.3f%9.3f%7.2f%7.2f%7.2f %-11s%4d\n",
                                              20., 30., 40., 90., 90., gamma, group, 4) +
                              atom);
    EXPECT_TRUE(model.ok()) << model.status();
    return model.ok() ? model->left_out : std::vector<LeftOut>();
  };
  const auto counted = [](uint64_t count) {
    return std::vector<LeftOut>{{"copies by crystal symmetry", count}};
  };
  EXPECT_EQ(copies("P 21 21 21"), counted(3));
  EXPECT_EQ(copies("C 1 2 1"), counted(3));
  EXPECT_EQ(copies("P 43 21 2"), counted(7));
  EXPECT_EQ(copies("H 3", 120), counted(8));
  EXPECT_TRUE(copies("P 1").empty());
  EXPECT_TRUE(copies("").empty());
  EXPECT_EQ(copies("Q 7"), (std::vector<LeftOut>{{"space groups that are not known", 1}}));

  const std::string row = "C C . ALA A 1 0 0 0 1\n";
  const auto cif = [&](const std::string& symmetry) {
    const auto model = ImportAs("a.cif", Cif(row) + symmetry);
    EXPECT_TRUE(model.ok()) << model.status();
    return model.ok() ? model->left_out : std::vector<LeftOut>();
  };
  EXPECT_EQ(cif("_symmetry.space_group_name_H-M 'P 21 21 21'\n"), counted(3));
  EXPECT_EQ(cif("_space_group.name_H-M_alt 'C 1 2 1'\n"), counted(3));
  EXPECT_EQ(cif("_symmetry.Int_Tables_number 96\n_symmetry.space_group_name_H-M ?\n"), counted(7));
  EXPECT_EQ(cif("loop_\n_space_group_symop.id\n_space_group_symop.operation_xyz\n1 x,y,z\n"
                "2 -x,-y,-z\n"),
            counted(1));
  EXPECT_TRUE(cif("_symmetry.space_group_name_H-M 'P 1'\n").empty());
}

TEST_F(Molecules, AResidueHasOneLocationWhateverItsLetter) {
  const auto model = Import(Atom(1, " N  ", 0, 0, 0, "N") + Atom(2, " CA ", 9, 0, 0, "C", 'B') +
                            Atom(3, " CA ", 9, 1, 0, "C", 'C') + Atom(4, " C  ", 20, 0, 0, "C"));
  ASSERT_THAT(model, IsOk());
  EXPECT_EQ(AtomsOf(*model), 3u);
  EXPECT_EQ(model->left_out, (std::vector<LeftOut>{{"atoms at alternate locations", 1}}));
}

TEST_F(Molecules, RealProteins) {
  const auto model = ReadHere("/usr/share/pymol/data/tut/1hpv.pdb", {});
  ASSERT_THAT(model, IsOk()) << "tools/setup --import installs pymol-data";
  EXPECT_EQ(AtomsOf(*model), 1631u);  // grep -cE '^(ATOM|HETATM)'
  // grep -c '^HELIX', '^SHEET'
  // The space group P 61 has 6 operators.
  EXPECT_EQ(model->left_out,
            (std::vector<LeftOut>{
                {"helices", 2}, {"strands of sheets", 19}, {"copies by crystal symmetry", 5}}));
  // A chain of amino acids has about as many bonds as atoms, and a few more for rings.
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
  EXPECT_THAT(Error(crowd), HasSubstr("more than 32 atoms near (0, 0, 0)"));
}

TEST_F(Molecules, DamagedOnesEndWell) {
  const std::string pdb =
      "HELIX    1   1 ALA A    1  ALA A    2  1                                   2\n"
      "SHEET    1   A 2 ALA A   1  ALA A   2  0\n"
      "REMARK 350   BIOMT1   1  1.000000  0.000000  0.000000        0.00000\n"
      "SSBOND   1 CYS A    1    CYS A    2                          1555   1555  2.03\n" +
      Atom(1, " C  ", 0, 0, 0, "C") + Atom(2, " N  ", 1.4, 0, 0, "N") + "CONECT    1    2\nEND\n";
  const std::string cif =
      Cif("N N . ALA A 1 0 0 0 1\nC 'CA' B ALA A 1 1.4 0 0 1\n;C\n; C . LIG A 3 53 0 0 1\n") +
      "_struct_conn.conn_type_id covale\n_struct_conn.ptnr1_auth_asym_id A\n"
      "data_n\n_cell_length_a 5\nloop_\n_atom_site_label\n_atom_site_fract_x\nC1 0.5\n";
  const std::string xyz =
      "2\nProperties=species:S:1:pos:R:3:q:R:1\nC 0 0 0 1\nN 1 0 0 2\n1\n\nH 0 0 0\n";
  std::mt19937 random(5);
  for (const auto& [name, good] : std::vector<std::pair<std::string, std::string>>{
           {"a.pdb", pdb}, {"a.cif", cif}, {"a.xyz", xyz}, {"a.cif.gz", Gzip(cif)}}) {
    ASSERT_THAT(ImportAs(name, good), IsOk()) << name;
    for (int i = 0; i < 500; ++i) {
      std::string bytes = good;
      for (uint32_t k = 1 + random() % 4; k > 0; --k)
        bytes[random() % bytes.size()] = static_cast<char>(random());
      if (i % 4 == 0) bytes.resize(1 + random() % bytes.size());
      const auto model = ImportAs(name, bytes);
      if (!model.ok()) EXPECT_THAT(model.status().message(), HasSubstr(name));
    }
  }
}

TEST_F(Molecules, SerialNumbersOfAnyKind) {
  // Hexadecimal, hybrid-36 and stars: the atoms of CONECT are identified by the text, and stars do
  // not identify an atom.
  const auto bonds = [this](const std::string& first, const std::string& second) {
    std::string a = Atom(1, " C  ", 0, 0, 0, "C"), b = Atom(2, " C  ", 5, 0, 0, "C");
    a.replace(6, 5, first);
    b.replace(6, 5, second);
    return Bonds(a + b + "CONECT" + first + second + "\n");
  };
  EXPECT_EQ(bonds("186a0", "186a1"), 1u);
  EXPECT_EQ(bonds("A0000", "A0001"), 1u);
  EXPECT_EQ(bonds("99999", "A0000"), 1u);
  EXPECT_EQ(bonds("*****", "*****"), 0u);
  // After 99,999 some programs start again: it is ambiguous which atom is meant, and that is
  // reported.
  const auto model = Import(Atom(1, " C  ", 0, 0, 0, "C") + Atom(1, " C  ", 5, 0, 0, "C") +
                            Atom(2, " C  ", 9, 0, 0, "C") + "CONECT    1    2\n");
  ASSERT_THAT(model, IsOk());
  EXPECT_EQ(model->left_out,
            (std::vector<LeftOut>{{"bonds by serial numbers that several atoms have", 1}}));
}

TEST_F(Molecules, LinksAndWhatIsNotDrawn) {
  std::string atoms = Atom(1, " SG ", 0, 0, 0, "S") + Atom(2, " SG ", 5, 0, 0, "S");
  atoms.replace(atoms.find('\n') + 1 + 25, 1, "2");  // the second atom is in residue 2
  // wwPDB's format 3.3: residues in columns 16 to 22 and 30 to 36, atoms in 13 to 16 and 43 to 46, symmetry from 60 and 67.
  const std::string bridge =
      "SSBOND   1 LIG A    1    LIG A    2                          1555   1555  2.03\n";
  EXPECT_EQ(Bonds(bridge + atoms), 1u);
  const std::string link =
      "LINK         SG  LIG A   1                 SG  LIG A   2     1555   1555  5.00\n";
  EXPECT_EQ(Bonds(link + atoms), 1u);
  std::string other = link;
  other.replace(other.rfind("1555"), 4, "2655");
  const auto model =
      Import(other +
             "REMARK 350 BIOMOLECULE: 1\nREMARK 350 APPLY THE FOLLOWING TO CHAINS: A\n"
             "REMARK 350   BIOMT1   1  1.000000  0.000000  0.000000        0.00000\n"
             "REMARK 350   BIOMT2   1  0.000000  1.000000  0.000000        0.00000\n"
             "REMARK 350   BIOMT3   1  0.000000  0.000000  1.000000        0.00000\n"
             "REMARK 350   BIOMT1   2 -1.000000  0.000000  0.000000        0.00000\n"
             "REMARK 350   BIOMT2   2  0.000000 -1.000000  0.000000        0.00000\n"
             "REMARK 350   BIOMT3   2  0.000000  0.000000  1.000000        0.00000\n" +
             atoms);
  ASSERT_THAT(model, IsOk());
  EXPECT_EQ(model->left_out, (std::vector<LeftOut>{{"copies by assembly operators", 1},
                                                   {"bonds to symmetry copies", 1}}));
}

TEST_F(Molecules, NumbersOfAtomsAreAttributes) {
  const auto model = Import(
      "ATOM      1  N   ALA A   7      11.104   6.134  -6.504  0.50 12.25           N1+\n"
      "ATOM      2  O   ALA B   8      21.639   6.071  -5.147                       O\n");
  ASSERT_THAT(model, IsOk());
  EXPECT_THAT(ValuesOf(*model, "b_factor"), ElementsAre(IsNan(), 12.25f));  // oxygen first
  EXPECT_THAT(ValuesOf(*model, "occupancy"), ElementsAre(IsNan(), 0.5f));
  EXPECT_THAT(ValuesOf(*model, "charge"), ElementsAre(IsNan(), 1.f));
  EXPECT_THAT(ValuesOf(*model, "chain"), ElementsAre(2.f, 1.f));
  EXPECT_THAT(ValuesOf(*model, "residue"), ElementsAre(8.f, 7.f));
  EXPECT_THAT(ValuesOf(*model, "element"), ElementsAre(8.f, 7.f));
}

TEST_F(Molecules, NamesThatStandToTheLeftInProteins) {
  const auto color = [this](const std::string& name, const std::string& residue) {
    return Import(absl::StrFormat("ATOM      1 %-4s %3s A   1       0.000   0.000   0.000\n", name,
                                  residue))
        ->parts.back()
        .colors[0];
  };
  EXPECT_EQ(color("CE", "LYS"), color(" CE", "LYS")) << "carbon, not cerium";
  EXPECT_EQ(color("CD1", "HIE"), (Rgb{144, 144, 144}));
  EXPECT_EQ(color("CA", "CA"), (Rgb{61, 255, 0})) << "an ion";
}

TEST_F(Molecules, CompressedOnes) {
  const std::string water = Atom(1, " O  ", 0, 0, 0, "O");
  EXPECT_THAT(ImportAs("a.pdb.gz", Gzip(water)), IsOk());
  EXPECT_THAT(ImportAs("a.ent.gz", Gzip(water)), IsOk());
  EXPECT_THAT(ImportAs("a.cif.gz", Gzip(Cif("O O . HOH A 1 0 0 0 1\n"))), IsOk());
  EXPECT_THAT(ErrorOf("a.cif.gz", Gzip(water)), HasSubstr("a CIF file begins with data_"));
  EXPECT_THAT(ErrorOf("a.pdb.gz", Gzip(water).substr(0, 30)), HasSubstr("cut off"));
}

TEST_F(Molecules, MmCif) {
  const auto model = ImportAs(
      "a.cif",
      Cif("N N . ALA A 1 0 0 0 1\n# a comment\nC \"CA\" B ALA A 1 1.4 0 0 1\n"
          "C CA C ALA A 1 1.5 0 0 1\nO 'O5'x y' . ALA \"A\" 1 9 0 0(3) 1\nZN ZN . ZN A 2 50 0 0 1\n"
          "C\n;C1\n;\n. LIG A 3 53 0 0 1\nC X . LIG A 4 ? ? ? 1\nN N . ALA A 1 0 0 0 2\n"
          "loop_\n_struct_conn.conn_type_id\n_struct_conn.ptnr1_auth_asym_id\n"
          "_struct_conn.ptnr1_auth_seq_id\n_struct_conn.ptnr1_label_atom_id\n"
          "_struct_conn.ptnr1_symmetry\n_struct_conn.ptnr2_auth_asym_id\n"
          "_struct_conn.ptnr2_auth_seq_id\n_struct_conn.ptnr2_label_atom_id\n"
          "_struct_conn.ptnr2_symmetry\n"
          "metalc A 2 ZN 1_555 A 3 C1 1_555\nhydrog A 1 N 1_555 A 3 C1 1_555\n"
          "covale A 1 N 1_555 A 3 C1 2_655\n"
          "_struct_conf.conf_type_id HELX_P\ndata_next\n_cell_length_a 3\n"));
  ASSERT_THAT(model, IsOk());
  EXPECT_EQ(model->format, "mmCIF molecule");
  EXPECT_EQ(AtomsOf(*model), 5u);
  // N-CA by their distance, Zn-C1 because the file says so.
  EXPECT_EQ(model->parts[0].indices.size() / 4, 2u);
  EXPECT_EQ(model->left_out, (std::vector<LeftOut>{{"further models", 1},
                                                   {"atoms without coordinates", 1},
                                                   {"hydrogen bonds", 1},
                                                   {"bonds to symmetry copies", 1},
                                                   {"helices", 1},
                                                   {"atoms at alternate locations", 1}}));
}

TEST_F(Molecules, MmCifOfOneAtomWithoutALoop) {
  const auto model = ImportAs("a.mmcif",
                              "data_a\n_atom_site.Cartn_x 1\n_atom_site.Cartn_y 2\n"
                              "_atom_site.Cartn_z 3\n_atom_site.type_symbol K\n");
  ASSERT_THAT(model, IsOk());
  EXPECT_THAT(model->parts.at(0).positions, ElementsAre(Point3{1, 2, 3}));
  EXPECT_EQ(ValuesOf(*model, "element").at(0), 19);
}

TEST_F(Molecules, ChemicalComponents) {
  const std::string component =
      "data_comp_list\n_chem_comp.id HOH\ndata_comp_HOH\nloop_\n_chem_comp_atom.comp_id\n"
      "_chem_comp_atom.atom_id\n_chem_comp_atom.type_symbol\n_chem_comp_atom.charge\n"
      "_chem_comp_atom.model_Cartn_x\n_chem_comp_atom.model_Cartn_y\n"
      "_chem_comp_atom.model_Cartn_z\n_chem_comp_atom.pdbx_model_Cartn_x_ideal\n"
      "_chem_comp_atom.pdbx_model_Cartn_y_ideal\n_chem_comp_atom.pdbx_model_Cartn_z_ideal\n"
      "HOH O O 0 0 0 0 1 1 1\nHOH H1 H 0 3 0 0 1 1 2\nloop_\n_chem_comp_bond.comp_id\n"
      "_chem_comp_bond.atom_id_1\n_chem_comp_bond.atom_id_2\nHOH O H1\n";
  const auto model = ImportAs("a.cif", component);
  ASSERT_THAT(model, IsOk());
  EXPECT_EQ(AtomsOf(*model), 2u);
  EXPECT_EQ(model->parts[0].indices.size() / 4, 1u);
  EXPECT_EQ(model->left_out, (std::vector<LeftOut>{{"further models", 1}}));
  // A deposited structure may include the bonds of its components.
  const auto whole = ImportAs(
      "a.cif", Cif("O O . HOH A 1 0 0 0 1\nH H1 . HOH A 1 3 0 0 1\nO O . HOH A 2 9 0 0 1\n") +
                   component.substr(component.rfind("loop_")));
  ASSERT_THAT(whole, IsOk());
  EXPECT_EQ(whole->parts[0].indices.size() / 4, 1u);
}

TEST_F(Molecules, CrystalsInFractions) {
  // Sodium chloride: a cell of 5.62 Å, in the space group F m -3 m, which has 192 operators.
  const std::string cell =
      "data_nacl\n_cell_length_a 5.62(2)\n_cell_length_b 5.62\n_cell_length_c 5.62\n"
      "_cell_angle_alpha 90\n_cell_angle_beta 90\n_cell_angle_gamma 90\n";
  const std::string sites =
      "loop_\n_atom_site_label\n_atom_site_type_symbol\n_atom_site_fract_x\n_atom_site_fract_y\n"
      "_atom_site_fract_z\n_atom_site_disorder_group\nNa1 Na1+ 0 0 0 .\nCl1 Cl1- .5 0.50(1) +0.5 "
      "1\n"
      "Cl2 Cl1- .5 0.5 0.5 2\n";
  const auto model =
      ImportAs("a.cif", cell + "_symmetry_space_group_name_H-M 'F m -3 m'\n" + sites);
  ASSERT_THAT(model, IsOk());
  EXPECT_EQ(AtomsOf(*model), 2u);
  EXPECT_EQ(ValuesOf(*model, "element"), (std::vector<double>{17, 11}));
  EXPECT_EQ(ValuesOf(*model, "charge"), (std::vector<double>{-1, 1}));
  EXPECT_NEAR(model->parts[0].positions[0].y, 2.81, 1e-9);
  EXPECT_EQ(model->left_out, (std::vector<LeftOut>{{"copies by crystal symmetry", 191},
                                                   {"atoms at alternate locations", 1}}));
  EXPECT_THAT(ErrorOf("a.cif", "data_a\n" + sites), HasSubstr("without a unit cell"));
}

// In CIF's core dictionary, groups are alternatives within an assembly, and assemblies are
// independent of each other.
TEST_F(Molecules, EachAssemblyOfADisorderedCrystalShowsItsFirstGroup) {
  const std::string cell =
      "data_x\n_cell_length_a 10\n_cell_length_b 10\n_cell_length_c 10\n_cell_angle_alpha 90\n"
      "_cell_angle_beta 90\n_cell_angle_gamma 90\nloop_\n_atom_site_label\n_atom_site_fract_x\n"
      "_atom_site_fract_y\n_atom_site_fract_z\n";
  const std::string sites = "_atom_site_disorder_assembly\n_atom_site_disorder_group\n";
  // O1, N3 and F4 are in the first groups; assembly C has the same names of groups as assembly A.
  const auto model = ImportAs("a.cif", cell + sites +
                                           "C1 0 0 0 . .\nO1 .5 0 0 A 1\nO2 .5 .1 0 A 2\n"
                                           "N3 0 .5 0 B 3\nN4 0 .6 0 B 4\nF4 0 0 .5 C 2\n"
                                           "F5 0 .1 .5 C 1\nS6 .5 .5 .5 . .\n");
  ASSERT_THAT(model, IsOk());
  std::vector<double> elements = ValuesOf(*model, "element");
  std::sort(elements.begin(), elements.end());
  EXPECT_EQ(elements, (std::vector<double>{6, 7, 8, 9, 16}));
  EXPECT_EQ(model->left_out, (std::vector<LeftOut>{{"atoms at alternate locations", 3}}));
}

// CIF's dictionary has 90° as the default of the cell's angles.
TEST_F(Molecules, CellsWithoutAnglesHaveRightOnes) {
  const std::string lengths = "data_x\n_cell_length_a 10\n_cell_length_b 20\n_cell_length_c 30\n";
  const std::string sites =
      "loop_\n_atom_site_label\n_atom_site_fract_x\n_atom_site_fract_y\n_atom_site_fract_z\n"
      "C1 0.5 0.5 0.5\n";
  for (const char* angles : {"", "_cell_angle_alpha .\n_cell_angle_gamma 90\n"}) {
    const auto model = ImportAs("a.cif", absl::StrCat(lengths, angles, sites));
    ASSERT_THAT(model, IsOk()) << angles;
    const Point3 at = model->parts.at(0).positions.at(0);
    EXPECT_NEAR(at.x, 5, 1e-9);
    EXPECT_NEAR(at.y, 10, 1e-9);
    EXPECT_NEAR(at.z, 15, 1e-9);
    EXPECT_THAT(model->note, HasSubstr("angles of the unit cell that it does not have are 90°"));
  }
  const auto monoclinic = ImportAs("a.cif", lengths + "_cell_angle_beta 120\n" + sites);
  ASSERT_THAT(monoclinic, IsOk());
  EXPECT_NEAR(monoclinic->parts.at(0).positions.at(0).x, 5 - 15 * 0.5, 1e-9);
  EXPECT_THAT(ErrorOf("a.cif", lengths + "_cell_angle_beta wide\n" + sites),
              HasSubstr("without a unit cell"));
}

TEST_F(Molecules, CifThatIsWrong) {
  EXPECT_THAT(ErrorOf("a.cif", "hello"), HasSubstr("a CIF file begins with data_"));
  EXPECT_THAT(ErrorOf("a.cif", "data_a\n_cell_length_a 3\n"), HasSubstr("without coordinates"));
  EXPECT_THAT(ErrorOf("a.cif", "data_a\n_a.b\n_a.c 3\n"),
              HasSubstr("line 3 follows the tag _a.b without a value"));
  EXPECT_THAT(ErrorOf("a.cif", Cif("C C . ALA A 1 0 0 0\n")),
              HasSubstr("the loop of line 2 has 9 values and 10 tags"));
  EXPECT_THAT(ErrorOf("a.cif", Cif("C 'C . ALA A 1 0 0 0 1\n")),
              HasSubstr("line 13 has a quotation mark that is not closed"));
  EXPECT_THAT(ErrorOf("a.cif", Cif(";C\n")), HasSubstr("line 13 begins a text that does not end"));
  EXPECT_THAT(ErrorOf("a.cif", Cif("C C . ALA A 1 x y z 1\n")),
              HasSubstr("has no atom with coordinates"));
  EXPECT_THAT(ErrorOf("a.cif", Cif("C C . ALA A 1 1e9 0 0 1\n")),
              HasSubstr("has an atom with the coordinate 1e+09"));
}

// Chemistry's format: the number of atoms, a comment, an element with its coordinates on each line.
TEST_F(Molecules, Xyz) {
  for (const char* comment : {"water", "", "1 2 3", "-76.4"}) {
    for (const char* name : {"a.xyz", "a.txt"}) {
      const auto model = ImportAs(
          name, absl::StrCat(" 3\r\n", comment, "\r\nO 0 0 0.117\r\nH 0 .757 -0.469\r\nH 0 -.757 ",
                             "-4.69D-01\r\n"));
      ASSERT_THAT(model, IsOk()) << comment;
      EXPECT_EQ(model->format, "XYZ molecule");
      EXPECT_EQ(AtomsOf(*model), 3u);
      EXPECT_EQ(model->parts[0].indices.size() / 4, 2u);
      EXPECT_TRUE(model->left_out.empty());
    }
  }
}

TEST_F(Molecules, XyzOfSeveralFramesShowsTheFirst) {
  const std::string frame = "2\nstep\nC1 0 0 0 0.5\nCl 1.7 0 0 -0.5\n";
  const auto model = ImportAs("a.xyz", frame + frame + frame + "\ntotal energy\n");
  ASSERT_THAT(model, IsOk());
  EXPECT_EQ(AtomsOf(*model), 2u);
  EXPECT_EQ(ValuesOf(*model, "element"), (std::vector<double>{6, 17}));
  EXPECT_EQ(ValuesOf(*model, "column 5"), (std::vector<double>{0.5, -0.5}));
  EXPECT_EQ(model->left_out,
            (std::vector<LeftOut>{{"further models", 2}, {"lines after the last atom", 1}}));
}

TEST_F(Molecules, XyzByAtomicNumbersAndWithNamedColumns) {
  const auto numbers = ImportAs("a.xyz", "2\nenergy\n8 0 0 0\n1 0.9 0 0\n");
  ASSERT_THAT(numbers, IsOk());
  EXPECT_EQ(ValuesOf(*numbers, "element"), (std::vector<double>{1, 8}));
  const auto extended = ImportAs(
      "a.xyz",
      "1\nLattice=\"1 0 0 0 1 0 0 0 1\" Properties=id:I:1:species:S:1:pos:R:3:forces:R:3 pbc=T\n"
      "7 Xx 1 2 3 0.1 0.2 0.3\n");
  ASSERT_THAT(extended, IsOk());
  EXPECT_THAT(extended->parts.at(0).positions, ElementsAre(Point3{1, 2, 3}));
  EXPECT_EQ(ValuesOf(*extended, "id"), (std::vector<double>{7}));
  EXPECT_EQ(ValuesOf(*extended, "forces_3"), (std::vector<double>{0.3}));
}

// VMD writes names of atoms in place of symbols.
TEST_F(Molecules, XyzWithNamesOfAtoms) {
  const auto elements = [&](const std::string& words, std::string* note = nullptr) {
    std::string text;
    int count = 0;
    for (const absl::string_view word : absl::StrSplit(words, ' '))
      absl::StrAppend(&text, word, " ", 9 * count, " 0 0 ", count, "\n"), ++count;
    const auto model = ImportAs("a.xyz", absl::StrCat(count, "\nnames\n", text));
    EXPECT_TRUE(model.ok()) << model.status();
    if (!model.ok()) return std::vector<double>();
    if (note != nullptr) *note = model->note;
    std::vector<double> numbers(static_cast<size_t>(count));
    const std::vector<double> order = ValuesOf(*model, "column 5"),
                              found = ValuesOf(*model, "element");
    for (size_t i = 0; i < order.size(); ++i) numbers[static_cast<size_t>(order[i])] = found[i];
    return numbers;
  };
  std::string note;
  EXPECT_EQ(elements("CA1 CA2 HO1", &note), (std::vector<double>{6, 6, 1}));
  EXPECT_EQ(note, "3 atoms have names, such as CA1, whose first letter is taken for the element");
  // CB is not a symbol, so CA is not calcium and NE is not neon.
  EXPECT_EQ(elements("CA CB NE", &note), (std::vector<double>{6, 6, 7}));
  EXPECT_THAT(note, HasSubstr("3 atoms have names, such as CB"));
  EXPECT_EQ(elements("CA O NE", &note), (std::vector<double>{20, 8, 10}));
  EXPECT_EQ(note, "");
  EXPECT_EQ(elements("Ca1 Na2 FE1 CL2 ZN3 C12", &note),
            (std::vector<double>{20, 11, 26, 17, 30, 6}));
  EXPECT_EQ(note, "");
}

TEST_F(Molecules, PointCloudsAreNotTakenForMolecules) {
  for (const char* cloud : {"2\n1 2 3 4\n5 6 7 8\n", "1 2 3\n4 5 6\n", "x y z\n1 2 3\n",
                            "3\n1 2 3 4\n5 6 7 8\n5 6 7 9\n"}) {
    const auto model = ImportAs("a.xyz", cloud);
    ASSERT_THAT(model, IsOk()) << cloud;
    EXPECT_EQ(model->format, "XYZ points");
  }
}

TEST_F(Molecules, XyzThatIsWrong) {
  EXPECT_THAT(ErrorOf("a.xyz", "3\nwater\nO 0 0 0\nH 1 0 0\n"),
              HasSubstr("announces 3 atoms and ends after 2"));
  EXPECT_THAT(ErrorOf("a.xyz", "2\nwater\nO 0 0 0\nH 1 zero 0\n"),
              HasSubstr("line 4 has \"zero\" in column 3"));
  EXPECT_THAT(ErrorOf("a.xyz", "2\nwater\nO 0 0 0\nH 1 0\n"), HasSubstr("line 4 has 3 columns"));
  EXPECT_THAT(ErrorOf("a.xyz", "2\nwater\nO 0 0 0\n? 1 0 0\n"),
              HasSubstr("line 4 begins with \"?\""));
  EXPECT_THAT(ErrorOf("a.xyz", "2\nwater\nO 0 0 0\nO nan 0 0\n"),
              HasSubstr("line 4 has \"nan\" in column 2"));
}

// Bonds are found with a grid, which has all of them.
TEST_F(Molecules, LargeOnesHaveAllBonds) {
  std::string rows;
  for (int i = 0; i < 100'000; ++i)
    absl::StrAppend(&rows, "C C . LIG A ", i, " ", 1.5 * (i % 50), " ", 1.5 * (i / 50 % 50), " ",
                    1.5 * (i / 2500), " 1\n");
  const auto model = ImportAs("a.cif", Cif(rows));
  ASSERT_THAT(model, IsOk());
  EXPECT_EQ(AtomsOf(*model), 100'000u);
  // A grid of 50 by 50 by 40 atoms: 49·50·40 + 50·49·40 + 50·50·39 edges.
  EXPECT_EQ(model->parts[0].indices.size() / 4, 293'500u);
}

TEST_F(Molecules, BallsStayWithinTheDisplay) {
  auto model = Import(Atom(1, " C  ", 0, 0, 0, "C") + Atom(2, " C  ", 1.5, 0, 0, "C"),
                      MoleculeStyle::kSpace);
  ASSERT_THAT(model, IsOk());
  PlaceModels({&*model, 1}, DisplaySpace(), {});
  const Part& part = model->parts[0];
  EXPECT_NEAR(part.positions[1].x + part.thickness / 2, 0.97, 1e-9);
  // And they are sent as balls of that size.
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
