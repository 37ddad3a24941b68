#include "tools/import/clouds.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <utility>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/string_view.h"
#include "tools/voxelctl/import/point_table.h"

namespace voxeld::voxelctl {
namespace {

static_assert(std::endian::native == std::endian::little, "values are read in place");

// Of the public header block, where its fields begin.
constexpr size_t kMinor = 25, kOffsetToPoints = 96, kFormat = 104, kRecordLength = 105,
                 kOldCount = 107, kScales = 131, kOffsets = 155, kHeaderBytes = 227, kCount14 = 247,
                 kHeaderBytes14 = 375;

// A point record format's least length, where its colours are (0: it has none), and where its flags.
struct PointFormat {
  size_t bytes, color, flags;
  uint8_t withheld;
};
constexpr PointFormat kPointFormats[] = {{20, 0, 15, 0x80},  {28, 0, 15, 0x80},  {26, 20, 15, 0x80},
                                         {34, 28, 15, 0x80}, {57, 0, 15, 0x80},  {63, 28, 15, 0x80},
                                         {30, 0, 15, 0x04},  {36, 30, 15, 0x04}, {38, 30, 15, 0x04},
                                         {59, 0, 15, 0x04},  {67, 30, 15, 0x04}};
constexpr size_t kIntensity = 12;

template <typename T>
T Take(absl::string_view bytes, size_t at) {
  T value;
  std::memcpy(&value, bytes.data() + at, sizeof(value));
  return value;
}

struct LasHeader {
  PointFormat format;
  size_t points_at = 0, record = 0;
  uint64_t count = 0;
  double scale[3] = {}, offset[3] = {};
};

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
  LasHeader out{kPointFormats[format]};
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
  return out;
}

// Offsets of what a point has besides, by its kind of format: before and from 6 on.
struct OtherFields {
  uint32_t return_bits, classification, classification_bits, source;
};
constexpr OtherFields kOthersBefore6 = {0x07, 15, 0x1F, 18}, kOthersFrom6 = {0x0F, 16, 0xFF, 20};
constexpr size_t kReturns = 14;

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
  std::array<bool, kPointColumns> has = {true, true, true};
  const bool colored = brightest > 0;  // some have the room for colours and none in it
  for (const PointColumn c : {PointColumn::kRed, PointColumn::kGreen, PointColumn::kBlue}) {
    has[static_cast<size_t>(c)] = colored;
  }
  has[static_cast<size_t>(PointColumn::kIntensity)] = !colored;
  absl::StatusOr<PointTable> table = PointTable::Make(file, has, brightest > 255 ? 65535 : 255);
  if (!table.ok()) return table.status();
  table->Reserve(header->count);
  std::vector<double> values;
  if (attributes) {
    table->SetAttributes({"intensity", "classification", "return", "source"});
    values.resize(4);
  }
  const OtherFields& others = header->format.withheld == 0x80 ? kOthersBefore6 : kOthersFrom6;
  uint64_t withheld = 0;
  for (uint64_t i = 0; i < header->count; ++i) {
    const size_t at = i * header->record;
    if ((Take<uint8_t>(points, at + header->format.flags) & header->format.withheld) != 0) {
      ++withheld;
      continue;
    }
    PointRow row = {};
    for (size_t a = 0; a < 3; ++a) {
      row[a] = Take<int32_t>(points, at + 4 * a) * header->scale[a] + header->offset[a];
      if (colored) {
        row[static_cast<size_t>(PointColumn::kRed) + a] =
            Take<uint16_t>(points, at + color + 2 * a);
      }
    }
    row[static_cast<size_t>(PointColumn::kIntensity)] = Take<uint16_t>(points, at + kIntensity);
    if (attributes) {
      values = {row[static_cast<size_t>(PointColumn::kIntensity)],
                static_cast<double>(Take<uint8_t>(points, at + others.classification) &
                                    others.classification_bits),
                static_cast<double>(Take<uint8_t>(points, at + kReturns) & others.return_bits),
                static_cast<double>(Take<uint16_t>(points, at + others.source))};
    }
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
  return model;
}

}  // namespace voxeld::voxelctl
