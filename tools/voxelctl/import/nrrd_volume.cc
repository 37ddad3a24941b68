#include "tools/voxelctl/import/nrrd_volume.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
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
#include "tools/voxelctl/import/inflate.h"
#include "tools/voxelctl/import/volume_samples.h"
#include "tools/voxelctl/text/escape.h"

namespace voxeld::voxelctl {
namespace {

constexpr size_t kMostHeader = 1 << 20;

// In lower case, without its spaces and dashes, as some programs leave them out.
std::string Plain(absl::string_view text) {
  std::string plain;
  for (const char c : text) {
    if (c != ' ' && c != '-') plain += absl::ascii_tolower(static_cast<unsigned char>(c));
  }
  return plain;
}

std::optional<SampleType> TypeOf(absl::string_view name) {
  static constexpr std::pair<absl::string_view, SampleType> kNames[] = {
      {"signedchar", SampleType::kI8},
      {"int8", SampleType::kI8},
      {"int8_t", SampleType::kI8},
      {"uchar", SampleType::kU8},
      {"unsignedchar", SampleType::kU8},
      {"uint8", SampleType::kU8},
      {"uint8_t", SampleType::kU8},
      {"short", SampleType::kI16},
      {"shortint", SampleType::kI16},
      {"signedshort", SampleType::kI16},
      {"signedshortint", SampleType::kI16},
      {"int16", SampleType::kI16},
      {"int16_t", SampleType::kI16},
      {"ushort", SampleType::kU16},
      {"unsignedshort", SampleType::kU16},
      {"unsignedshortint", SampleType::kU16},
      {"uint16", SampleType::kU16},
      {"uint16_t", SampleType::kU16},
      {"int", SampleType::kI32},
      {"signedint", SampleType::kI32},
      {"int32", SampleType::kI32},
      {"int32_t", SampleType::kI32},
      {"uint", SampleType::kU32},
      {"unsignedint", SampleType::kU32},
      {"uint32", SampleType::kU32},
      {"uint32_t", SampleType::kU32},
      {"longlong", SampleType::kI64},
      {"int64", SampleType::kI64},
      {"int64_t", SampleType::kI64},
      {"ulonglong", SampleType::kU64},
      {"unsignedlonglong", SampleType::kU64},
      {"uint64", SampleType::kU64},
      {"uint64_t", SampleType::kU64},
      {"float", SampleType::kF32},
      {"double", SampleType::kF64}};
  for (const auto& [known, type] : kNames) {
    if (Plain(name) == known) return type;
  }
  return std::nullopt;
}

class Reader {
 public:
  explicit Reader(const SourceFile& file) : file_(file) {}

  absl::StatusOr<Model> Read() {
    for (const auto step : {&Reader::ReadHeader, &Reader::ReadSizes, &Reader::ReadCode}) {
      if (absl::Status status = (this->*step)(); !status.ok()) return status;
    }
    SampledVolume volume;
    for (size_t axis = 0; axis < 3; ++axis) volume.size[axis] = static_cast<uint32_t>(size_[axis]);
    absl::StatusOr<SourceFile> beside = Beside();
    if (!beside.ok()) return beside.status();
    const absl::string_view data =
        beside->bytes.empty() ? absl::string_view(file_.bytes).substr(body_) : beside->bytes;
    if (absl::Status status = ReadSamples(data, &volume.samples); !status.ok()) return status;
    if (absl::Status status = Place(&volume); !status.ok()) return status;
    Model model;
    model.path = file_.path;
    model.format = "NRRD";
    model.up = Up::kZ;
    model.volumes.push_back(std::move(volume));
    return model;
  }

 private:
  absl::string_view Field(absl::string_view name) const {
    const auto at = fields_.find(name);
    return at == fields_.end() ? absl::string_view() : absl::string_view(at->second);
  }
  absl::Status WrongField(absl::string_view name, absl::string_view expected) const {
    const absl::string_view value = Field(name);
    return FileError(file_,
                     value.empty() ? absl::StrCat("says nothing of \"", name, "\"")
                                   : absl::StrCat("has \"", EscapeForTerminal(value.substr(0, 60)),
                                                  "\" for \"", name, "\""),
                     expected);
  }

