// From a file's name to a model: which reader reads what.
#pragma once

#include <optional>
#include <string>

#include "absl/status/statusor.h"
#include "tools/voxelctl/import/model.h"
#include "tools/voxelctl/import/pdb_molecule.h"
#include "tools/voxelctl/import/raw_volume.h"
#include "tools/voxelctl/import/source_file.h"
#include "tools/voxelctl/process/interrupt.h"

namespace voxeld::voxelctl {

struct ImportOptions {
  bool globe = false;  // longitude and latitude of maps go on a sphere; meshes do not care
  std::optional<RawLayout> raw;  // what .raw files are
  MoleculeStyle style = MoleculeStyle::kBalls;
  OtherFiles other_files = OtherFiles::kBelow;
  Interrupt* interrupt = nullptr;  // ends the reading; may be null
};

// Reads `path` by its extension, having checked that the contents are of that kind. Every build reads stl, ply, vox, xyz, txt, asc,
// pts, csv, geojson, topojson and json. VOXELD_IMPORTERS adds obj, gltf, glb; pcd, las; nii, nii.gz, hdr, img, nrrd, nhdr, raw,
// dcm, and folders of DICOM slices; pdb, ent; svg; off, fbx, 3mf, dae, blend, ifc, bvh, and what else assimp reads. All are read in a
// process of its own, with limits and in a sandbox (contained.h). Every index is in range and every number finite (samples may be no number) in what is returned, and it is
// not empty. An error's message begins with the path and says what was found and what would be right.
absl::StatusOr<Model> ImportFile(const std::string& path, const ImportOptions& options);

// Returns: InvalidArgument unless `model` is all that is promised above.
absl::Status CheckModel(const SourceFile& file, const Model& model);

// The same for a file that was read, in this process: for tests and fuzz targets, whose sanitizers are to see what happens.
absl::StatusOr<Model> ReadSource(const SourceFile& file, const ImportOptions& options);

}  // namespace voxeld::voxelctl
