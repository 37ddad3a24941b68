// Reads NRRD: lines "name: value", and samples.
#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <functional>
#include <initializer_list>
#include <limits>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "absl/algorithm/container.h"
#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_replace.h"
#include "absl/strings/str_split.h"
#include "absl/strings/strip.h"
#include "common/text/printable.h"
#include "tools/import/inflate.h"
#include "tools/import/volume_samples.h"
#include "tools/import/volumes.h"

namespace voxeld::voxelctl {
namespace {

constexpr size_t kMostHeader = 1 << 20;

// Returns the name in lower case, without spaces and dashes, which some programs leave out.
std::string Plain(absl::string_view text) {
  std::string plain;
  for (const char c : text) {
    if (c != ' ' && c != '-') plain += absl::ascii_tolower(static_cast<unsigned char>(c));
  }
  return plain;
}

constexpr int64_t kMostSkipped = 1 << 30;  // bytes

std::optional<SampleType> NrrdTypeOf(absl::string_view name) {
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
      {"longlongint", SampleType::kI64},
      {"signedlonglong", SampleType::kI64},
      {"signedlonglongint", SampleType::kI64},
      {"int64", SampleType::kI64},
      {"int64_t", SampleType::kI64},
      {"ulonglong", SampleType::kU64},
      {"unsignedlonglong", SampleType::kU64},
      {"unsignedlonglongint", SampleType::kU64},
      {"uint64", SampleType::kU64},
      {"uint64_t", SampleType::kU64},
      {"float", SampleType::kF32},
      {"double", SampleType::kF64}};
  for (const auto& [known, type] : kNames) {
    if (Plain(name) == known) return type;
  }
  return std::nullopt;
}

class NrrdReader {
 public:
  explicit NrrdReader(const SourceFile& file) : file_(file) {}

  absl::StatusOr<Model> Read() {
    for (const auto step :
         {&NrrdReader::ReadHeader, &NrrdReader::ReadCode, &NrrdReader::ReadSizes}) {
      if (absl::Status status = (this->*step)(); !status.ok()) return status;
    }
    SampledVolume volume;
    for (size_t axis = 0; axis < 3; ++axis) volume.size[axis] = static_cast<uint32_t>(size_[axis]);
    absl::StatusOr<SourceFile> beside = Beside();
    if (!beside.ok()) return beside.status();
    const absl::string_view data =
        beside->bytes.empty() ? absl::string_view(file_.bytes).substr(body_) : beside->bytes;
    if (absl::Status status = ReadSamples(data, &volume); !status.ok()) return status;
    if (absl::Status status = Place(&volume); !status.ok()) return status;
    Model model;
    model.path = file_.path;
    model.format = "NRRD";
    model.up = Up::kZ;
    if (volume.colors.empty()) AddLeftOut("further components", each_ - 1, &model);
    const bool colors = !volume.colors.empty();
    AddLeftOut("further times", colors && AreColorPlanes() ? 0 : volumes_ - 1, &model);
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
      // "key:=value" does not describe the samples.
      if (ended || line.front() == '#' || colon == absl::string_view::npos) continue;
      const std::string name = Plain(line.substr(0, colon));
      std::string& value = fields_[name];
      value = std::string(absl::StripAsciiWhitespace(line.substr(colon + 2)));
      // Blanks inside vectors are removed, so that each vector is one word.
      if (absl::StartsWith(name, "space"))
        absl::StrReplaceAll({{", ", ","}, {"( ", "("}, {" )", ")"}}, &value);
    }
    if (!ended && Field("datafile").empty()) {
      return FileError(file_, "has a header that does not end",
                       "an empty line is expected behind it");
    }
    body_ = at;
    return absl::OkStatus();
  }

  // A fourth axis, or one without a direction, counts the values at each place if it is the first,
  // and otherwise volumes.
  absl::Status ReadSizes() {
    size_t dimension = 0;
    if (!absl::SimpleAtoi(Field("dimension"), &dimension) || dimension < 2 || dimension > 4) {
      return WrongField("dimension", "2 to 4 axes are read");
    }
    const std::vector<absl::string_view> words = Words("sizes");
    std::vector<uint64_t> sizes(dimension);
    bool good = words.size() == dimension;
    for (size_t axis = 0; axis < dimension && good; ++axis)
      good = absl::SimpleAtoi(words[axis], &sizes[axis]);
    if (!good) return WrongField("sizes", absl::StrCat(dimension, " numbers are expected"));
    const absl::StatusOr<std::optional<size_t>> extra = ExtraAxis(dimension);
    if (!extra.ok()) return extra.status();
    for (size_t axis = 0; axis < dimension; ++axis) {
      if (*extra != axis) axes_.push_back(axis);
    }
    for (size_t i = 0; i < axes_.size(); ++i) size_[i] = sizes[axes_[i]];
    if (absl::Status status = CheckVolumeSize(file_, size_); !status.ok()) return status;
    if (!extra->has_value()) return absl::OkStatus();
    uint64_t& count = **extra == 0 ? each_ : volumes_;
    count = sizes[**extra];
    if (count >= 1 && count <= kMaxModelSamples / (size_[0] * size_[1] * size_[2]))
      return absl::OkStatus();
    return WrongField("sizes", absl::StrCat("1 to ", kMaxModelSamples, " numbers in all are read"));
  }

