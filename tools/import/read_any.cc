#include "tools/import/read_any.h"

#include <algorithm>
#include <array>
#include <assimp/Importer.hpp>
#include <utility>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "common/text/printable.h"
#include "tools/import/assimp_scene.h"
#include "tools/import/clouds.h"
#include "tools/import/dicom_check.h"
#include "tools/import/gdal_map.h"
#include "tools/import/gemmi_molecule.h"
#include "tools/import/gltf_model.h"
#include "tools/import/mesh_beginning.h"
#include "tools/import/obj_model.h"
#include "tools/import/rsvg_drawing.h"
#include "tools/import/volumes.h"
#include "tools/voxelctl/import/importer.h"

namespace voxeld::voxelctl {
namespace {

absl::StatusOr<Model> ReadMesh(const SourceFile& file) {
  if (absl::Status status = CheckMeshBeginning(file); !status.ok()) return status;
  Assimp::Importer importer;
  const absl::StatusOr<const aiScene*> scene = LoadScene(file, &importer);
  if (!scene.ok()) return scene.status();
  return ModelOf(file, **scene, nullptr);
}

bool IsMoleculeName(const SourceFile& file) {
  return std::ranges::any_of(std::array{".pdb", ".ent", ".cif", ".mmcif"}, [&](const char* name) {
    return absl::EndsWithIgnoreCase(file.path, name) ||
           absl::EndsWithIgnoreCase(file.path, absl::StrCat(name, ".gz"));
  });
}

}  // namespace

absl::StatusOr<Model> ReadAny(const SourceFile& file, const ImportOptions& options) {
  const std::string& extension = file.extension;
  if (IsOwnFormat(extension)) return ReadOwnFormat(file, options);
  if (extension == "gltf" || extension == "glb") return ReadGltfModel(file, options.attributes);
  if (extension == "obj") return ReadObjModel(file);
  if (extension == "pcd") return ReadPcdPoints(file, options.attributes);
  if (extension == "las" || extension == "laz") return ReadLasPoints(file, options.attributes);
  if (extension == "nii" || (extension == "gz" && absl::EndsWithIgnoreCase(file.path, ".nii.gz")))
    return ReadNiftiVolume(file);
  if (extension == "hdr" || extension == "img") return ReadNiftiVolume(file);
  if (extension == "nrrd" || extension == "nhdr") return ReadNrrdVolume(file);
  if (extension == "mha" || extension == "mhd") return ReadMetaVolume(file);
  if (extension == "mrc" || extension == "rec" || extension == "map") return ReadMrcVolume(file);
  if (extension == "tif" || extension == "tiff") return ReadTiffVolume(file);
  if (extension == "raw") return ReadRawVolume(file, options.raw);
  if (IsMoleculeName(file)) return ReadMolecule(file, options.style, options.attributes);
  if (IsGdalMap(extension)) return ReadGdalMap(file, options.globe, options.attributes);
  if (IsDrawing(extension)) return ReadSvgDrawing(file, options.pixels);
  // Slices often have no extension, or what looks like one.
  if (extension == "dcm" || LooksLikeDicom(file)) return ReadDicomVolume(file);
  if (AssimpReads(extension)) return ReadMesh(file);
  return FileError(
      file,
      extension.empty()
          ? "its name has no extension"
          : absl::StrCat("files of type .", EscapeForTerminal(extension), " are not read"),
      "play reads meshes (.obj, .stl, .ply, .gltf, .glb, .off, .fbx, .3mf, .dae, "
      ".blend, .ifc, .bvh and more), voxels (.vox), points (.ply, .pcd, "
      ".las, .xyz, .txt, .asc, .pts, .csv), maps (.geojson, .topojson, .json, .shp, .gpx, .kml), "
      "volumes (.nii, "
      ".nii.gz, .hdr with .img, .nrrd, .nhdr, .mha, .mhd, .mrc, .rec, .map, .tif, .tiff, .raw, "
      ".dcm), molecules (.pdb, .ent, .cif, .mmcif, "
      "also with .gz, and .xyz) and drawings "
      "(.svg, .svgz)");
}

absl::StatusOr<std::unique_ptr<FrameSource>> OpenAnimationHere(SourceFile file, size_t number,
                                                               double fps) {
  if (file.extension == "obj")
    return FileError(file, absl::StrCat("has no animation ", number), "it has none at all");
  const bool is_gltf = file.extension == "gltf" || file.extension == "glb";
  return is_gltf ? OpenGltfAnimation(std::move(file), number, fps)
                 : OpenAssimpAnimation(std::move(file), number, fps);
}

absl::StatusOr<Model> ReadFolder(const std::string& path) { return ReadDicomFolder(path); }

}  // namespace voxeld::voxelctl
