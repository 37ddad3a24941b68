// Volumes: NRRD, NIfTI, MetaImage, MRC, TIFF, raw numbers; and the checks before the library that
// reads DICOM.

#include <cmath>
#include <cstdint>
#include <optional>

#include "tests/fuzz/import/check_model.h"
#include "tools/import/dicom_check.h"
#include "tools/import/volumes.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace voxeld::voxelctl;  // NOLINT(google-build-using-namespace)
  static constexpr const char* kExtensions[] = {"nrrd", "raw", "dcm", "nii", "mha", "mrc", "tif"};
  size_t which = 0;
  const SourceFile file = voxeld::fuzz::FileOf(data, size, kExtensions, 7, &which);
  switch (which) {
    case 0:
      // A header that names files beside it would have those read.
      if (file.bytes.find("data file") != std::string::npos ||
          file.bytes.find("datafile") != std::string::npos)
        break;
      voxeld::fuzz::CheckModel(ReadNrrdVolume(file));
      break;
    case 1:
      for (const SampleType type : {SampleType::kU8, SampleType::kI16, SampleType::kF32}) {
        voxeld::fuzz::CheckModel(ReadRawVolume(file, RawLayout{{2, 3, 4}, type, true}));
      }
      break;
    case 2: {
      LooksLikeDicom(file);
      const absl::StatusOr<std::optional<SourceFile>> inflated = PlainDicom(file);
      voxeld::fuzz::ExpectSays(inflated.status());
      if (inflated.ok() && inflated->has_value()) {
        voxeld::fuzz::ExpectSays(CheckDicom(**inflated).status());
      }
      const absl::StatusOr<DicomFacts> facts = CheckDicom(file);
      voxeld::fuzz::ExpectSays(facts.status());
      if (!facts.ok()) break;
      for (const double number : DicomNumbers(facts->orientation)) {
        EXPECT_THAT_HOLDS(std::isfinite(number));
      }
      for (const auto& [from, count] : facts->pixels) {
        EXPECT_THAT_HOLDS(from <= file.bytes.size() && count <= file.bytes.size() - from);
      }
      break;
    }
    case 3:
      voxeld::fuzz::CheckModel(ReadNiftiVolume(file));
      break;
    case 4:
      // A header that names files beside it would have those read.
      if (file.bytes.find("LOCAL") == std::string::npos) break;
      voxeld::fuzz::CheckModel(ReadMetaVolume(file));
      break;
    case 5:
      voxeld::fuzz::CheckModel(ReadMrcVolume(file));
      break;
    default:
      voxeld::fuzz::CheckModel(ReadTiffVolume(file));
      break;
  }
  return 0;
}
