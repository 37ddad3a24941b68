// Reads molecules of the Protein Data Bank (.pdb, .ent, .cif, .mmcif, and these compressed by gzip)
// with gemmi.
//
// gemmi was chosen because crystallographers' programs use it, it consists of headers only, and it
// knows the dialects of old files. Version 0.5.7 mishandles the following, so this reader does it
// itself. In PDB files gemmi stops at the first END, ignores CONECT, reads a coordinate that is not
// a number as 0, and searches all chains whenever the chain changes. Its tables of CIF do not
// compile as C++20, and their parser needs two more libraries (PEGTL, stb). So CIF is parsed here,
// and gemmi supplies numbers with their uncertainty, elements, unit cells and space groups.
#pragma once

#include "absl/status/statusor.h"
#include "tools/voxelctl/import/import_options.h"
#include "tools/voxelctl/import/model.h"
#include "tools/voxelctl/import/source_file.h"

namespace voxeld::voxelctl {

// Reads the atoms of the first model, with the first alternate location of each residue. Bonds are
// those named by CONECT, LINK, SSBOND, _struct_conn or _chem_comp_bond, and those by distance. Also
// reads chemical components and crystals of small molecules (fractional coordinates; the atoms of
// the asymmetric unit). Attributes are "b_factor", "occupancy", "charge", "chain" (counted from 1
// in the order of the file) and "residue" (its number). Errors: InvalidArgument with the line's
// number or the table's name.
absl::StatusOr<Model> ReadMolecule(const SourceFile& file, MoleculeStyle style,
                                   bool attributes = false);

}  // namespace voxeld::voxelctl
