#include "tools/voxelctl/import/dicom_volume.h"

namespace voxeld::voxelctl {

absl::StatusOr<Model> ReadDicomVolume(const SourceFile& file) {
  return FileError(file, "is DICOM, which this build does not read",
                   "build with -DVOXELD_IMPORTERS=ON (libgdcm-dev)");
}

absl::StatusOr<Model> ReadDicomFolder(const std::string& path) {
  return FileError({.path = path, .extension = {}, .bytes = {}},
                   "is a folder, and this build does not read DICOM",
                   "build with -DVOXELD_IMPORTERS=ON (libgdcm-dev)");
}

}  // namespace voxeld::voxelctl
