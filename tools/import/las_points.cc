#include "tools/import/clouds.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/string_view.h"
#include "tools/voxelctl/import/point_table.h"

namespace voxeld::voxelctl {
namespace {

static_assert(std::endian::native == std::endian::little, "values are read in place");

// Offsets of the fields of the public header block.
constexpr size_t kMinor = 25, kHeaderSize = 94, kOffsetToPoints = 96, kRecords = 100, kFormat = 104,
                 kRecordLength = 105, kOldCount = 107, kScales = 131, kOffsets = 155,
                 kHeaderBytes = 227, kCount14 = 247, kHeaderBytes14 = 375;

// A point record format: its minimum length, and the offsets of its colours, time and waveform (0:
// it has none).
struct PointFormat {
  size_t bytes, color, time, waveform;
};
constexpr PointFormat kPointFormats[] = {{20, 0, 0, 0},   {28, 0, 20, 0},  {26, 20, 0, 0},
                                         {34, 28, 20, 0}, {57, 0, 20, 28}, {63, 28, 20, 34},
                                         {30, 0, 22, 0},  {36, 30, 22, 0}, {38, 30, 22, 0},
                                         {59, 0, 22, 30}, {67, 30, 22, 38}};
constexpr size_t kIntensity = 12, kNearInfrared = 36;

template <typename T>
T Take(absl::string_view bytes, size_t at) {
  T value;
  std::memcpy(&value, bytes.data() + at, sizeof(value));
  return value;
}

// Types of numbers, numbered as in the specification of extra bytes.
enum NumberType : uint8_t { kU8 = 1, kI8, kU16, kI16, kU32, kI32, kU64, kI64, kF32, kF64 };
constexpr size_t kNumberBytes[] = {0, 1, 1, 2, 2, 4, 4, 8, 8, 4, 8};

double NumberAt(absl::string_view bytes, size_t at, NumberType type) {
  switch (type) {
    case kU8:
      return Take<uint8_t>(bytes, at);
    case kI8:
      return Take<int8_t>(bytes, at);
    case kU16:
      return Take<uint16_t>(bytes, at);
    case kI16:
      return Take<int16_t>(bytes, at);
    case kU32:
      return Take<uint32_t>(bytes, at);
    case kI32:
      return Take<int32_t>(bytes, at);
    case kU64:
      return static_cast<double>(Take<uint64_t>(bytes, at));
    case kI64:
      return static_cast<double>(Take<int64_t>(bytes, at));
    case kF32:
      return Take<float>(bytes, at);
    case kF64:
      return Take<double>(bytes, at);
  }
  return 0;
}

// A value of each point besides its position and colour.
struct Dimension {
  std::string name;
  NumberType type = kU8;
  size_t at = 0;  // in the record
  // The position and number of its bits if it is part of a byte; 0 bits: all of its bytes.
  int shift = 0, bits = 0;
  double scale = 1, offset = 0;
  std::optional<double> no_data = std::nullopt;

