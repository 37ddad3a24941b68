// DICOM: which slices there are, and where they lie.
#include "tools/import/dicom_volume.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <map>
#include <optional>
#include <system_error>
#include <utility>
#include <vector>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "tools/import/dicom_check.h"
#include "tools/import/dicom_pixels.h"
#include "tools/import/volume_samples.h"

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

// Where a file's pixels lie.
Slice Locate(const DicomFacts& facts) {
  Slice slice;
  slice.size = {facts.columns, facts.rows, facts.frames};
  const std::vector<double> spacing = DicomNumbers(facts.spacing),
                            o = DicomNumbers(facts.orientation),
                            thickness = DicomNumbers(facts.slice_thickness),
                            apart = DicomNumbers(facts.slices_apart),
                            offsets = DicomNumbers(facts.frame_offsets);
  // Of rows first, which is from one row down to the next.
  if (spacing.size() == 2) slice.spacing = {spacing[1], spacing[0]};
  if (!thickness.empty()) slice.between = thickness[0];
  if (!apart.empty()) slice.between = apart[0];
  if (offsets.size() > 1) slice.between = offsets[1] - offsets[0];
  if (o.size() == 6) slice.right = {o[0], o[1], o[2]}, slice.down = {o[3], o[4], o[5]};
  const auto place = [&facts](size_t i) {
    return i < facts.positions.size() ? DicomNumbers(facts.positions[i]) : std::vector<double>();
  };
  const std::vector<double> p = place(0), q = place(1);
  if (p.size() == 3) slice.origin = {p[0], p[1], p[2]};
  if (p.size() == 3 && q.size() == 3 && facts.frames > 1) {
    const double along =
        Dot(Cross(slice.right, slice.down), {q[0] - p[0], q[1] - p[1], q[2] - p[2]});
    if (along != 0) slice.between = along;
  }
  return slice;
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
  const std::vector<double> center = DicomNumbers(facts.window_center),
                            width = DicomNumbers(facts.window_width);
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

// The file, without compression of the whole.
absl::StatusOr<SourceFile> ReadPlain(const std::string& path) {
  absl::StatusOr<SourceFile> file = ReadSourceFile(path);
  if (!file.ok()) return file;
  absl::StatusOr<std::optional<SourceFile>> inflated = InflateDicom(*file);
  if (!inflated.ok()) return inflated.status();
  return *inflated ? **std::move(inflated) : file;
}

Found LocateSlice(const std::string& path, const DicomFacts& facts, size_t number) {
  Found found{.path = path, .along = static_cast<double>(number)};
  const std::vector<double> o = DicomNumbers(facts.orientation),
                            p = DicomNumbers(facts.positions.empty() ? "" : facts.positions[0]);
  if (o.size() == 6) found.right = {o[0], o[1], o[2]}, found.down = {o[3], o[4], o[5]};
  if (o.size() == 6 && p.size() == 3) {
    found.along = Dot(Cross(found.right, found.down), {p[0], p[1], p[2]});
  }
  return found;
}

}  // namespace

absl::StatusOr<Model> ReadDicomVolume(const SourceFile& file) {
  const absl::StatusOr<std::optional<SourceFile>> inflated = InflateDicom(file);
  if (!inflated.ok()) return inflated.status();
  const SourceFile& plain = *inflated ? **inflated : file;
  const absl::StatusOr<DicomFacts> facts = CheckDicom(plain);
  if (!facts.ok()) return facts.status();
  SampledVolume volume;
  if (absl::Status status = DecodeDicomPixels(plain, *facts, &volume); !status.ok()) return status;
  const Slice slice = Locate(*facts);
  return Finish(plain, *facts, slice, slice.size[2], slice.between, std::move(volume));
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
    const absl::StatusOr<SourceFile> file = ReadPlain(paths[i]);
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
    series[facts->series].push_back(LocateSlice(paths[i], *facts, i));
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
    const absl::StatusOr<SourceFile> file = ReadPlain(slices[i].path);
    if (!file.ok()) return file.status();
    const absl::StatusOr<DicomFacts> facts = CheckDicom(*file);
    if (!facts.ok()) return facts.status();
    if (i == 0) {
      const std::array<uint64_t, 3> size = {facts->columns, facts->rows, slices.size()};
      if (absl::Status status = CheckVolumeSize(folder, size); !status.ok()) return status;
    }
    const Slice slice = Locate(*facts);
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
    if (absl::Status status = DecodeDicomPixels(*file, *facts, &volume); !status.ok())
      return status;
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
