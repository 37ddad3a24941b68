// Reads files of all formats as ImportFile does, but in this process where that is safe: it is much
// faster, and sanitizers can check it.
#pragma once

#include <algorithm>
#include <array>
#include <string>
#include <string_view>

#include "tools/import/read_any.h"
#include "tools/voxelctl/import/contained.h"
#include "tools/voxelctl/import/importer.h"
#include "tools/voxelctl/import/reader_process.h"

namespace voxeld::voxelctl {

inline absl::StatusOr<Model> ReadAndCheck(const SourceFile& file, const ImportOptions& options) {
  absl::StatusOr<Model> model = ReadAny(file, options);
  if (!model.ok()) return model;
  if (absl::Status status = CheckModel(file, *model); !status.ok()) return status;
  return model;
}

// Reads in a confined copy of this process.
inline absl::StatusOr<Model> ReadApart(const std::string& path, const ImportOptions& options = {}) {
  absl::StatusOr<SourceFile> file = ReadSourceFile(path, options.other_files);
  if (!file.ok()) return file.status();
  return ReadContained(*file, ReaderOf(*file, [&] { return ReadAndCheck(*file, options); }));
}

inline absl::StatusOr<Model> ReadHere(const std::string& path, const ImportOptions& options = {}) {
  // Damaged files of other formats can crash the libraries that read them, so tests read those in a process of their own too.
  constexpr std::array<std::string_view, 38> kSafe = {
      "asc",  "cif", "csv",  "dxf", "ent",  "geojson",  "glb", "gltf", "gpx",   "gz",
      "hdr",  "img", "json", "kml", "las",  "map",      "mha", "mhd",  "mmcif", "mrc",
      "nhdr", "nii", "nrrd", "obj", "pcd",  "pdb",      "ply", "pts",  "raw",   "rec",
      "shp",  "stl", "svg",  "tif", "tiff", "topojson", "txt", "vox"};
  const absl::StatusOr<SourceFile> file = ReadSourceFile(path, options.other_files);
  if (!file.ok()) return ImportFile(path, options);
  const bool is_safe = file->extension == "xyz" ||
                       std::find(kSafe.begin(), kSafe.end(), file->extension) != kSafe.end();
  return is_safe ? ReadAndCheck(*file, options) : ReadApart(path, options);
}

}  // namespace voxeld::voxelctl
