// Reads MetaImage: lines "Name = Value", the last of which says where the samples are
// (https://itk.org/Wiki/ITK/MetaIO/Documentation).
#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "absl/strings/strip.h"
#include "common/text/printable.h"
#include "tools/import/inflate.h"
#include "tools/import/volume_samples.h"
#include "tools/import/volumes.h"

namespace voxeld::voxelctl {
namespace {

constexpr size_t kMostMetaHeader = 1 << 20;
constexpr int64_t kMostMetaSkipped = 1 << 30;  // bytes
constexpr size_t kMostMetaAxes = 4;
constexpr size_t kMostMetaFiles = 20'000;

std::optional<SampleType> MetaTypeOf(absl::string_view name) {
  // MET_LONG has 4 bytes in MetaIO on every machine.
  static constexpr std::pair<absl::string_view, SampleType> kNames[] = {
      {"MET_CHAR", SampleType::kI8},        {"MET_ASCII_CHAR", SampleType::kI8},
      {"MET_UCHAR", SampleType::kU8},       {"MET_SHORT", SampleType::kI16},
      {"MET_USHORT", SampleType::kU16},     {"MET_INT", SampleType::kI32},
      {"MET_UINT", SampleType::kU32},       {"MET_LONG", SampleType::kI32},
      {"MET_ULONG", SampleType::kU32},      {"MET_LONG_LONG", SampleType::kI64},
      {"MET_ULONG_LONG", SampleType::kU64}, {"MET_FLOAT", SampleType::kF32},
      {"MET_DOUBLE", SampleType::kF64}};
  absl::ConsumeSuffix(&name, "_ARRAY");
  for (const auto& [known, type] : kNames) {
    if (name == known) return type;
  }
  return std::nullopt;
}

class MetaReader {
 public:
  explicit MetaReader(const SourceFile& file) : file_(file) {}

  absl::StatusOr<Model> Read() {
    for (const auto step :
         {&MetaReader::ReadHeader, &MetaReader::ReadSizes, &MetaReader::ReadCode}) {
      if (absl::Status status = (this->*step)(); !status.ok()) return status;
    }
    SampledVolume volume;
    for (size_t axis = 0; axis < 3; ++axis) volume.size[axis] = static_cast<uint32_t>(size_[axis]);
    if (absl::Status status = ReadSamples(&volume); !status.ok()) return status;
    if (absl::Status status = Place(&volume); !status.ok()) return status;
    Model model;
    model.path = file_.path;
    model.format = "MetaImage";
    model.up = Up::kZ;
    if (volume.colors.empty()) AddLeftOut("further components", channels_ - 1, &model);
    AddLeftOut("further times", times_ - 1, &model);
    const std::string orientation(Field("AnatomicalOrientation"));
    if (Matrix().empty() && !orientation.empty() && orientation != "RAI" && orientation != "???") {
      model.note = absl::StrCat(file_.path, ": AnatomicalOrientation \"",
                                EscapeForTerminal(orientation.substr(0, 20)),
                                "\" is not followed, as programs differ in what it means; "
                                "TransformMatrix would be");
    }
    model.volumes.push_back(std::move(volume));
    return model;
  }

 private:
  absl::string_view Field(absl::string_view name) const {
    const auto at = fields_.find(name);
    return at == fields_.end() ? absl::string_view() : absl::string_view(at->second);
  }
  absl::string_view AnyField(std::initializer_list<absl::string_view> names) const {
    for (const absl::string_view name : names) {
      if (!Field(name).empty()) return Field(name);
    }
    return {};
  }
  bool Flag(absl::string_view value, bool otherwise) const {
    if (value.empty()) return otherwise;
    return value.front() == 'T' || value.front() == 't' || value.front() == '1';
  }
  absl::Status WrongField(absl::string_view name, absl::string_view expected) const {
    const absl::string_view value = Field(name);
    return FileError(file_,
                     value.empty() ? absl::StrCat("has no ", name)
                                   : absl::StrCat("has \"", EscapeForTerminal(value.substr(0, 60)),
                                                  "\" for ", name),
                     expected);
  }
  // Returns the numbers of a text; nothing if one of its words is not a finite number.
  static std::vector<double> Numbers(absl::string_view text) {
    std::vector<double> numbers;
    for (const absl::string_view word :
         absl::StrSplit(text, absl::ByAnyChar(" \t,"), absl::SkipEmpty())) {
      double number = 0;
      if (!absl::SimpleAtod(word, &number) || !std::isfinite(number)) return {};
      numbers.push_back(number);
    }
    return numbers;
  }