  std::vector<absl::string_view> Words(absl::string_view field) const {
    return absl::StrSplit(Field(field), absl::ByAnyChar(" \t"), absl::SkipEmpty());
  }

  // Returns which axis is not spatial; nothing if all are.
  absl::StatusOr<std::optional<size_t>> ExtraAxis(size_t dimension) const {
    const std::vector<absl::string_view> directions = Words("spacedirections"),
                                         kinds = Words("kinds");
    std::vector<size_t> found;
    for (size_t axis = 0; axis < dimension; ++axis) {
      const bool no_direction = axis < directions.size() && directions[axis] == "none";
      const bool other_kind =
          directions.empty() && axis < kinds.size() && !kinds[axis].empty() &&
          !absl::c_linear_search(
              std::initializer_list<absl::string_view>{"domain", "space", "???", "none"},
              absl::AsciiStrToLower(kinds[axis]));
      if (no_direction || other_kind) found.push_back(axis);
    }
    if (found.empty() && dimension == 4) found.push_back(3);
    if (found.empty()) return std::nullopt;
    if (found.size() == 1 && dimension > 2 && (found[0] == 0 || found[0] == dimension - 1))
      return found[0];
    return WrongField(
        directions.empty() ? "kinds" : "spacedirections",
        "two or three axes of places, and one more at the most, the first or the last, are read");
  }

  absl::Status ReadCode() {
    const std::optional<SampleType> type = NrrdTypeOf(Field("type"));
    if (!type)
      return WrongField("type", "a type of numbers such as \"short\" or \"float\" is expected");
    code_.type = *type;
    encoding_ = Plain(Field("encoding"));
    if (encoding_ == "gz") encoding_ = "gzip";
    if (encoding_ == "text" || encoding_ == "txt") encoding_ = "ascii";
    if (encoding_ != "raw" && encoding_ != "gzip" && encoding_ != "ascii" && encoding_ != "hex") {
      return WrongField("encoding", "raw, gzip, hex and ascii are read");
    }
    if (encoding_ == "ascii" || SampleBytes(code_.type) == 1) return absl::OkStatus();
    const std::string endian = Plain(Field("endian"));
    if (endian != "little" && endian != "big")
      return WrongField("endian", "little or big is expected");
    code_.big_endian = endian == "big";
    return absl::OkStatus();
  }

  // Returns the detached file; empty if the samples are in the file itself.
  absl::StatusOr<SourceFile> Beside() const {
    const absl::string_view name = Field("datafile");
    if (name.empty()) return SourceFile();
    if (absl::StartsWith(name, "LIST") || absl::StrContains(name, '%')) {
      return WrongField("datafile", "samples in one file are read");
    }
    absl::StatusOr<SourceFile> read = ReadOtherFile(file_, std::string(name));
    if (read.ok()) return read;
    return WrongField("datafile", read.status().message());
  }

  absl::Status SkipLines(absl::string_view* data) const {
    int64_t lines = 0;
    if (!Field("lineskip").empty() && (!absl::SimpleAtoi(Field("lineskip"), &lines) || lines < 0)) {
      return WrongField("lineskip", "a number of lines is expected");
    }
    for (; lines > 0 && !data->empty(); --lines)
      data->remove_prefix(std::min(data->find('\n'), data->size() - 1) + 1);
    return absl::OkStatus();
  }

  // Returns: how many bytes precede the samples; -1: the samples are at the end.
  absl::StatusOr<int64_t> ByteSkip() const {
    int64_t bytes = 0;
    if (!Field("byteskip").empty() &&
        (!absl::SimpleAtoi(Field("byteskip"), &bytes) || bytes < -1)) {
      return WrongField("byteskip", "a number of bytes, or -1, is expected");
    }
    return bytes;
  }