  absl::Status ReadHeader() {
    const absl::string_view bytes = file_.bytes;
    if (!absl::StartsWith(bytes, "NRRD000")) {
      return FileError(file_, absl::StrCat("is ", DescribeContents(bytes)),
                       "a header that begins with \"NRRD000\" is expected");
    }
    size_t at = 0;
    bool ended = false;
    while (at < bytes.size() && at < kMostHeader && !ended) {
      const size_t end = std::min(bytes.find('\n', at), bytes.size());
      absl::string_view line = bytes.substr(at, end - at);
      at = std::min(end + 1, bytes.size());
      if (absl::EndsWith(line, "\r")) line.remove_suffix(1);
      ended = line.empty();
      const size_t colon = line.find(": ");
      // "key:=value" says nothing about the samples.
      if (ended || line.front() == '#' || colon == absl::string_view::npos) continue;
      fields_[Plain(line.substr(0, colon))] =
          std::string(absl::StripAsciiWhitespace(line.substr(colon + 2)));
    }
    if (!ended && Field("datafile").empty()) {
      return FileError(file_, "has a header that does not end",
                       "an empty line is expected behind it");
    }
    body_ = at;
    return absl::OkStatus();
  }

  absl::Status ReadSizes() {
    if (!absl::SimpleAtoi(Field("dimension"), &dimension_) || dimension_ < 2 || dimension_ > 3) {
      return WrongField("dimension", "2 or 3 axes of numbers are read");
    }
    const std::vector<absl::string_view> sizes =
        absl::StrSplit(Field("sizes"), ' ', absl::SkipEmpty());
    if (sizes.size() != static_cast<size_t>(dimension_)) {
      return WrongField("sizes", absl::StrCat(dimension_, " numbers are expected"));
    }
    for (size_t axis = 0; axis < sizes.size(); ++axis) {
      if (!absl::SimpleAtoi(sizes[axis], &size_[axis])) {
        return WrongField("sizes", absl::StrCat(dimension_, " numbers are expected"));
      }
    }
    return CheckVolumeSize(file_, size_);
  }

  absl::Status ReadCode() {
    const std::optional<SampleType> type = TypeOf(Field("type"));
    if (!type)
      return WrongField("type", "a type of numbers such as \"short\" or \"float\" is expected");
    code_.type = *type;
    encoding_ = Plain(Field("encoding"));
    if (encoding_ == "gz") encoding_ = "gzip";
    if (encoding_ == "text" || encoding_ == "txt") encoding_ = "ascii";
    if (encoding_ != "raw" && encoding_ != "gzip" && encoding_ != "ascii") {
      return WrongField("encoding", "raw, gzip and ascii are read");
    }
    if (encoding_ == "ascii" || SampleBytes(code_.type) == 1) return absl::OkStatus();
    const std::string endian = Plain(Field("endian"));
    if (endian != "little" && endian != "big")
      return WrongField("endian", "little or big is expected");
    code_.big_endian = endian == "big";
    return absl::OkStatus();
  }

  // Empty if the samples stand in the file itself.
  absl::StatusOr<SourceFile> Beside() const {
    const absl::string_view name = Field("datafile");
    if (name.empty()) return SourceFile();
    const std::filesystem::path path{std::string(name)};
    if (absl::StartsWith(name, "LIST") || absl::StrContains(name, '%')) {
      return WrongField("datafile", "samples in one file are read");
    }
    if (path.is_absolute() || std::count(path.begin(), path.end(), "..") > 0) {
      return WrongField("datafile", "a file in the header's folder is expected");
    }
    return ReadSourceFile((std::filesystem::path(file_.path).parent_path() / path).string());
  }

  absl::Status Skip(absl::string_view* data, uint64_t wanted) const {
    int64_t lines = 0, bytes = 0;
    if (!Field("lineskip").empty() && (!absl::SimpleAtoi(Field("lineskip"), &lines) || lines < 0)) {
      return WrongField("lineskip", "a number of lines is expected");
    }
    if (!Field("byteskip").empty() &&
        (!absl::SimpleAtoi(Field("byteskip"), &bytes) || bytes < -1)) {
      return WrongField("byteskip", "a number of bytes, or -1, is expected");
    }
    for (; lines > 0 && !data->empty(); --lines)
      data->remove_prefix(std::min(data->find('\n'), data->size() - 1) + 1);
    const uint64_t skipped = bytes >= 0               ? static_cast<uint64_t>(bytes)
                             : data->size() >= wanted ? data->size() - wanted
                                                      : 0;
    if (skipped > data->size())
      return WrongField("byteskip", absl::StrCat(data->size(), " are there"));
    data->remove_prefix(skipped);
    return absl::OkStatus();
  }