  absl::Status ReadHeader() {
    const absl::string_view bytes = file_.bytes;
    size_t at = 0;
    while (at < bytes.size() && at < kMostMetaHeader && Field("ElementDataFile").empty()) {
      const size_t end = std::min(bytes.find('\n', at), bytes.size());
      const absl::string_view line = bytes.substr(at, end - at);
      at = std::min(end + 1, bytes.size());
      const size_t sign = line.find_first_of("=:");
      if (sign == absl::string_view::npos) continue;
      fields_[std::string(absl::StripAsciiWhitespace(line.substr(0, sign)))] =
          std::string(absl::StripAsciiWhitespace(line.substr(sign + 1)));
    }
    if (Field("NDims").empty() || Field("ElementDataFile").empty()) {
      return FileError(
          file_,
          fields_.count("ObjectType") + fields_.count("NDims") == 0
              ? absl::StrCat("is ", DescribeContents(bytes))
              : absl::StrCat("has no ", Field("NDims").empty() ? "NDims" : "ElementDataFile"),
          "a header of MetaImage is expected (\"NDims = 3\" … \"ElementDataFile = …\")");
    }
    const absl::string_view type = Field("ObjectType");
    if (!type.empty() && type != "Image") return WrongField("ObjectType", "an Image is expected");
    body_ = at;
    return absl::OkStatus();
  }

  absl::Status ReadSizes() {
    if (!absl::SimpleAtoi(Field("NDims"), &axes_) || axes_ < 1 || axes_ > kMostMetaAxes)
      return WrongField("NDims", absl::StrCat("1 to ", kMostMetaAxes, " axes are read"));
    const std::vector<absl::string_view> words =
        absl::StrSplit(Field("DimSize"), absl::ByAnyChar(" \t,"), absl::SkipEmpty());
    std::array<uint64_t, kMostMetaAxes> sizes = {1, 1, 1, 1};
    bool good = words.size() == axes_;
    for (size_t axis = 0; axis < axes_ && good; ++axis)
      good = absl::SimpleAtoi(words[axis], &sizes[axis]);
    if (!good) return WrongField("DimSize", absl::StrCat(axes_, " numbers are expected"));
    size_ = {sizes[0], sizes[1], sizes[2]};
    if (absl::Status status = CheckVolumeSize(file_, size_); !status.ok()) return status;
    samples_ = size_[0] * size_[1] * size_[2];
    times_ = sizes[3];
    const absl::string_view channels = Field("ElementNumberOfChannels");
    if (!channels.empty() && !absl::SimpleAtoi(channels, &channels_)) channels_ = 0;
    if (channels_ < 1 || channels_ > kMaxModelSamples / samples_)
      return WrongField("ElementNumberOfChannels",
                        absl::StrCat("1 to ", kMaxModelSamples, " numbers in all are read"));
    if (times_ < 1 || times_ > kMaxModelSamples / samples_ / channels_)
      return WrongField("DimSize",
                        absl::StrCat("1 to ", kMaxModelSamples, " numbers in all are read"));
    return absl::OkStatus();
  }

  absl::Status ReadCode() {
    const std::optional<SampleType> type = MetaTypeOf(Field("ElementType"));
    if (!type) return WrongField("ElementType", "a type of numbers such as MET_SHORT is expected");
    code_.type = *type;
    code_.big_endian = Flag(AnyField({"BinaryDataByteOrderMSB", "ElementByteOrderMSB"}), false);
    const std::vector<double> slope = Numbers(Field("ElementToIntensityFunctionSlope")),
                              offset = Numbers(Field("ElementToIntensityFunctionOffset"));
    if (slope.size() == 1 && slope[0] != 0) code_.slope = slope[0];
    if (offset.size() == 1) code_.intercept = offset[0];
    const absl::string_view skipped = Field("HeaderSize");
    if (!skipped.empty() &&
        (!absl::SimpleAtoi(skipped, &skipped_) || skipped_ < -1 || skipped_ > kMostMetaSkipped)) {
      return WrongField("HeaderSize", absl::StrCat("-1 to ", kMostMetaSkipped,
                                                   " bytes before the samples are read"));
    }
    return absl::OkStatus();
  }

