// Reads MRC: a header of 1024 bytes, and numbers (MRC2014,
// https://www.ccpem.ac.uk/mrc_format/mrc2014.php; IMOD's extensions).
#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <numbers>
#include <optional>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "tools/import/volume_samples.h"
#include "tools/import/volumes.h"

namespace voxeld::voxelctl {
namespace {

constexpr uint64_t kMrcHeader = 1024;
// Offsets of the words by their numbers in the specification: 4 bytes each, counted from 1.
constexpr size_t Word(size_t number) { return 4 * (number - 1); }
constexpr size_t kMrcSize = Word(1), kMrcMode = Word(4), kMrcStart = Word(5),
                 kMrcIntervals = Word(8), kMrcCell = Word(11), kMrcAngles = Word(14),
                 kMrcAxes = Word(17), kMrcGreatest = Word(21), kMrcGroup = Word(23),
                 kMrcExtended = Word(24), kMrcOrigin = Word(50), kMrcMark = Word(53),
                 kMrcMachine = Word(54);
constexpr size_t kImodStamp = 152, kImodFlags = 156;  // bytes
constexpr int32_t kImod = 1146047817;
// The first space group that means several volumes in one file.
constexpr int32_t kVolumeStack = 401;

class MrcReader {
 public:
  explicit MrcReader(const SourceFile& file) : file_(file) {}

  absl::StatusOr<Model> Read() {
    if (file_.bytes.size() < kMrcHeader) {
      return FileError(
          file_,
          absl::StrCat("has ", file_.bytes.size(), " bytes and is ", DescribeContents(file_.bytes)),
          "an MRC header of 1024 bytes is expected");
    }
    if (absl::Status status = FindByteOrder(); !status.ok()) return status;
    if (absl::Status status = ReadSize(); !status.ok()) return status;
    if (absl::Status status = ReadMode(); !status.ok()) return status;
    const int32_t extended = Int(kMrcExtended);
    if (extended < 0) {
      return FileError(file_, absl::StrCat("has an extended header of ", extended, " bytes"),
                       "0 or more are expected");
    }
    SampledVolume volume;
    for (size_t axis = 0; axis < 3; ++axis) volume.size[axis] = static_cast<uint32_t>(size_[axis]);
    const absl::StatusOr<absl::string_view> bytes =
        TakeSamples(file_, file_.bytes, kMrcHeader + static_cast<uint64_t>(extended),
                    size_[0] * size_[1] * size_[2], colors_ ? 3 : SampleBytes(code_.type));
    if (!bytes.ok()) return bytes.status();
    if (colors_) {
      DecodeColors(*bytes, 3, &volume);
    } else {
      DecodeSamples(*bytes, code_, &volume.samples);
    }
    if (absl::Status status = Place(&volume); !status.ok()) return status;
    Model model;
    model.path = file_.path;
    model.format = "MRC";
    model.up = Up::kZ;
    AddLeftOut("further volumes", volumes_ - 1, &model);
    model.volumes.push_back(std::move(volume));
    return model;
  }

 private:
  int32_t Int(size_t at) const {
    uint32_t value;
    std::memcpy(&value, file_.bytes.data() + at, sizeof(value));
    return static_cast<int32_t>(code_.big_endian ? __builtin_bswap32(value) : value);
  }
  double Float(size_t at) const { return double{std::bit_cast<float>(Int(at))}; }

  // Returns whether mode and axes have values that a header may have.
  bool IsSensible() const {
    const auto is_axis = [this](size_t i) {
      const int32_t axis = Int(kMrcAxes + 4 * i);
      return axis >= 0 && axis <= 3;
    };
    return Int(kMrcMode) >= 0 && Int(kMrcMode) < 256 && is_axis(0) && is_axis(1) && is_axis(2);
  }

  // Files from before 2000 have no machine stamp, and some programs write a wrong one. So the
  // values decide.
  absl::Status FindByteOrder() {
    const bool stamped_big = file_.bytes[kMrcMachine] == '\x11';
    for (const bool big : {stamped_big, !stamped_big}) {
      code_.big_endian = big;
      if (IsSensible()) return absl::OkStatus();
    }
    code_.big_endian = stamped_big;
    return FileError(file_,
                     file_.bytes.compare(kMrcMark, 4, "MAP ") == 0
                         ? absl::StrCat("has mode ", Int(kMrcMode), " and axes ", Int(kMrcAxes),
                                        ", ", Int(kMrcAxes + 4), ", ", Int(kMrcAxes + 8))
                         : absl::StrCat("is ", DescribeContents(file_.bytes)),
                     "an MRC header is expected (mode at byte 12, axes at byte 64)");
  }