  absl::Status Skip(absl::string_view* data, uint64_t wanted) const {
    const absl::StatusOr<int64_t> bytes = ByteSkip();
    if (!bytes.ok()) return bytes.status();
    if (absl::Status status = SkipLines(data); !status.ok()) return status;
    const uint64_t skipped = *bytes >= 0              ? static_cast<uint64_t>(*bytes)
                             : data->size() >= wanted ? data->size() - wanted
                                                      : 0;
    if (skipped > data->size())
      return WrongField("byteskip", absl::StrCat(data->size(), " are there"));
    data->remove_prefix(skipped);
    return absl::OkStatus();
  }

  // Lines are skipped before the data are decompressed, bytes afterwards.
  absl::Status ReadCompressed(absl::string_view data, uint64_t wanted,
                              SampledVolume* volume) const {
    const absl::StatusOr<int64_t> bytes = ByteSkip();
    if (!bytes.ok()) return bytes.status();
    if (*bytes < 0 || *bytes > kMostSkipped) {
      return WrongField("byteskip",
                        absl::StrCat("0 to ", kMostSkipped, " are read where data are compressed"));
    }
    if (absl::Status status = SkipLines(&data); !status.ok()) return status;
    const auto skipped = static_cast<uint64_t>(*bytes);
    const absl::StatusOr<std::string> all = Inflate(file_, data, skipped + wanted);
    if (!all.ok()) return all.status();
    if (skipped > all->size())
      return WrongField("byteskip", absl::StrCat(all->size(), " are there"));
    return Take(absl::string_view(*all).substr(skipped), wanted, volume);
  }

  static bool IsRgb(absl::string_view kind) {
    return absl::StrContains(kind, "color") && !absl::StartsWith(kind, "hsv") &&
           !absl::StartsWith(kind, "xyz");
  }

  // Returns whether the values are colours: three or four per place, whatever the axis is called,
  // if its kind is a kind of colours.
  bool AreColors() const {
    const std::vector<absl::string_view> kinds = Words("kinds");
    const std::string kind = kinds.empty() ? "" : absl::AsciiStrToLower(kinds[0]);
    return IsRgb(kind) && (each_ == 3 || each_ == 4);
  }

  // The same, with all of red before green.
  bool AreColorPlanes() const {
    const std::vector<absl::string_view> kinds = Words("kinds");
    return each_ == 1 && (volumes_ == 3 || volumes_ == 4) && kinds.size() == axes_.size() + 1 &&
           IsRgb(absl::AsciiStrToLower(kinds.back()));
  }

  // The text has two digits per byte.
  absl::Status ReadHex(absl::string_view data, uint64_t wanted, SampledVolume* volume) const {
    std::string bytes;
    int high = -1;
    for (const char c : data) {
      if (bytes.size() == wanted) break;
      if (absl::ascii_isspace(static_cast<unsigned char>(c))) continue;
      if (!absl::ascii_isxdigit(static_cast<unsigned char>(c))) {
        return FileError(file_,
                         absl::StrCat("has \"", EscapeForTerminal(absl::string_view(&c, 1)),
                                      "\" behind ", bytes.size(), " bytes of samples in hex"),
                         "hexadecimal digits are expected");
      }
      const int digit = absl::ascii_isdigit(static_cast<unsigned char>(c))
                            ? c - '0'
                            : absl::ascii_tolower(static_cast<unsigned char>(c)) - 'a' + 10;
      if (high < 0) {
        high = digit;
      } else {
        bytes += static_cast<char>(high * 16 + digit);
        high = -1;
      }
    }
    return Take(bytes, wanted, volume);
  }

  absl::Status ReadSamples(absl::string_view data, SampledVolume* volume) const {
    std::vector<float> numbers;
    // The samples of the first volume.
    const uint64_t samples = size_[0] * size_[1] * size_[2] * (AreColorPlanes() ? volumes_ : each_);
    const uint64_t wanted = samples * SampleBytes(code_.type);
    if (encoding_ == "gzip") return ReadCompressed(data, wanted, volume);
    const uint64_t all = AreColorPlanes() ? wanted : wanted * volumes_;
    if (absl::Status status = Skip(&data, all); !status.ok()) return status;
    if (encoding_ == "raw") return Take(data, wanted, volume);
    if (encoding_ == "hex") return ReadHex(data, wanted, volume);
    if (absl::Status status = ReadTextSamples(file_, data, samples, {}, &numbers); !status.ok())
      return status;
    if (AreColors()) {
      ColorsOf(numbers, code_.type, each_, volume);
      return absl::OkStatus();
    }
    if (AreColorPlanes()) {
      std::vector<float> mixed;
      mixed.reserve(numbers.size());
      const size_t plane = numbers.size() / volumes_;
      for (size_t at = 0; at < plane; ++at) {
        for (size_t k = 0; k < volumes_; ++k) mixed.push_back(numbers[k * plane + at]);
      }
      ColorsOf(mixed, code_.type, volumes_, volume);
      return absl::OkStatus();
    }
    volume->samples = std::move(numbers);
    KeepFirstOfEach(each_, &volume->samples);
    return absl::OkStatus();
  }