  // Expands "%03d" with a number; the format uses printf() only for this.
  static std::optional<std::string> Numbered(absl::string_view pattern, int64_t number) {
    const size_t from = pattern.find('%');
    const size_t end = pattern.find_first_not_of("0123456789", from + 1);
    int width = 0;
    const absl::string_view digits =
        end == absl::string_view::npos ? "" : pattern.substr(from + 1, end - from - 1);
    if (end == absl::string_view::npos || pattern[end] != 'd' ||
        pattern.find('%', end) != absl::string_view::npos ||
        (!digits.empty() && (!absl::SimpleAtoi(digits, &width) || width > 20))) {
      return std::nullopt;
    }
    std::string text = absl::StrCat(number);
    if (text.size() < static_cast<size_t>(width))
      text.insert(0, static_cast<size_t>(width) - text.size(),
                  absl::StartsWith(digits, "0") ? '0' : ' ');
    return absl::StrCat(pattern.substr(0, from), text, pattern.substr(end + 1));
  }

  // Returns the files with the samples, in order; none if the samples are in this file.
  absl::StatusOr<std::vector<std::string>> DataFiles() const {
    const absl::string_view value = Field("ElementDataFile");
    std::vector<std::string> files;
    if (absl::EqualsIgnoreCase(value, "LOCAL")) return files;
    if (absl::StartsWith(value, "LIST")) {
      for (const absl::string_view line :
           absl::StrSplit(absl::string_view(file_.bytes).substr(body_), '\n')) {
        const absl::string_view name = absl::StripAsciiWhitespace(line);
        if (name.empty()) continue;
        files.emplace_back(name);
        if (files.size() > kMostMetaFiles) break;
      }
      if (files.empty() || files.size() > kMostMetaFiles)
        return WrongField("ElementDataFile",
                          absl::StrCat("1 to ", kMostMetaFiles, " names are expected after it"));
      return files;
    }
    if (!absl::StrContains(value, '%')) return std::vector<std::string>{std::string(value)};
    // The words are a pattern, the first number, the last number, and the step.
    const std::vector<absl::string_view> words = absl::StrSplit(value, ' ', absl::SkipEmpty());
    std::array<int64_t, 3> range = {1, 0, 1};
    bool good = words.size() == 4 || words.size() == 3;
    for (size_t i = 1; i < words.size() && good; ++i)
      good = absl::SimpleAtoi(words[i], &range[i - 1]) && std::abs(range[i - 1]) < INT32_MAX;
    good = good && range[2] > 0 && range[1] >= range[0] &&
           (range[1] - range[0]) / range[2] < static_cast<int64_t>(kMostMetaFiles);
    for (int64_t i = range[0]; good && i <= range[1]; i += range[2]) {
      const std::optional<std::string> name = Numbered(words[0], i);
      good = name.has_value();
      if (good) files.push_back(*name);
    }
    if (!good)
      return WrongField(
          "ElementDataFile",
          "a name, LOCAL, LIST or a pattern such as \"slice%03d.raw 1 20 1\" is expected");
    return files;
  }

  // Returns the first `wanted` bytes of the samples in `data`.
  absl::StatusOr<std::string> Unpack(const SourceFile& file, absl::string_view data,
                                     uint64_t wanted) const {
    const auto skipped = static_cast<uint64_t>(std::max<int64_t>(skipped_, 0));
    if (!Flag(Field("CompressedData"), false)) {
      // -1 means that the samples are at the end of the file.
      const uint64_t all = wanted * times_;
      const uint64_t from =
          skipped_ >= 0 ? skipped : data.size() - std::min<uint64_t>(data.size(), all);
      return std::string(data.substr(std::min<uint64_t>(from, data.size()), wanted));
    }
    data.remove_prefix(std::min<uint64_t>(skipped, data.size()));
    return Inflate(file, data, wanted, Deflated::kEither);
  }

  absl::Status ReadSamples(SampledVolume* volume) const {
    const absl::StatusOr<std::vector<std::string>> names = DataFiles();
    if (!names.ok()) return names.status();
    const uint64_t count = samples_ * channels_;
    const bool text = !Flag(Field("BinaryData"), true);
    if (names->empty()) {
      const absl::string_view data = absl::string_view(file_.bytes).substr(body_);
      if (text) return ReadText(data, volume);
      const uint64_t wanted = count * SampleBytes(code_.type);
      // Uncompressed samples in this file are decoded without a copy.
      if (!Flag(Field("CompressedData"), false) && skipped_ == 0)
        return Decode(file_, data, volume);
      const absl::StatusOr<std::string> bytes = Unpack(file_, data, wanted);
      return bytes.ok() ? Decode(file_, *bytes, volume) : bytes.status();
    }
    std::string all;
    const uint64_t wanted = count * SampleBytes(code_.type);
    for (size_t i = 0; i < names->size() && all.size() < wanted; ++i) {
      absl::StatusOr<SourceFile> other = ReadOtherFile(file_, (*names)[i]);
      if (!other.ok())
        return FileError(file_,
                         absl::StrCat("has its samples in \"",
                                      EscapeForTerminal((*names)[i].substr(0, 60)), "\""),
                         other.status().message());
      if (text) return ReadText(other->bytes, volume);
      absl::StatusOr<std::string> bytes =
          Unpack(*other, other->bytes,
                 names->size() == 1 ? wanted : std::min(wanted, wanted * times_ / names->size()));
      if (!bytes.ok()) return bytes.status();
      if (names->size() == 1) {
        all = *std::move(bytes);
      } else {
        all += *bytes;
      }
    }
    return Decode(file_, all, volume);
  }