  absl::Status ReadSize() {
    for (size_t axis = 0; axis < 3; ++axis) {
      const int32_t along = Int(kMrcSize + 4 * axis);
      size_[axis] = along < 0 ? 0 : static_cast<uint64_t>(along);
    }
    const int32_t each = Int(kMrcIntervals + 8);
    if (Int(kMrcGroup) >= kVolumeStack && each > 0 && size_[2] % static_cast<uint64_t>(each) == 0 &&
        size_[2] > 0) {
      volumes_ = size_[2] / static_cast<uint64_t>(each);
      size_[2] = static_cast<uint64_t>(each);
    }
    return CheckVolumeSize(file_, size_);
  }

  absl::Status ReadMode() {
    const int32_t mode = Int(kMrcMode);
    switch (mode) {
      case 0:
        code_.type = HasUnsignedBytes() ? SampleType::kU8 : SampleType::kI8;
        return absl::OkStatus();
      case 1:
        code_.type = SampleType::kI16;
        return absl::OkStatus();
      case 2:
        code_.type = SampleType::kF32;
        return absl::OkStatus();
      case 6:
        code_.type = SampleType::kU16;
        return absl::OkStatus();
      case 12:
        code_.type = SampleType::kF16;
        return absl::OkStatus();
      case 16:
        colors_ = true;
        return absl::OkStatus();
      default:
        return FileError(file_, absl::StrCat("has samples of mode ", mode),
                         "modes 0, 1, 2, 6, 12 and 16 are read (complex numbers are not)");
    }
  }

  // MRC2014 says that bytes are signed. IMOD has a flag for it, and older programs wrote unsigned
  // ones: then the declared maximum exceeds a signed byte.
  bool HasUnsignedBytes() const {
    if (Int(kImodStamp) == kImod) return (Int(kImodFlags) & 1) == 0;
    return Float(kMrcGreatest) > 127;
  }

  // Returns the directions of the cell's axes: the first along x, the second in the plane of x and
  // y.
  std::array<Point3, 3> CellAxes() const {
    std::array<double, 3> cosines = {0, 0, 0};
    for (size_t i = 0; i < 3; ++i) {
      const double angle = Float(kMrcAngles + 4 * i);
      if (angle > 0 && angle < 180 && angle != 90)
        cosines[i] = std::cos(angle * std::numbers::pi / 180);
    }
    const auto& [alpha, beta, gamma] = cosines;
    const double sine = std::sqrt(1 - gamma * gamma);
    const double y = (alpha - beta * gamma) / sine;
    const double z = 1 - beta * beta - y * y;
    if (!(z > 1e-6)) return {Point3{1, 0, 0}, Point3{0, 1, 0}, Point3{0, 0, 1}};
    return {Point3{1, 0, 0}, Point3{gamma, sine, 0}, Point3{beta, y, std::sqrt(z)}};
  }

  // Returns the cell's axes along columns, rows and sections, counted from 0.
  std::array<size_t, 3> AxesInFile() const {
    std::array<size_t, 3> axes;
    for (size_t i = 0; i < 3; ++i) axes[i] = static_cast<size_t>(Int(kMrcAxes + 4 * i)) - 1;
    std::array<size_t, 3> sorted = axes;
    std::sort(sorted.begin(), sorted.end());
    // Some programs leave them 0.
    return sorted == std::array<size_t, 3>{0, 1, 2} ? axes : std::array<size_t, 3>{0, 1, 2};
  }

  absl::Status Place(SampledVolume* volume) const {
    const std::array<Point3, 3> directions = CellAxes();
    const std::array<size_t, 3> axes = AxesInFile();
    std::array<Point3, 3> steps;
    const auto finite = [](double number) { return std::isfinite(number) ? number : 0; };
    Point3 first = {finite(Float(kMrcOrigin)), finite(Float(kMrcOrigin + 4)),
                    finite(Float(kMrcOrigin + 8))};
    const bool has_origin = first != Point3{};
    for (size_t i = 0; i < 3; ++i) {
      const size_t axis = axes[i];
      const double cell = Float(kMrcCell + 4 * axis);
      const int32_t intervals = Int(kMrcIntervals + 4 * axis);
      const bool known = std::isfinite(cell) && cell > 0 && intervals > 0;
      const double step = known ? cell / intervals : 1;
      const Point3& to = directions[axis];
      steps[i] = {to.x * step, to.y * step, to.z * step};
      if (has_origin) continue;
      const double start = Int(kMrcStart + 4 * i);
      first = {first.x + start * steps[i].x, first.y + start * steps[i].y,
               first.z + start * steps[i].z};
    }
    return PlaceVolume(file_, first, steps, volume);
  }

  const SourceFile& file_;
  SampleCode code_;
  bool colors_ = false;
  std::array<uint64_t, 3> size_ = {1, 1, 1};
  uint64_t volumes_ = 1;
};

}  // namespace

absl::StatusOr<Model> ReadMrcVolume(const SourceFile& file) { return MrcReader(file).Read(); }

}  // namespace voxeld::voxelctl
