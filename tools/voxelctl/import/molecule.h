// Molecules: atoms and bonds as balls and rods, and chemistry's XYZ format, which needs no library.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "tools/voxelctl/import/elements.h"
#include "tools/voxelctl/import/import_options.h"
#include "tools/voxelctl/import/model.h"
#include "tools/voxelctl/import/source_file.h"

namespace voxeld::voxelctl {

// A ball and its share of the rods have five vertices if each atom has two bonds.
inline constexpr size_t kMostAtoms = kMaxModelVertices / 5;

struct MoleculeAtom {
  Point3 at;  // in ångström
  const ChemicalElement* element = &UnknownElement();
};

struct Molecule {
  std::vector<MoleculeAtom> atoms;
  std::vector<std::array<uint32_t, 2>> bonds;  // the bonds that the file names
  std::vector<Attribute> attributes;           // a value per atom
};

// Adds the atoms to `model` as thick points in the colours of their elements and, in the style
// kBalls, the bonds as thick segments, each half in its atom's colour. Atoms are also bonded if
// their distance is at most the sum of their covalent radii and 0.45 Å. With `attributes`, vertices
// get the attributes of `molecule` that have any value, and "element", the atomic number. Returns:
// InvalidArgument if a coordinate is not finite or beyond 1,000,000 Å, if there are too many atoms,
// or too many in one place.
absl::Status DrawMolecule(const SourceFile& file, Molecule molecule, MoleculeStyle style,
                          bool attributes, Model* model);

// Returns true if `text` begins like chemistry's XYZ format: the number of atoms, a comment, then
// an element and its coordinates on each line.
bool IsXyzMolecule(absl::string_view text);

// Reads the first frame. Elements are symbols, symbols with a label ("C12"), atomic numbers, or
// names of atoms in capitals ("CA1", "OW"), whose first letter is the element; a note says so.
// Columns after the coordinates become attributes: those that the comment names (Properties= of
// extended XYZ), otherwise "column 5" and so on. Further frames and lines that belong to no frame
// are counted. Errors: InvalidArgument with the line's number.
absl::StatusOr<Model> ReadXyzMolecule(const SourceFile& file, MoleculeStyle style,
                                      bool attributes = false);

}  // namespace voxeld::voxelctl