  absl::Status Decode(const SourceFile& file, absl::string_view data, SampledVolume* volume) const {
    const absl::StatusOr<absl::string_view> bytes =
        TakeSamples(file, data, 0, samples_, channels_ * SampleBytes(code_.type));
    if (!bytes.ok()) return bytes.status();
    if (AreColors()) {
      DecodeColors(*bytes, code_, channels_, volume);
      return absl::OkStatus();
    }
    DecodeSamples(*bytes, code_, &volume->samples);
    KeepFirstOfEach(channels_, &volume->samples);
    return absl::OkStatus();
  }

  // Three or four unsigned numbers of 8 or 16 bits are how programs write colours; others are vectors.
  bool AreColors() const {
    return (code_.type == SampleType::kU8 || code_.type == SampleType::kU16) &&
           (channels_ == 3 || channels_ == 4);
  }

  absl::Status ReadText(absl::string_view data, SampledVolume* volume) const {
    std::vector<float> numbers;
    const absl::Status status = ReadTextSamples(file_, data, samples_ * channels_, code_, &numbers);
    if (!status.ok()) return status;
    if (AreColors()) {
      ColorsOf(numbers, code_.type, channels_, volume);
      return absl::OkStatus();
    }
    volume->samples = std::move(numbers);
    KeepFirstOfEach(channels_, &volume->samples);
    return absl::OkStatus();
  }

  // Returns: the directions of the axes, one per row; empty if the file has no matrix.
  std::vector<double> Matrix() const {
    const std::vector<double> matrix =
        Numbers(AnyField({"TransformMatrix", "Rotation", "Orientation"}));
    return matrix.size() == axes_ * axes_ ? matrix : std::vector<double>();
  }

  absl::Status Place(SampledVolume* volume) const {
    const std::vector<double> matrix = Matrix(),
                              at = Numbers(AnyField({"Offset", "Position", "Origin"}));
    std::vector<double> spacing = Numbers(AnyField({"ElementSpacing", "ElementSize"}));
    const absl::string_view given = AnyField({"TransformMatrix", "Rotation", "Orientation"});
    if (!given.empty() && matrix.empty()) {
      return FileError(
          file_,
          absl::StrCat("has \"", EscapeForTerminal(given.substr(0, 60)), "\" for TransformMatrix"),
          absl::StrCat(axes_ * axes_, " numbers are expected"));
    }
    std::array<Point3, 3> steps = {Point3{1, 0, 0}, Point3{0, 1, 0}, Point3{0, 0, 1}};
    const size_t axes = std::min<size_t>(axes_, 3);
    const auto number = [axes](const std::vector<double>& numbers, size_t from, size_t i) {
      return i < axes && from + i < numbers.size() ? numbers[from + i] : 0;
    };
    for (size_t axis = 0; axis < axes; ++axis) {
      if (!matrix.empty()) {
        const size_t row = axis * axes_;
        steps[axis] = {number(matrix, row, 0), number(matrix, row, 1), number(matrix, row, 2)};
      }
      const double step = axis < spacing.size() && spacing[axis] != 0 ? spacing[axis] : 1;
      steps[axis] = {steps[axis].x * step, steps[axis].y * step, steps[axis].z * step};
    }
    // The viewer is in front of the face, on the side of -y; the file's axes point to the patient's
    // left, back and head.
    return PlaceVolume(file_, {number(at, 0, 0), number(at, 0, 1), number(at, 0, 2)}, steps,
                       volume);
  }

  const SourceFile& file_;
  std::map<std::string, std::string, std::less<>> fields_;
  size_t body_ = 0, axes_ = 0;
  std::array<uint64_t, 3> size_ = {1, 1, 1};
  uint64_t samples_ = 1, channels_ = 1, times_ = 1;
  int64_t skipped_ = 0;
  SampleCode code_;
};

}  // namespace

absl::StatusOr<Model> ReadMetaVolume(const SourceFile& file) { return MetaReader(file).Read(); }

}  // namespace voxeld::voxelctl
