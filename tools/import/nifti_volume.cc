// Reads NIfTI, in one file or two.
#include <nifti2_io.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <system_error>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "common/text/printable.h"
#include "tools/import/inflate.h"
#include "tools/import/volume_samples.h"
#include "tools/import/volumes.h"

namespace voxeld::voxelctl {
namespace {

std::optional<SampleType> TypeOf(int datatype) {
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

constexpr size_t kHeader1 = sizeof(nifti_1_header), kHeader2 = sizeof(nifti_2_header);
constexpr double kMostOffset = 1 << 28;
static_assert(kHeader1 == 348 && kHeader2 == 540);

struct FreeImage {
  void operator()(nifti_image* image) const { nifti_image_free(image); }
};

// The contents of either header in one form.
struct Head {
  std::array<int64_t, 8> dim = {};
  int datatype = 0, intent = 0;
  double vox_offset = 0, slope = 0, intercept = 0, cal_min = 0, cal_max = 0;
  bool apart = false;  // the samples are in a separate file
};

template <typename Header>
Head HeadOf(const Header& header, bool apart) {
  Head head;
  for (size_t i = 0; i < head.dim.size(); ++i) head.dim[i] = header.dim[i];
  head.datatype = header.datatype;
  head.intent = header.intent_code;
  head.vox_offset = static_cast<double>(header.vox_offset);
  head.slope = header.scl_slope;
  head.intercept = header.scl_inter;
  head.cal_min = header.cal_min;
  head.cal_max = header.cal_max;
  head.apart = apart;
  return head;
}

bool IsPacked(const SourceFile& file) { return absl::StartsWith(file.bytes, "\x1f\x8b"); }

// Returns the first `most` bytes of the contents. Only compressed contents are copied, into `room`.
absl::StatusOr<absl::string_view> BeginningOf(const SourceFile& file, uint64_t most,
                                              std::string* room) {
  if (!IsPacked(file)) return absl::string_view(file.bytes).substr(0, most);
  absl::StatusOr<std::string> inflated = Inflate(file, file.bytes, most);
  if (!inflated.ok()) return inflated.status();
  *room = *std::move(inflated);
  return absl::string_view(*room);
}

// Returns the other file of two, whatever case and compression its extension has; nothing if it
// does not exist.
std::optional<std::string> Beside(const std::string& path, absl::string_view extension) {
  std::filesystem::path stem(path);
  if (absl::EqualsIgnoreCase(stem.extension().string(), ".gz")) stem.replace_extension();
  for (const absl::string_view end : {"", ".gz", ".GZ"}) {
    for (const bool upper : {false, true}) {
      const std::string name =
          absl::StrCat(upper ? absl::AsciiStrToUpper(extension) : std::string(extension), end);
      std::error_code ignored;
      const std::filesystem::path other = std::filesystem::path(stem).replace_extension(name);
      if (std::filesystem::is_regular_file(other, ignored)) return other.string();
    }
  }
  return std::nullopt;
}

absl::StatusOr<SourceFile> ReadBeside(const SourceFile& file, const std::string& path) {
  absl::StatusOr<SourceFile> read =
      ReadOtherFile(file, std::filesystem::path(path).filename().string());
  if (read.ok()) return read;
  return FileError(file, absl::StrCat("needs ", EscapeForTerminal(path), " beside it"),
                   read.status().message());
}

class NiftiReader {
 public:
  explicit NiftiReader(const SourceFile& file) : file_(file) {}

  absl::StatusOr<Model> Read() {
    if (absl::Status status = ReadHeader(); !status.ok()) return status;
    if (absl::Status status = CheckHead(); !status.ok()) return status;
    if (!head_.apart) return ReadSamples(file_);
    const std::optional<std::string> beside = Beside(file_.path, "img");
    if (!beside) {
      return FileError(file_, "has its samples in another file, and there is none",
                       "the file of the same name with the extension .img is expected beside it");
    }
    const absl::StatusOr<SourceFile> samples = ReadBeside(file_, *beside);
    return samples.ok() ? ReadSamples(*samples) : samples.status();
  }

 private:
  uint64_t BytesEach() const { return channels_ > 0 ? channels_ : SampleBytes(code_.type); }

  absl::StatusOr<Model> ReadSamples(const SourceFile& file) const {
    SampledVolume volume;
    uint64_t samples = 1;
    for (size_t axis = 0; axis < 3; ++axis) {
      volume.size[axis] = static_cast<uint32_t>(size_[axis]);
      samples *= size_[axis];
    }
    const uint64_t bytes = samples * BytesEach();
    if (planes_ > 0) return ReadPlanes(file, bytes * planes_, std::move(volume));
    if (IsPacked(file)) {
      if (absl::Status status = ReadPacked(file, bytes, &volume); !status.ok()) return status;
      return Finish(IsPacked(file), std::move(volume));
    }
    const absl::string_view all = file.bytes;
    if (all.size() < from_ + bytes) return CutOff(file, all.size(), bytes);
    Decode(all.substr(from_, bytes), &volume);
    return Finish(IsPacked(file), std::move(volume));
  }

  // Colours whose red of all places stands before the green (NIFTI_INTENT_RGB_VECTOR).
  absl::StatusOr<Model> ReadPlanes(const SourceFile& file, uint64_t bytes,
                                   SampledVolume volume) const {
    std::string inflated;
    absl::string_view all = file.bytes;
    if (IsPacked(file)) {
      absl::StatusOr<std::string> unpacked = Inflate(file, file.bytes, from_ + bytes);
      if (!unpacked.ok()) return unpacked.status();
      inflated = *std::move(unpacked);
      all = inflated;
    }
    if (all.size() < from_ + bytes) return CutOff(file, all.size(), bytes);
    DecodeColors(Interleaved(all.substr(from_, bytes), planes_, SampleBytes(code_.type)), code_,
                 planes_, &volume);
    return Finish(IsPacked(file), std::move(volume));
  }

  absl::Status CutOff(const SourceFile& file, uint64_t there, uint64_t wanted) const {
    return FileError(file,
                     absl::StrCat("has ", there - std::min<uint64_t>(from_, there),
                                  " bytes of samples; ", size_[0], " by ", size_[1], " by ",
                                  size_[2], " of ", BytesEach(), " take ", wanted),
                     "the file is truncated");
  }

  void Decode(absl::string_view bytes, SampledVolume* volume) const {
    if (channels_ > 0) {
      DecodeColors(bytes, channels_, volume);
    } else {
      DecodeSamples(bytes, code_, &volume->samples);
    }
  }

  // Decodes compressed samples piece by piece, so that the compressed data are never expanded as a
  // whole.
  absl::Status ReadPacked(const SourceFile& file, uint64_t wanted, SampledVolume* volume) const {
    const uint64_t each = BytesEach();
    uint64_t there = 0;
    std::string rest;  // the part of a sample that continues in the next piece
    // Memory is only used when it is filled.
    volume->samples.reserve(wanted / each);
    if (channels_ > 0) volume->colors.reserve(wanted / each);
    const absl::Status status = InflatePieces(
        file, file.bytes, from_ + wanted, Deflated::kGzip, [&](absl::string_view piece) {
          const uint64_t skipped = std::min<uint64_t>(from_ - std::min(from_, there), piece.size());
          there += piece.size();
          piece.remove_prefix(skipped);
          if (!rest.empty()) {
            const size_t missing = std::min<size_t>(each - rest.size(), piece.size());
            rest.append(piece.data(), missing);
            piece.remove_prefix(missing);
            if (rest.size() < each) return;
            Decode(rest, volume);
            rest.clear();
          }
          const size_t whole = piece.size() / each * each;
          Decode(piece.substr(0, whole), volume);
          rest.assign(piece.data() + whole, piece.size() - whole);
        });
    if (!status.ok()) return status;
    return there < from_ + wanted ? CutOff(file, there, wanted) : absl::OkStatus();
  }

  absl::StatusOr<Model> Finish(bool packed, SampledVolume volume) const {
    if (absl::Status status = Place(&volume); !status.ok()) return status;
    if (head_.cal_max > head_.cal_min && std::isfinite(head_.cal_max - head_.cal_min)) {
      volume.window = {head_.cal_min, head_.cal_max};
    }
    Model model;
    model.path = file_.path;
    model.format = absl::StrCat(is_analyze_  ? "ANALYZE 7.5"
                                : is_second_ ? "NIfTI-2"
                                             : "NIfTI",
                                head_.apart ? ", two files" : "", packed ? ", compressed" : "");
    model.up = Up::kZ;
    const uint64_t times = head_.dim[0] >= 4 ? static_cast<uint64_t>(head_.dim[4]) : 1;
    AddLeftOut("further times", times - 1, &model);
    AddLeftOut("further components", planes_ > 0 ? 0 : volumes_ / times - 1, &model);
    model.volumes.push_back(std::move(volume));
    return model;
  }

  absl::Status ReadHeader() {
    std::string room;
    const absl::StatusOr<absl::string_view> head = BeginningOf(file_, kHeader2, &room);
    if (!head.ok()) return head.status();
    if (head->size() < kHeader1) {
      return FileError(file_, absl::StrCat("has ", head->size(), " bytes"),
                       "a NIfTI header of 348 or 540 is expected");
    }
    nifti_1_header& first = first_;
    nifti_2_header& second = second_;
    std::memcpy(&first, head->data(), kHeader1);
    const bool one = std::memcmp(first.magic, "n+1", 4) == 0;
    if (one || std::memcmp(first.magic, "ni1", 4) == 0) {
      code_.big_endian = first.sizeof_hdr != kHeader1;
      if (code_.big_endian) swap_nifti_header(&first, 1);
      if (first.sizeof_hdr != kHeader1) return WrongSize(first.sizeof_hdr, kHeader1);
      head_ = HeadOf(first, !one);
      return absl::OkStatus();
    }
    if (TakeAnalyze()) return absl::OkStatus();
    std::memcpy(&second, head->data(), std::min(head->size(), kHeader2));
    const bool both = std::memcmp(second.magic, "n+2", 4) == 0;
    if (head->size() < kHeader2 || (!both && std::memcmp(second.magic, "ni2", 4) != 0)) {
      return FileError(
          file_, absl::StrCat("is ", DescribeContents(*head)),
          "a header of NIfTI is expected (magic \"n+1\" at byte 344, or \"n+2\" at 4), or in a "
          "file .hdr one of ANALYZE 7.5");
    }
    is_second_ = true;
    code_.big_endian = second.sizeof_hdr != kHeader2;
    if (code_.big_endian) nifti_swap_as_nifti2(&second);
    if (second.sizeof_hdr != kHeader2) return WrongSize(second.sizeof_hdr, kHeader2);
    head_ = HeadOf(second, !both);
    return absl::OkStatus();
  }

  // ANALYZE 7.5, from which NIfTI-1 was derived, has no magic: it is recognised by its header's
  // size and the extensions of its two files.
  bool TakeAnalyze() {
    const std::string path = absl::AsciiStrToLower(file_.path);
    nifti_1_header header = first_;
    const bool big_endian = header.sizeof_hdr != kHeader1;
    if (big_endian) swap_nifti_header(&header, 0);
    if (header.sizeof_hdr != kHeader1 ||
        !(absl::EndsWith(path, ".hdr") || absl::EndsWith(path, ".hdr.gz"))) {
      return false;
    }
    code_.big_endian = big_endian;
    // Where NIfTI has qform_code.
    constexpr size_t kOrient = 252;
    const auto orient = reinterpret_cast<const uint8_t*>(&first_)[kOrient];
    orientation_ = orient <= 5 ? orient : 0;
    first_ = header;
    head_ = HeadOf(first_, true);
    is_analyze_ = true;
    // Its fields differ from NIfTI's, and x points to the left (nifti1.h).
    head_.slope = head_.intercept = 0;
    first_.qform_code = first_.sform_code = 0;
    first_.pixdim[0] = 1;
    first_.pixdim[1] = first_.pixdim[1] == 0 ? -1 : -std::abs(first_.pixdim[1]);
    std::memcpy(first_.magic, "ni1", sizeof(first_.magic));
    return true;
  }

  absl::Status WrongSize(int says, size_t right) const {
    return FileError(file_, absl::StrCat("its header says that it has ", says, " bytes"),
                     absl::StrCat(right, " are expected"));
  }

  absl::Status CheckHead() {
    const int64_t dimensions = head_.dim[0];
    if (dimensions < 1 || dimensions > 7) {
      return FileError(file_, absl::StrCat("has ", dimensions, " dimensions (dim[0])"),
                       "1 to 7 are expected");
    }
    for (size_t axis = 1; axis <= static_cast<size_t>(dimensions); ++axis) {
      const int64_t along = head_.dim[axis];
      if (along < 1) {
        return FileError(file_, absl::StrCat("has ", along, " samples along axis ", axis),
                         "at least 1 is expected");
      }
      if (axis <= 3) {
        size_[axis - 1] = static_cast<uint64_t>(along);
      } else if (static_cast<uint64_t>(along) <= kMaxModelSamples / volumes_) {
        volumes_ *= static_cast<uint64_t>(along);
      } else {
        return FileError(file_, absl::StrCat("has ", along, " samples along axis ", axis),
                         absl::StrCat("at most ", kMaxModelSamples, " volumes are read"));
      }
    }
    if (absl::Status status = CheckVolumeSize(file_, size_); !status.ok()) return status;
    const std::optional<SampleType> type = TypeOf(head_.datatype);
    if (head_.datatype == DT_RGB24) channels_ = 3;
    if (head_.datatype == DT_RGBA32) channels_ = 4;
    if (!type && channels_ == 0) {
      return FileError(
          file_, absl::StrCat("has samples of datatype ", head_.datatype),
          "whole numbers of 8 to 64 bits, floats of 32 or 64, and colours (128, 2304) are read");
    }
    if (type) code_.type = *type;
    const bool is_color = (head_.intent == NIFTI_INTENT_RGB_VECTOR && head_.dim[5] == 3) ||
                          (head_.intent == NIFTI_INTENT_RGBA_VECTOR && head_.dim[5] == 4);
    // Behind one time alone the planes follow each other.
    if (type && is_color && dimensions >= 5 && head_.dim[4] == 1 &&
        volumes_ == static_cast<uint64_t>(head_.dim[5]))
      planes_ = volumes_;
    if (std::isfinite(head_.slope) && head_.slope != 0 && std::isfinite(head_.intercept)) {
      code_.slope = head_.slope;
      code_.intercept = head_.intercept;
    }
    const double least = head_.apart ? 0 : static_cast<double>(is_second_ ? kHeader2 : kHeader1);
    // Some programs write 0 if the samples follow the header and its four bytes for extensions.
    if (head_.vox_offset == 0 && !head_.apart) {
      from_ = static_cast<uint64_t>(least) + 4;
      return absl::OkStatus();
    }
    if (!(head_.vox_offset >= least) || head_.vox_offset > kMostOffset) {
      return FileError(
          file_, absl::StrCat("has its samples from byte ", head_.vox_offset, " on (vox_offset)"),
          absl::StrCat(least, " to ", kMostOffset, " is expected"));
    }
    from_ = static_cast<uint64_t>(head_.vox_offset);
    return absl::OkStatus();
  }

  // The standard leaves the steps along missing axes undefined, and some programs write 0. The
  // library would use these as steps of no length.
  template <typename Header>
  static Header WithSteps(Header header) {
    for (auto axis = header.dim[0] + 1; axis <= 3; ++axis) header.pixdim[axis] = 1;
    return header;
  }

  // The library converts quaternions to a matrix. It sees only a checked header.
  absl::Status Place(SampledVolume* volume) const {
    const std::unique_ptr<nifti_image, FreeImage> image(
        is_second_ ? nifti_convert_n2hdr2nim(WithSteps(second_), nullptr)
                   : nifti_convert_n1hdr2nim(WithSteps(first_), nullptr));
    if (image == nullptr)
      return FileError(file_, "could not be read as NIfTI", "the header is damaged");
    const nifti_dmat44& m = image->sform_code > 0 ? image->sto_xyz : image->qto_xyz;
    // The file's x points to the right and y to the front of the head; the viewer is in front of
    // the face, on the side of -y.
    const auto column = [&m](int c) { return Point3{-m.m[0][c], -m.m[1][c], m.m[2][c]}; };
    std::array<Point3, 3> steps = {column(0), column(1), column(2)};
    Point3 origin = column(3);
    if (orientation_ != 0) {
      // Which of left, front and up the file's axes go to.
      static constexpr size_t kAxes[3][3] = {{0, 1, 2}, {0, 2, 1}, {1, 2, 0}};
      const std::array<Point3, 3> old = steps;
      const auto length = [](const Point3& p) { return std::hypot(p.x, p.y, p.z); };
      for (size_t i = 0; i < 3; ++i) {
        const Point3& along = old[kAxes[orientation_ % 3][i]];
        const double by = length(old[i]) / length(along);
        steps[i] = {along.x * by, along.y * by, along.z * by};
      }
      if (orientation_ >= 3) {
        const auto rows = static_cast<double>(size_[1] - 1);
        origin = {origin.x + steps[1].x * rows, origin.y + steps[1].y * rows,
                  origin.z + steps[1].z * rows};
        steps[1] = {-steps[1].x, -steps[1].y, -steps[1].z};
      }
    }
    return PlaceVolume(file_, origin, steps, volume);
  }

  const SourceFile& file_;
  Head head_;
  // The second header is packed, but the library assumes that it is aligned.
  nifti_1_header first_ = {};
  alignas(8) nifti_2_header second_ = {};
  bool is_second_ = false;  // which of them is in the file
  bool is_analyze_ = false;
  SampleCode code_;
  size_t channels_ = 0;  // of colours; 0: numbers
  size_t planes_ = 0;    // of colours, each in a volume of its own
  int orientation_ =
      0;  // of ANALYZE 7.5: 0 to 2 transverse, coronal and sagittal; 3 to 5 with rows from the other side
  std::array<uint64_t, 3> size_ = {1, 1, 1};
  uint64_t volumes_ = 1, from_ = 0;
};

}  // namespace

absl::StatusOr<Model> ReadNiftiVolume(const SourceFile& file) {
  nifti_set_debug_level(0);
  if (file.extension != "img") return NiftiReader(file).Read();
  const std::optional<std::string> header = Beside(file.path, "hdr");
  if (!header) {
    return FileError(file, "has no header beside it",
                     "the file of the same name with the extension .hdr is expected");
  }
  const absl::StatusOr<SourceFile> read = ReadBeside(file, *header);
  return read.ok() ? NiftiReader(*read).Read() : read.status();
}

}  // namespace voxeld::voxelctl
