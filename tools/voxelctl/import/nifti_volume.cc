#include "tools/voxelctl/import/nifti_volume.h"

#include <nifti1_io.h>

#include <array>
#include <cmath>
#include <cstring>
#include <memory>
#include <optional>
#include <utility>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "tools/voxelctl/import/inflate.h"
#include "tools/voxelctl/import/volume_samples.h"

namespace voxeld::voxelctl {
namespace {

std::optional<SampleType> TypeOf(int16_t datatype) {
  switch (datatype) {
    case DT_UINT8:
      return SampleType::kU8;
    case DT_INT8:
      return SampleType::kI8;
    case DT_INT16:
      return SampleType::kI16;
    case DT_UINT16:
      return SampleType::kU16;
    case DT_INT32:
      return SampleType::kI32;
    case DT_UINT32:
      return SampleType::kU32;
    case DT_INT64:
      return SampleType::kI64;
    case DT_UINT64:
      return SampleType::kU64;
    case DT_FLOAT32:
      return SampleType::kF32;
    case DT_FLOAT64:
      return SampleType::kF64;
    default:
      return std::nullopt;
  }
}

class Reader {
 public:
  explicit Reader(const SourceFile& file)
      : file_(file), packed_(absl::StartsWith(file.bytes, "\x1f\x8b")) {}

  absl::StatusOr<Model> Read() {
    if (absl::Status status = ReadHeader(); !status.ok()) return status;
    Model model;
    model.path = file_.path;
    model.format = packed_ ? "NIfTI, compressed" : "NIfTI";
    model.up = Up::kZ;
    SampledVolume volume;
    uint64_t samples = 1;
    for (size_t axis = 0; axis < 3; ++axis) {
      volume.size[axis] = static_cast<uint32_t>(size_[axis]);
      samples *= size_[axis];
    }
    const uint64_t bytes = samples * SampleBytes(code_.type);
    const absl::StatusOr<std::string> inflated =
        packed_ ? Inflate(file_, file_.bytes, from_ + bytes) : absl::StatusOr<std::string>("");
    if (!inflated.ok()) return inflated.status();
    const absl::string_view all = packed_ ? *inflated : file_.bytes;
    if (all.size() < from_ + bytes) {
      return FileError(file_,
                       absl::StrCat("has ", all.size() - std::min<uint64_t>(from_, all.size()),
                                    " bytes of samples; ", size_[0], " by ", size_[1], " by ",
                                    size_[2], " of ", SampleBytes(code_.type), " take ", bytes),
                       "the file is truncated");
    }
    DecodeSamples(all.substr(from_, bytes), code_, &volume.samples);
    if (absl::Status status = Place(&volume); !status.ok()) return status;
    if (header_.cal_max > header_.cal_min && std::isfinite(header_.cal_max - header_.cal_min)) {
      volume.window = {header_.cal_min, header_.cal_max};
    }
    if (volumes_ > 1) {
      model.note = absl::StrCat(file_.path, ": the first of its ", volumes_, " volumes is shown");
    }
    model.volumes.push_back(std::move(volume));
    return model;
  }

 private:
  absl::Status ReadHeader() {
    const absl::StatusOr<std::string> inflated =
        packed_ ? Inflate(file_, file_.bytes, sizeof(header_)) : absl::StatusOr<std::string>("");
    if (!inflated.ok()) return inflated.status();
    const absl::string_view head = packed_ ? *inflated : file_.bytes;
    if (head.size() < sizeof(header_)) {
      return FileError(file_, absl::StrCat("has ", head.size(), " bytes"),
                       "a NIfTI header of 348 is expected");
    }
    std::memcpy(&header_, head.data(), sizeof(header_));
    if (std::memcmp(header_.magic, "ni1", 4) == 0) {
      return FileError(file_, "has its samples in another file (.img)",
                       "NIfTI in one file (.nii, .nii.gz) is read");
    }
    if (std::memcmp(header_.magic, "n+1", 4) != 0) {
      return FileError(file_, absl::StrCat("is ", DescribeContents(head)),
                       "a header of NIfTI-1 is expected (magic \"n+1\" at byte 344)");
    }
    if (header_.sizeof_hdr != sizeof(header_)) {
      swap_nifti_header(&header_, 1);
      code_.big_endian = true;
    }
    if (header_.sizeof_hdr != sizeof(header_)) {
      return FileError(file_,
                       absl::StrCat("its header says that it has ", header_.sizeof_hdr, " bytes"),
                       "348 are expected");
    }
    const int dimensions = header_.dim[0];
    if (dimensions < 1 || dimensions > 7) {
      return FileError(file_, absl::StrCat("has ", dimensions, " dimensions (dim[0])"),
                       "1 to 7 are expected");
    }
    for (int axis = 1; axis <= dimensions; ++axis) {
      const int along = header_.dim[axis];
      if (along < 1) {
        return FileError(file_, absl::StrCat("has ", along, " samples along axis ", axis),
                         "at least 1 is expected");
      }
      if (axis <= 3) {
        size_[axis - 1] = static_cast<uint64_t>(along);
      } else {
        volumes_ *= static_cast<uint64_t>(along);
      }
    }
    if (absl::Status status = CheckVolumeSize(file_, size_); !status.ok()) return status;
    const std::optional<SampleType> type = TypeOf(header_.datatype);
    if (!type) {
      return FileError(file_, absl::StrCat("has samples of datatype ", header_.datatype),
                       "whole numbers of 8 to 64 bits and floats of 32 or 64 are read");
    }
    code_.type = *type;
    if (std::isfinite(header_.scl_slope) && header_.scl_slope != 0 &&
        std::isfinite(header_.scl_inter)) {
      code_.slope = header_.scl_slope;
      code_.intercept = header_.scl_inter;
    }
    if (!(header_.vox_offset >= sizeof(header_)) || header_.vox_offset > 1 << 28) {
      return FileError(
          file_, absl::StrCat("has its samples from byte ", header_.vox_offset, " on (vox_offset)"),
          absl::StrCat("348 to ", 1 << 28, " is expected"));
    }
    from_ = static_cast<uint64_t>(header_.vox_offset);
    return absl::OkStatus();
  }

  // The library knows how quaternions become a matrix; it sees a header that has been checked, and nothing else.
  absl::Status Place(SampledVolume* volume) const {
    nifti_set_debug_level(0);
    const std::unique_ptr<nifti_image, void (*)(nifti_image*)> image(
        nifti_convert_nhdr2nim(header_, nullptr), nifti_image_free);
    if (image == nullptr) {
      return FileError(file_, "could not be read as NIfTI", "the header is damaged");
    }
    const mat44& m = image->sform_code > 0 ? image->sto_xyz : image->qto_xyz;
    // The file's x goes to the right and y to the front of the head; the viewer stands before it, on the side of -y.
    const auto column = [&m](int c) {
      return Point3{-double{m.m[0][c]}, -double{m.m[1][c]}, double{m.m[2][c]}};
    };
    return PlaceVolume(file_, column(3), {column(0), column(1), column(2)}, volume);
  }

  const SourceFile& file_;
  const bool packed_;
  nifti_1_header header_ = {};
  SampleCode code_;
  std::array<uint64_t, 3> size_ = {1, 1, 1};
  uint64_t volumes_ = 1, from_ = 0;
};

}  // namespace

absl::StatusOr<Model> ReadNiftiVolume(const SourceFile& file) { return Reader(file).Read(); }

}  // namespace voxeld::voxelctl
