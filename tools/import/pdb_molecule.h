// Molecules of the Protein Data Bank (.pdb, .ent; its format of columns, version 3.3 and before).
#pragma once

#include "absl/status/statusor.h"
#include "tools/voxelctl/import/import_options.h"
#include "tools/voxelctl/import/model.h"
#include "tools/voxelctl/import/source_file.h"

namespace voxeld::voxelctl {

// The atoms of the first model, of each residue the first alternate location, in the colours of their elements, as thick points; bonds, which
// CONECT names or which are as long as two covalent radii, as thick segments, each half in its atom's colour. InvalidArgument with
// the line's number.
absl::StatusOr<Model> ReadPdbMolecule(const SourceFile& file, MoleculeStyle style);

}  // namespace voxeld::voxelctl