  absl::Status Take(absl::string_view data, uint64_t wanted, SampledVolume* volume) const {
    if (data.size() < wanted) {
      return FileError(file_,
                       absl::StrCat("has ", data.size(), " bytes of samples; ", size_[0], " by ",
                                    size_[1], " by ", size_[2], " take ", wanted),
                       "the file is truncated");
    }
    if (AreColors()) {
      DecodeColors(data.substr(0, wanted), code_, each_, volume);
      return absl::OkStatus();
    }
    if (AreColorPlanes()) {
      DecodeColors(Interleaved(data.substr(0, wanted), volumes_, SampleBytes(code_.type)), code_,
                   volumes_, volume);
      return absl::OkStatus();
    }
    DecodeSamples(data.substr(0, wanted), code_, &volume->samples);
    KeepFirstOfEach(each_, &volume->samples);
    return absl::OkStatus();
  }

  // Parses "(x,y,z)".
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
    const std::vector<absl::string_view> directions = Words("spacedirections"),
                                         spacings = Words("spacings"), mins = Words("axismins"),
                                         maxs = Words("axismaxs");
    // The format has two names for this field.
    const std::vector<absl::string_view> centers =
        Words(Field("centers").empty() ? "centerings" : "centers");
    for (size_t i = 0; i < axes_.size(); ++i) {
      if (!directions.empty()) {
        const std::optional<Point3> step =
            axes_[i] < directions.size() ? Vector(directions[axes_[i]]) : std::nullopt;
        if (!step) {
          return WrongField("spacedirections", "a vector for each axis is expected, as (0,0,1)");
        }
        steps[i] = *step;
      } else if (axes_[i] < spacings.size()) {
        double length = 0;
        if (!absl::SimpleAtod(spacings[axes_[i]], &length)) {
          return WrongField("spacings", "a number for each axis is expected");
        }
        // "nan" means unknown.
        double* const lengths[] = {&steps[0].x, &steps[1].y, &steps[2].z};
        if (std::isfinite(length) && length != 0) *lengths[i] = length;
      } else if (axes_[i] < mins.size() && axes_[i] < maxs.size()) {
        // The ends of the axis are the outer edges of its cells, or the centres of the first and
        // the last sample.
        const bool nodes = axes_[i] < centers.size() && centers[axes_[i]] == "node";
        const double steps_along = static_cast<double>(size_[i]) - (nodes ? 1 : 0);
        double least = 0, most = 0;
        if (!absl::SimpleAtod(mins[axes_[i]], &least) || !absl::SimpleAtod(maxs[axes_[i]], &most))
          return WrongField("axismaxs", "a number for each axis is expected");
        const double length = (most - least) / steps_along;
        double* const lengths[] = {&steps[0].x, &steps[1].y, &steps[2].z};
        if (std::isfinite(length) && length != 0) *lengths[i] = length;
      }
    }
    if (!Field("spaceorigin").empty()) {
      const std::optional<Point3> origin = Vector(Field("spaceorigin"));
      if (!origin) return WrongField("spaceorigin", "a place is expected, as (0,0,0)");
      first = *origin;
    }
    // The axes point to the patient's left, back and head: the viewer is in front of the face, on
    // the side of -y.
    const std::string space = Plain(Field("space"));
    const bool right = absl::StartsWith(space, "right") && absl::StrContains(space, "superior");
    const bool anterior = absl::StrContains(space, "anterior") || absl::StartsWith(space, "ras") ||
                          absl::StartsWith(space, "las");
    const double x = right || absl::StartsWith(space, "ras") ? -1 : 1, y = anterior ? -1 : 1;
    const auto turned = [x, y](const Point3& p) { return Point3{x * p.x, y * p.y, p.z}; };
    return PlaceVolume(file_, turned(first), {turned(steps[0]), turned(steps[1]), turned(steps[2])},
                       volume);
  }

  const SourceFile& file_;
  std::map<std::string, std::string, std::less<>> fields_;  // by Plain()
  size_t body_ = 0;
  std::vector<size_t> axes_;  // spatial axes, in the file's numbering
  uint64_t each_ = 1, volumes_ = 1;
  std::array<uint64_t, 3> size_ = {1, 1, 1};
  SampleCode code_;
  std::string encoding_;
};

}  // namespace

absl::StatusOr<Model> ReadNrrdVolume(const SourceFile& file) { return NrrdReader(file).Read(); }

}  // namespace voxeld::voxelctl
