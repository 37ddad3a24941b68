// From a file's name to a model: which reader reads what.
#pragma once

#include <memory>
#include <optional>
#include <string>

#include "absl/status/statusor.h"
#include "tools/voxelctl/import/model.h"
#include "tools/voxelctl/import/pdb_molecule.h"
#include "tools/voxelctl/import/raw_volume.h"
#include "tools/voxelctl/import/source_file.h"

namespace voxeld::voxelctl {

struct ImportOptions {
  bool globe = false;  // longitude and latitude of maps go on a sphere; meshes do not care
  std::optional<RawLayout> raw;  // what .raw files are
  MoleculeStyle style = MoleculeStyle::kBalls;
};

// Reads meshes. Stateless between calls; thread-safe. Exceptions of a library do not leave it.
class MeshImporter {
 public:
  virtual ~MeshImporter() = default;
  // Whether it has a reader for files with this extension.
  virtual bool Reads(const std::string& extension) const = 0;
  // `file` has passed the checks of its format (mesh_checks.h), so its counts fit its size.
  virtual absl::StatusOr<Model> Import(const SourceFile& file) const = 0;
};

// The one that this build has; without VOXELD_IMPORTERS one that says what it would take.
std::unique_ptr<MeshImporter> NewMeshImporter();

// The checks that a file of meshes has to pass before a MeshImporter sees it, by its extension.
absl::Status CheckMeshFile(const SourceFile& file);

// Reads `path` by its extension, having checked that the contents are of that kind: obj, stl, ply,
// gltf, glb; vox; pcd, las, xyz, txt, asc, pts, csv; geojson, topojson, json; nii, nii.gz, hdr, img, nrrd, nhdr, raw, dcm, and folders of
// DICOM slices; pdb, ent; svg; off, fbx, 3mf, dae, blend, ifc, bvh, and what else assimp reads, in a process of its own
// (contained.h). Every index is in range and every number finite (samples may be no number) in what is returned, and it is not
// empty. An error's message begins with the path and says what was found
// and what would be right.
absl::StatusOr<Model> ImportFile(const std::string& path, const ImportOptions& options);

}  // namespace voxeld::voxelctl