  double ValueAt(absl::string_view points, size_t point) const {
    if (bits > 0) return (Take<uint8_t>(points, point + at) >> shift) & ((1 << bits) - 1);
    const double number = NumberAt(points, point + at, type);
    return no_data == number ? std::nan("") : number * scale + offset;
  }
  // Returns whether any point has a value other than 0, given the bitwise OR of all records.
  bool IsUsed(absl::string_view all) const {
    if (bits > 0) return ValueAt(all, 0) != 0;
    return all.substr(at, kNumberBytes[type]).find_first_not_of('\0') != absl::string_view::npos;
  }
};

// LAS 1.4, tables 7 (formats before 6) and 10.
std::vector<Dimension> DimensionsOf(size_t format) {
  std::vector<Dimension> all = {{"intensity", kU16, kIntensity}};
  if (format < 6) {
    all.insert(all.end(), {{"classification", kU8, 15, 0, 5},
                           {"return", kU8, 14, 0, 3},
                           {"source", kU16, 18},
                           {"returns", kU8, 14, 3, 3},
                           {"scan_direction", kU8, 14, 6, 1},
                           {"edge", kU8, 14, 7, 1},
                           {"synthetic", kU8, 15, 5, 1},
                           {"key_point", kU8, 15, 6, 1},
                           {"scan_angle", kI8, 16},
                           {"user_data", kU8, 17}});
  } else {
    all.insert(all.end(), {{"classification", kU8, 16},
                           {"return", kU8, 14, 0, 4},
                           {"source", kU16, 20},
                           {"returns", kU8, 14, 4, 4},
                           {"synthetic", kU8, 15, 0, 1},
                           {"key_point", kU8, 15, 1, 1},
                           {"overlap", kU8, 15, 3, 1},
                           {"scanner_channel", kU8, 15, 4, 2},
                           {"scan_direction", kU8, 15, 6, 1},
                           {"edge", kU8, 15, 7, 1},
                           {"user_data", kU8, 17},
                           {"scan_angle", kI16, 18, 0, 0, 0.006}});
  }
  const size_t time = kPointFormats[format].time;
  if (time != 0) all.push_back({"gps_time", kF64, time});
  if (format == 8 || format == 10) all.push_back({"near_infrared", kU16, kNearInfrared});
  return all;
}

struct LasHeader {
  PointFormat format;
  size_t points_at = 0, record = 0;
  uint64_t count = 0;
  double scale[3] = {}, offset[3] = {};
  std::vector<Dimension> dimensions;
  size_t unnamed_at = 0;  // in the record: extra bytes without a description begin here
  uint8_t withheld_flags = 15, withheld_bit = 0x80;
};

// Adds the extra bytes that the file describes (LAS 1.4, table 24). A descriptor with an unknown
// type ends the list.
void AddExtraBytes(absl::string_view descriptors, LasHeader* header) {
  constexpr size_t kDescriptor = 192, kType = 2, kOptions = 3, kName = 4, kNameBytes = 32,
                   kNoData = 40, kScale = 112, kOffset = 136;
  constexpr uint8_t kHasNoData = 0x01, kHasScale = 0x08, kHasOffset = 0x10;
  for (; descriptors.size() >= kDescriptor; descriptors.remove_prefix(kDescriptor)) {
    const auto code = Take<uint8_t>(descriptors, kType);
    const auto options = Take<uint8_t>(descriptors, kOptions);
    const absl::string_view padded = descriptors.substr(kName, kNameBytes);
    const absl::string_view name = padded.substr(0, padded.find('\0'));
    if (code == 0) {  // that many bytes without a type
      header->unnamed_at = std::min(header->unnamed_at + options, header->record);
      continue;
    }
    // Types from 11 on are pairs, and those from 21 on triples.
    const size_t several = (code - 1u) / 10 + 1;
    const auto type = static_cast<NumberType>((code - 1u) % 10 + 1);
    if (several > 3 || header->unnamed_at + several * kNumberBytes[type] > header->record) return;
    for (size_t i = 0; i < several; ++i) {
      Dimension one = {several == 1 ? std::string(name) : absl::StrCat(name, "_", i + 1), type,
                       header->unnamed_at};
      if ((options & kHasScale) != 0) one.scale = Take<double>(descriptors, kScale + 8 * i);
      if ((options & kHasOffset) != 0) one.offset = Take<double>(descriptors, kOffset + 8 * i);
      if ((options & kHasNoData) != 0) {
        // The value is stored in the widest type: an integer of eight bytes, or a double.
        const NumberType wide = type >= kF32 ? kF64 : type % 2 == 1 ? kU64 : kI64;
        one.no_data = NumberAt(descriptors, kNoData + 8 * i, wide);
      }
      header->dimensions.push_back(std::move(one));
      header->unnamed_at += kNumberBytes[type];
    }
  }
}

// Searches the variable length records for the one that describes extra bytes.
void ReadExtraBytes(absl::string_view bytes, LasHeader* header) {
  constexpr size_t kRecordHeader = 54, kUser = 2, kUserBytes = 16, kId = 18, kLength = 20;
  constexpr uint16_t kExtraBytes = 4;
  const absl::string_view before = bytes.substr(0, header->points_at);
  size_t at = Take<uint16_t>(bytes, kHeaderSize);
  for (uint32_t left = Take<uint32_t>(bytes, kRecords);
       left > 0 && at + kRecordHeader <= before.size(); --left) {
    const size_t length = Take<uint16_t>(before, at + kLength);
    const absl::string_view user = before.substr(at + kUser, kUserBytes);
    if (Take<uint16_t>(before, at + kId) == kExtraBytes &&
        user.substr(0, user.find('\0')) == "LASF_Spec") {
      AddExtraBytes(before.substr(at + kRecordHeader, length), header);
    }
    at += kRecordHeader + length;
  }
}

absl::StatusOr<LasHeader> ReadLasHeader(const SourceFile& file) {
  const absl::string_view bytes = file.bytes;
  if (!absl::StartsWith(bytes, "LASF") || bytes.size() < kHeaderBytes) {
    return FileError(file, absl::StrCat("is ", DescribeContents(bytes)), "a LAS file is expected");
  }
  const auto minor = Take<uint8_t>(bytes, kMinor), format = Take<uint8_t>(bytes, kFormat);
  if ((format & 0xC0) != 0) {
    return FileError(file, "is compressed (LAZ)",
                     "LAS is read: laszip or las2las turns one into it");
  }
  if (format >= std::size(kPointFormats)) {
    return FileError(file, absl::StrCat("has point format ", format), "0 to 10 are read");
  }
  LasHeader out;
  out.format = kPointFormats[format];
  out.points_at = Take<uint32_t>(bytes, kOffsetToPoints);
  out.record = Take<uint16_t>(bytes, kRecordLength);
  out.count = Take<uint32_t>(bytes, kOldCount);
  if (minor >= 4 && bytes.size() >= kHeaderBytes14) {
    out.count = std::max<uint64_t>(out.count, Take<uint64_t>(bytes, kCount14));
  }
  for (size_t a = 0; a < 3; ++a) {
    out.scale[a] = Take<double>(bytes, kScales + 8 * a);
    out.offset[a] = Take<double>(bytes, kOffsets + 8 * a);
    if (!std::isfinite(out.scale[a]) || !std::isfinite(out.offset[a]) || out.scale[a] == 0) {
      return FileError(file,
                       absl::StrCat("has scale ", out.scale[a], " and offset ", out.offset[a]),
                       "finite numbers are expected, and a scale that is not 0");
    }
  }
  const uint64_t there = out.points_at > bytes.size() || out.record == 0
                             ? 0
                             : (bytes.size() - out.points_at) / out.record;
  if (out.record < out.format.bytes || out.count == 0 || out.count > there) {
    return FileError(file,
                     absl::StrCat("tells of ", out.count, " points of ", out.record,
                                  " bytes, and has room for ", there, TextModeHint(bytes)),
                     absl::StrCat("format ", format, " has ", out.format.bytes,
                                  " bytes or more each; the file is truncated or damaged"));
  }
  out.dimensions = DimensionsOf(format);
  if (format >= 6) out.withheld_bit = 0x04;
  out.unnamed_at = out.format.bytes;
  ReadExtraBytes(bytes, &out);
  return out;
}

// Returns the bitwise OR of all records.
std::string AnyOf(absl::string_view points, const LasHeader& header) {
  // Works on 64-bit words, because a survey has many records.
  std::vector<uint64_t> words(header.record / sizeof(uint64_t));
  std::string rest(header.record % sizeof(uint64_t), '\0');
  const char* record = points.data();
  for (uint64_t i = 0; i < header.count; ++i) {
    for (uint64_t& any : words) {
      uint64_t word = 0;
      std::memcpy(&word, record, sizeof(word));
      any |= word;
      record += sizeof(word);
    }
    for (char& any : rest) any = static_cast<char>(any | *record++);
  }
  std::string all(words.size() * sizeof(uint64_t), '\0');
  std::memcpy(all.data(), words.data(), all.size());
  return all + rest;
}

}  // namespace

absl::StatusOr<Model> ReadLasPoints(const SourceFile& file, bool attributes) {
  const absl::StatusOr<LasHeader> header = ReadLasHeader(file);
  if (!header.ok()) return header.status();
  const absl::string_view points = absl::string_view(file.bytes).substr(header->points_at);
  const size_t color = header->format.color;
  uint16_t brightest = 0;
  for (uint64_t i = 0; color != 0 && i < header->count; ++i) {
    for (size_t c = 0; c < 3; ++c) {
      brightest = std::max(brightest, Take<uint16_t>(points, i * header->record + color + 2 * c));
    }
  }
  PointColumns columns = {PointColumn::kX, PointColumn::kY, PointColumn::kZ,
                          PointColumn::kIntensity};
  const bool colored = brightest > 0;  // some have the room for colours and none in it
  if (colored) {
    columns.insert(columns.end(), {PointColumn::kRed, PointColumn::kGreen, PointColumn::kBlue});
  }
  const PointLayout layout = PointLayout::Of(std::move(columns));
  absl::StatusOr<PointTable> table = PointTable::Make(file, layout, brightest > 255 ? 65535 : 255);
  if (!table.ok()) return table.status();
  table->Reserve(header->count);
  std::vector<double> values;
  if (attributes) {
    std::vector<std::string> names;
    for (const Dimension& one : header->dimensions) names.push_back(one.name);
    table->SetAttributes(std::move(names));
    values.resize(header->dimensions.size());
  }
  uint64_t withheld = 0, waveforms = 0;
  for (uint64_t i = 0; i < header->count; ++i) {
    const size_t at = i * header->record;
    if ((Take<uint8_t>(points, at + header->withheld_flags) & header->withheld_bit) != 0) {
      ++withheld;
      continue;
    }
    // The byte is the number of its descriptor; 0 means that this point has none.
    if (header->format.waveform != 0)
      waveforms += Take<uint8_t>(points, at + header->format.waveform) != 0 ? 1 : 0;
    PointRow row = {};
    for (size_t a = 0; a < 3; ++a) {
      row[a] = Take<int32_t>(points, at + 4 * a) * header->scale[a] + header->offset[a];
      if (colored) {
        row[static_cast<size_t>(PointColumn::kRed) + a] =
            Take<uint16_t>(points, at + color + 2 * a);
      }
    }
    row[static_cast<size_t>(PointColumn::kIntensity)] = Take<uint16_t>(points, at + kIntensity);
    for (size_t k = 0; k < values.size(); ++k)
      values[k] = header->dimensions[k].ValueAt(points, at);
    if (absl::Status status = table->Add(file, row, absl::StrCat("point ", i), values);
        !status.ok()) {
      return status;
    }
  }
  if (table->size() == 0) {
    return FileError(file, "has withheld points alone", "at least one other is expected");
  }
  Model model = std::move(*table).Finish(file, "LAS points");
  AddLeftOut("points marked as withheld", withheld, &model);
  AddLeftOut("waveforms", waveforms, &model);
  const std::string any = AnyOf(points, *header);
  if (!attributes) {
    const auto others = std::count_if(
        header->dimensions.begin(), header->dimensions.end(), [&](const Dimension& one) {
          const bool is_shown = one.at == kIntensity && layout.Has(PointColumn::kIntensity);
          return one.IsUsed(any) && !is_shown;
        });
    AddLeftOut("other dimensions", static_cast<uint64_t>(others), &model);
  }
  const absl::string_view unnamed = absl::string_view(any).substr(header->unnamed_at);
  if (unnamed.find_first_not_of('\0') != absl::string_view::npos)
    AddLeftOut("bytes of each point that nothing describes", unnamed.size(), &model);
  return model;
}

}  // namespace voxeld::voxelctl