  absl::Status ReadSamples(absl::string_view data, std::vector<float>* out) const {
    const uint64_t samples = size_[0] * size_[1] * size_[2];
    const uint64_t wanted = samples * SampleBytes(code_.type);
    if (encoding_ == "gzip") {
      const absl::StatusOr<std::string> all = Inflate(file_, data, wanted);
      if (!all.ok()) return all.status();
      return Take(*all, wanted, out);
    }
    if (absl::Status status = Skip(&data, wanted); !status.ok()) return status;
    if (encoding_ == "raw") return Take(data, wanted, out);
    while (out->size() < samples) {
      const size_t from = std::min(data.find_first_not_of(" \t\r\n,"), data.size());
      data.remove_prefix(from);
      if (data.empty()) break;
      const absl::string_view word = data.substr(0, data.find_first_of(" \t\r\n,"));
      double value = 0;
      if (!absl::SimpleAtod(word, &value)) {
        return FileError(file_,
                         absl::StrCat("sample ", out->size(), " is \"",
                                      EscapeForTerminal(word.substr(0, 40)), "\""),
                         "a number is expected");
      }
      const auto number = static_cast<float>(value);
      out->push_back(std::isfinite(number) ? number : std::numeric_limits<float>::quiet_NaN());
      data.remove_prefix(word.size());
    }
    if (out->size() == samples) return absl::OkStatus();
    return FileError(file_, absl::StrCat("has ", out->size(), " samples of ", samples),
                     "the file is truncated");
  }

  absl::Status Take(absl::string_view data, uint64_t wanted, std::vector<float>* out) const {
    if (data.size() < wanted) {
      return FileError(file_,
                       absl::StrCat("has ", data.size(), " bytes of samples; ", size_[0], " by ",
                                    size_[1], " by ", size_[2], " take ", wanted),
                       "the file is truncated");
    }
    DecodeSamples(data.substr(0, wanted), code_, out);
    return absl::OkStatus();
  }

  // "(x,y,z)"
  static std::optional<Point3> Vector(absl::string_view text) {
    if (text.size() < 2 || text.front() != '(' || text.back() != ')') return std::nullopt;
    const std::vector<absl::string_view> words =
        absl::StrSplit(text.substr(1, text.size() - 2), ',');
    Point3 p;
    double* const numbers[] = {&p.x, &p.y, &p.z};
    if (words.size() > 3) return std::nullopt;
    for (size_t i = 0; i < words.size(); ++i) {
      if (!absl::SimpleAtod(words[i], numbers[i])) return std::nullopt;
    }
    return p;
  }

  absl::Status Place(SampledVolume* volume) const {
    std::array<Point3, 3> steps = {Point3{1, 0, 0}, Point3{0, 1, 0}, Point3{0, 0, 1}};
    Point3 first;
    if (!Field("spacedirections").empty()) {
      size_t axis = 0;
      for (const absl::string_view word :
           absl::StrSplit(Field("spacedirections"), ' ', absl::SkipEmpty())) {
        const std::optional<Point3> step = Vector(word);
        if (!step || axis >= static_cast<size_t>(dimension_)) {
          return WrongField("spacedirections", "a vector for each axis is expected, as (0,0,1)");
        }
        steps[axis++] = *step;
      }
      if (axis != static_cast<size_t>(dimension_)) {
        return WrongField("spacedirections", "a vector for each axis is expected, as (0,0,1)");
      }
    } else if (!Field("spacings").empty()) {
      const std::vector<absl::string_view> words =
          absl::StrSplit(Field("spacings"), ' ', absl::SkipEmpty());
      double* const lengths[] = {&steps[0].x, &steps[1].y, &steps[2].z};
      for (size_t axis = 0; axis < std::min<size_t>(words.size(), 3); ++axis) {
        double length = 0;
        if (!absl::SimpleAtod(words[axis], &length)) {
          return WrongField("spacings", "a number for each axis is expected");
        }
        // "nan": not known.
        if (std::isfinite(length) && length != 0) *lengths[axis] = length;
      }
    }
    if (!Field("spaceorigin").empty()) {
      const std::optional<Point3> origin = Vector(Field("spaceorigin"));
      if (!origin) return WrongField("spaceorigin", "a place is expected, as (0,0,0)");
      first = *origin;
    }
    // To the patient's left, back and head: the viewer stands before the face, on the side of -y.
    const std::string space = Plain(Field("space"));
    const bool right = absl::StartsWith(space, "right") && absl::StrContains(space, "superior");
    const bool anterior = absl::StrContains(space, "anterior") || space == "ras" || space == "las";
    const double x = right || space == "ras" ? -1 : 1, y = anterior ? -1 : 1;
    const auto turned = [x, y](const Point3& p) { return Point3{x * p.x, y * p.y, p.z}; };
    return PlaceVolume(file_, turned(first), {turned(steps[0]), turned(steps[1]), turned(steps[2])},
                       volume);
  }

  const SourceFile& file_;
  std::map<std::string, std::string, std::less<>> fields_;  // by Plain()
  size_t body_ = 0;
  int dimension_ = 3;
  std::array<uint64_t, 3> size_ = {1, 1, 1};
  SampleCode code_;
  std::string encoding_;
};

}  // namespace

absl::StatusOr<Model> ReadNrrdVolume(const SourceFile& file) { return Reader(file).Read(); }

}  // namespace voxeld::voxelctl
