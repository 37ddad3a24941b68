// DICOM through gdcm.
#include "tools/voxelctl/import/dicom_volume.h"

#include <gdcmImageReader.h>
#include <gdcmTrace.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <exception>
#include <filesystem>
#include <map>
#include <optional>
#include <sstream>
#include <system_error>
#include <utility>
#include <vector>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "tools/voxelctl/import/contained.h"
#include "tools/voxelctl/import/dicom_check.h"
#include "tools/voxelctl/import/volume_samples.h"

namespace voxeld::voxelctl {
namespace {

constexpr size_t kMostFiles = 20'000;
constexpr double kEven = 0.1;  // by how much of their distance slices may be out of place, unsaid

struct Slice {
  std::array<uint64_t, 3> size = {1, 1, 1};
  std::array<double, 2> spacing = {1, 1};
  double between = 1;  // frames
  Point3 origin, right = {1, 0, 0}, down = {0, 1, 0};
};

Point3 Cross(const Point3& a, const Point3& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
double Dot(const Point3& a, const Point3& b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
Point3 Times(const Point3& p, double by) { return {p.x * by, p.y * by, p.z * by}; }

// Numbers with backslashes between them.
std::vector<double> Numbers(const std::string& text) {
  std::vector<double> numbers;
  for (const absl::string_view word : absl::StrSplit(text, '\\', absl::SkipEmpty())) {
    double number = 0;
    if (!absl::SimpleAtod(word, &number) || !std::isfinite(number)) return {};
    numbers.push_back(number);
  }
  return numbers;
}

absl::Status Undecoded(const SourceFile& file, absl::string_view why) {
  return FileError(file, absl::StrCat("its image could not be decoded (", why, ")"),
                   "the file is damaged or compressed in a way that is not supported");
}

SampleType TypeOf(const DicomFacts& facts) {
  switch (facts.bits_allocated) {
    case 8:
      return facts.is_signed ? SampleType::kI8 : SampleType::kU8;
    case 16:
      return facts.is_signed ? SampleType::kI16 : SampleType::kU16;
    default:
      return facts.is_signed ? SampleType::kI32 : SampleType::kU32;
  }
}

void PutNumber(std::string* out, uint64_t value, size_t bytes) {
  for (size_t i = 0; i < bytes; ++i) *out += static_cast<char>(value >> 8 * i);
}

// An element as every reader takes it.
void PutElement(std::string* out, uint32_t tag, absl::string_view kind, std::string value) {
  if (value.size() % 2 == 1) value += kind == "UI" ? '\0' : ' ';
  PutNumber(out, tag >> 16, 2);
  PutNumber(out, tag & 0xffff, 2);
  absl::StrAppend(out, kind);
  PutNumber(out, value.size(), 2);
  *out += value;
}

void PutShort(std::string* out, uint32_t tag, uint64_t value) {
  std::string bytes;
  PutNumber(&bytes, value, 2);
  PutElement(out, tag, "US", std::move(bytes));
}

// The library ends the program (by its assertions) at elements that are not as they should be. So it gets a file of our own
// making with nothing in it but what the pixels need, and the compressed fragments.
std::string Rewritten(const SourceFile& file, const DicomFacts& facts) {
  std::string meta;
  PutElement(&meta, 0x00020002, "UI", "1.2.840.10008.5.1.4.1.1.7");
  PutElement(&meta, 0x00020003, "UI", "1.2.3");
  PutElement(&meta, 0x00020010, "UI", facts.transfer_syntax);
  std::string out, size;
  out.resize(128);
  out += "DICM";
  PutNumber(&size, meta.size(), 4);
  PutElement(&out, 0x00020000, "UL", size);
  out += meta;
  PutElement(&out, 0x00080016, "UI", "1.2.840.10008.5.1.4.1.1.7");
  PutElement(&out, 0x00080018, "UI", "1.2.3");
  PutShort(&out, 0x00280002, 1);
  PutElement(&out, 0x00280004, "CS", "MONOCHROME2");
  PutElement(&out, 0x00280008, "IS", absl::StrCat(facts.frames));
  PutShort(&out, 0x00280010, facts.rows);
  PutShort(&out, 0x00280011, facts.columns);
  PutShort(&out, 0x00280100, facts.bits_allocated);
  PutShort(&out, 0x00280101, facts.bits_stored);
  PutShort(&out, 0x00280102, facts.high_bit);
  PutShort(&out, 0x00280103, facts.is_signed ? 1 : 0);
  out += std::string("\xe0\x7f\x10\x00OB\0\0\xff\xff\xff\xff", 12);
  for (size_t i = 0; i < facts.pixels.size(); ++i) {
    // The table of offsets is left empty: nothing here needs it.
    const auto [at, length] = i == 0 ? std::pair<size_t, size_t>(0, 0) : facts.pixels[i];
    out += std::string("\xfe\xff\x00\xe0", 4);
    PutNumber(&out, length + length % 2, 4);
    out.append(file.bytes, at, length);
    if (length % 2 == 1) out += '\0';
  }
  return out + std::string("\xfe\xff\xdd\xe0\0\0\0\0", 8);
}

absl::StatusOr<std::string> Decompress(const SourceFile& file, const DicomFacts& facts,
                                       uint64_t wanted) {
  gdcm::Trace::DebugOff();
  gdcm::Trace::WarningOff();
  gdcm::Trace::ErrorOff();
  std::istringstream in(Rewritten(file, facts));
  gdcm::ImageReader reader;
  reader.SetStream(in);
  if (!reader.Read()) return Undecoded(file, "it is none that is known");
  const gdcm::Image& image = reader.GetImage();
  if (image.GetBufferLength() != wanted) {
    return Undecoded(file, absl::StrCat(image.GetBufferLength(), " bytes instead of ", wanted));
  }
  std::string pixels(wanted, '\0');
  if (!image.GetBuffer(pixels.data())) return Undecoded(file, "its pixels are not whole");
  return pixels;
}

// Appends the samples of a file that has passed its checks.
absl::Status Decode(const SourceFile& file, const DicomFacts& facts, Slice* slice,
                    std::vector<float>* out) {
  SampleCode code{.type = TypeOf(facts)};
  const std::vector<double> slope = Numbers(facts.slope), intercept = Numbers(facts.intercept);
  if (!slope.empty() && slope[0] != 0) code.slope = slope[0];
  if (!intercept.empty()) code.intercept = intercept[0];
  slice->size = {facts.columns, facts.rows, facts.frames};
  const uint64_t wanted = facts.columns * facts.rows * facts.frames * SampleBytes(code.type);
  if (facts.compressed) {
    const absl::StatusOr<std::string> pixels =
        ReadBytesContained(file, [&] { return Decompress(file, facts, wanted); });
    if (!pixels.ok()) return pixels.status();
    DecodeSamples(*pixels, code, out);
  } else {
    DecodeSamples(absl::string_view(file.bytes).substr(facts.pixels[0].first, wanted), code, out);
  }
  const std::vector<double> spacing = Numbers(facts.spacing), o = Numbers(facts.orientation),
                            thickness = Numbers(facts.slice_thickness);
  // Of rows first, which is from one row down to the next.
  if (spacing.size() == 2) slice->spacing = {spacing[1], spacing[0]};
  if (!thickness.empty()) slice->between = thickness[0];
  if (o.size() == 6) slice->right = {o[0], o[1], o[2]}, slice->down = {o[3], o[4], o[5]};
  const auto place = [&facts](size_t i) {
    return i < facts.positions.size() ? Numbers(facts.positions[i]) : std::vector<double>();
  };
  const std::vector<double> p = place(0), q = place(1);
  if (p.size() == 3) slice->origin = {p[0], p[1], p[2]};
  if (p.size() == 3 && q.size() == 3 && facts.frames > 1) {
    const double along =
        Dot(Cross(slice->right, slice->down), {q[0] - p[0], q[1] - p[1], q[2] - p[2]});
    if (along != 0) slice->between = along;
  }
  return absl::OkStatus();
}

absl::Status DecodeSafely(const SourceFile& file, const DicomFacts& facts, Slice* slice,
                          std::vector<float>* out) {
  try {
    return Decode(file, facts, slice, out);
  } catch (const std::exception& error) {
    return Undecoded(file, error.what());
  }
}

absl::StatusOr<Model> Finish(const SourceFile& file, const DicomFacts& facts, const Slice& first,
                             uint64_t depth, double between, SampledVolume volume) {
  volume.size = {static_cast<uint32_t>(first.size[0]), static_cast<uint32_t>(first.size[1]),
                 static_cast<uint32_t>(depth)};
  const auto length = [](double given) { return given != 0 && std::isfinite(given) ? given : 1; };
  const absl::Status status = PlaceVolume(
      file, first.origin,
      {Times(first.right, length(first.spacing[0])), Times(first.down, length(first.spacing[1])),
       Times(Cross(first.right, first.down), length(between))},
      &volume);
  if (!status.ok()) return status;
  const std::vector<double> center = Numbers(facts.window_center),
                            width = Numbers(facts.window_width);
  if (!center.empty() && !width.empty() && width[0] > 0) {
    volume.window = {center[0] - width[0] / 2, center[0] + width[0] / 2};
  }
  Model model;
  model.path = file.path;
  model.format = "DICOM";
  model.up = Up::kZ;
  model.volumes.push_back(std::move(volume));
  return model;
}

// A file of a series.
struct Found {
  std::string path;
  double along = 0;  // its place along the normal
  Point3 right = {1, 0, 0}, down = {0, 1, 0};
};

Found Locate(const std::string& path, const DicomFacts& facts, size_t number) {
  Found found{.path = path, .along = static_cast<double>(number)};
  const std::vector<double> o = Numbers(facts.orientation),
                            p = Numbers(facts.positions.empty() ? "" : facts.positions[0]);
  if (o.size() == 6) found.right = {o[0], o[1], o[2]}, found.down = {o[3], o[4], o[5]};
  if (o.size() == 6 && p.size() == 3) {
    found.along = Dot(Cross(found.right, found.down), {p[0], p[1], p[2]});
  }
  return found;
}

}  // namespace

absl::StatusOr<Model> ReadDicomVolume(const SourceFile& file) {
  const absl::StatusOr<DicomFacts> facts = CheckDicom(file);
  if (!facts.ok()) return facts.status();
  SampledVolume volume;
  Slice slice;
  const absl::Status status = DecodeSafely(file, *facts, &slice, &volume.samples);
  if (!status.ok()) return status;
  return Finish(file, *facts, slice, slice.size[2], slice.between, std::move(volume));
}

absl::StatusOr<Model> ReadDicomFolder(const std::string& path) {
  const SourceFile folder{.path = path, .extension = {}, .bytes = {}};
  std::vector<std::string> paths;
  std::error_code error;
  for (std::filesystem::directory_iterator at(path, error), end; !error && at != end;
       at.increment(error)) {
    std::error_code ignored;
    if (at->is_regular_file(ignored)) paths.push_back(at->path().string());
    if (paths.size() > kMostFiles) {
      return FileError(folder, absl::StrCat("has more than ", kMostFiles, " files"),
                       "a folder of one series is expected");
    }
  }
  if (error) return FileError(folder, error.message(), "a folder that can be read is expected");
  std::sort(paths.begin(), paths.end());

  std::map<std::string, std::vector<Found>> series;
  size_t others = 0;
  absl::Status refused;
  for (size_t i = 0; i < paths.size(); ++i) {
    const absl::StatusOr<SourceFile> file = ReadSourceFile(paths[i]);
    if (!file.ok() || !LooksLikeDicom(*file)) {
      ++others;
      continue;
    }
    const absl::StatusOr<DicomFacts> facts = CheckDicom(*file);
    if (!facts.ok()) {
      if (refused.ok()) refused = facts.status();
      ++others;
      continue;
    }
    series[facts->series].push_back(Locate(paths[i], *facts, i));
  }
  if (series.empty()) {
    if (!refused.ok()) return refused;
    return FileError(folder,
                     absl::StrCat("is a folder; none of its ", paths.size(), " files is DICOM"),
                     "a file, or a folder of DICOM slices, is expected");
  }
  std::vector<Found>& slices =
      std::max_element(series.begin(), series.end(), [](const auto& a, const auto& b) {
        return a.second.size() < b.second.size();
      })->second;
  std::stable_sort(slices.begin(), slices.end(),
                   [](const Found& a, const Found& b) { return a.along < b.along; });

  if (slices.size() == 1) {
    const absl::StatusOr<SourceFile> file = ReadSourceFile(slices[0].path);
    return file.ok() ? ReadDicomVolume(*file) : file.status();
  }
  SampledVolume volume;
  Slice first;
  DicomFacts first_facts;
  for (size_t i = 0; i < slices.size(); ++i) {
    const absl::StatusOr<SourceFile> file = ReadSourceFile(slices[i].path);
    if (!file.ok()) return file.status();
    const absl::StatusOr<DicomFacts> facts = CheckDicom(*file);
    if (!facts.ok()) return facts.status();
    if (i == 0) {
      const std::array<uint64_t, 3> size = {facts->columns, facts->rows, slices.size()};
      if (absl::Status status = CheckVolumeSize(folder, size); !status.ok()) return status;
    }
    Slice slice;
    if (absl::Status status = DecodeSafely(*file, *facts, &slice, &volume.samples); !status.ok())
      return status;
    if (i == 0) first = slice, first_facts = *facts;
    if (slice.size != first.size || slice.size[2] != 1 ||
        Dot(slices[i].right, slices[0].right) < 0.999 ||
        Dot(slices[i].down, slices[0].down) < 0.999) {
      return FileError(*file,
                       absl::StrCat("has ", slice.size[0], " by ", slice.size[1], " by ",
                                    slice.size[2], " pixels, or is turned against the others"),
                       absl::StrCat("single slices of ", first.size[0], " by ", first.size[1],
                                    " pixels, all alike, are expected"));
    }
  }
  std::string note;
  const double between =
      (slices.back().along - slices.front().along) / static_cast<double>(slices.size() - 1);
  for (size_t i = 1; i < slices.size() && note.empty(); ++i) {
    if (std::abs(slices[i].along - slices[i - 1].along - between) > kEven * between) {
      note = absl::StrCat(path, ": its slices are unevenly apart; shown as if they were even");
    }
  }
  const auto say = [&note, &path](const std::string& what) {
    note = note.empty() ? absl::StrCat(path, ": ", what) : absl::StrCat(note, "; ", what);
  };
  if (series.size() > 1)
    say(absl::StrCat("of its ", series.size(), " series the one with the most slices, ",
                     slices.size(), ", is shown"));
  if (others > 0) say(absl::StrCat(others, " files that hold no image are left out"));
  absl::StatusOr<Model> model =
      Finish(folder, first_facts, first, slices.size(), between, std::move(volume));
  if (model.ok()) model->note = note;
  return model;
}

}  // namespace voxeld::voxelctl
