// Reads DICOM: finds the slices and where they are.

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <optional>
#include <string>
#include <system_error>
#include <type_traits>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "tools/import/dicom_check.h"
#include "tools/import/volume_samples.h"
#include "tools/import/volumes.h"
#include "tools/voxelctl/import/surface_builder.h"

namespace voxeld::voxelctl {
namespace {

constexpr size_t kMostFiles = 20'000;
// How far, as a share of their distance, slices may be displaced without a note.
constexpr double kEven = 0.1;
// Share of the mean distance: slices closer than this are at the same place.
constexpr double kAlike = 1e-3;
constexpr double kSameDirection = 0.999;  // the least cosine between two directions

Point3 Cross(const Point3& a, const Point3& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
Point3 Times(const Point3& p, double by) { return {p.x * by, p.y * by, p.z * by}; }
Point3 Less(const Point3& a, const Point3& b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }

std::optional<Point3> PlaceOf(const std::string& text) {
  const std::vector<double> p = DicomNumbers(text);
  if (p.size() != 3) return std::nullopt;
  return Point3{p[0], p[1], p[2]};
}

// Where a file's pixels are in space.
struct Slice {
  std::array<uint64_t, 3> size = {1, 1, 1};
  uint64_t channels = 1;
  std::array<double, 2> spacing = {1, 1};
  double between = 1;  // frames
  Point3 right = {1, 0, 0}, down = {0, 1, 0};
  std::vector<Point3> places;  // of the frames; empty if unknown

  Point3 Normal() const { return Cross(right, down); }
};

Slice Locate(const DicomFacts& facts) {
  Slice slice;
  slice.size = {facts.columns, facts.rows, facts.frames};
  slice.channels = facts.samples_per_pixel;
  std::vector<double> spacing;
  for (const std::string* text :
       {&facts.spacing, &facts.detector_spacing, &facts.film_spacing, &facts.aspect}) {
    if (spacing.size() != 2) spacing = DicomNumbers(*text);
  }
  const std::vector<double> o = DicomNumbers(facts.orientation),
                            thickness = DicomNumbers(facts.slice_thickness),
                            apart = DicomNumbers(facts.slices_apart),
                            offsets = DicomNumbers(facts.frame_offsets);
  // The spacing of rows comes first: the distance from one row down to the next.
  if (spacing.size() == 2) slice.spacing = {spacing[1], spacing[0]};
  if (!thickness.empty()) slice.between = thickness[0];
  if (!apart.empty()) slice.between = apart[0];
  if (offsets.size() > 1)
    slice.between = (offsets.back() - offsets[0]) / static_cast<double>(offsets.size() - 1);
  if (o.size() == 6) slice.right = {o[0], o[1], o[2]}, slice.down = {o[3], o[4], o[5]};
  // The positions of the frames are the last ones in the file; some programs write a common one
  // before them.
  const size_t before = facts.frames > 1 && facts.positions.size() > facts.frames
                            ? facts.positions.size() - facts.frames
                            : 0;
  for (size_t i = before; i < facts.positions.size(); ++i) {
    const std::optional<Point3> place = PlaceOf(facts.positions[i]);
    if (!place) break;
    slice.places.push_back(*place);
  }
  if (slice.places.size() < facts.frames)
    slice.places.resize(std::min<size_t>(slice.places.size(), 1));
  return slice;
}

// Returns a place along the normal; 0 if it is too far away to be represented.
double Along(const Slice& slice, const Point3& place) {
  const double along = Dot(slice.Normal(), place);
  return std::isfinite(along) ? along : 0;
}

// One layer of a volume: a frame, or a file's slice.
struct Layer {
  size_t number = 0;  // of the frame or file
  Point3 place;
  double along = 0;  // position along the normal
  std::vector<double> time;
};

// Returns whether frames without positions differ in time or another property, and not in their position.
bool AreAlternatives(const DicomFacts& facts) {
  constexpr uint32_t kSliceOrder = 0x00540080, kDoseOffsets = 0x3004000C;
  return !facts.frame_axes.empty() &&
         std::none_of(facts.frame_axes.begin(), facts.frame_axes.end(), [](uint32_t element) {
           return element == kSliceOrder || element == kDoseOffsets;
         });
}

// Puts layers into the order in which they lie. Of those at one place the first in time stays.
// Returns: how many times there are, less one.
size_t SortLayers(std::vector<Layer>* layers) {
  const auto [least, most] =
      std::minmax_element(layers->begin(), layers->end(),
                          [](const Layer& a, const Layer& b) { return a.along < b.along; });
  const double alike = kAlike * (most->along - least->along) / static_cast<double>(layers->size());
  std::stable_sort(layers->begin(), layers->end(),
                   [](const Layer& a, const Layer& b) { return a.along < b.along; });
  std::vector<Layer> kept;
  size_t most_times = 1;
  for (auto from = layers->begin(); from != layers->end();) {
    auto end = from + 1;
    while (end != layers->end() && end->along - from->along <= alike) ++end;
    kept.push_back(*std::min_element(from, end, [](const Layer& a, const Layer& b) {
      return a.time != b.time ? a.time < b.time : a.number < b.number;
    }));
    most_times = std::max(most_times, static_cast<size_t>(end - from));
    from = end;
  }
  *layers = std::move(kept);
  return most_times - 1;
}

// Returns: the step from one layer to the next, which a tilted gantry shears. Sets `note` if the
// layers are not evenly spaced.
Point3 StepOf(const std::vector<Layer>& layers, const Slice& first, std::string* note) {
  const double count = static_cast<double>(layers.size() - 1);
  if (layers.size() > 1) {
    const double between = (layers.back().along - layers.front().along) / count;
    double nearest = between, farthest = between;
    for (size_t i = 1; i < layers.size(); ++i) {
      const double apart = layers[i].along - layers[i - 1].along;
      nearest = std::min(nearest, apart);
      farthest = std::max(farthest, apart);
    }
    if (farthest - nearest > kEven * std::abs(between))
      *note = absl::StrCat("its slices are unevenly apart (", nearest, " to ", farthest,
                           "); shown as if they were even");
    const Point3 step = Times(Less(layers.back().place, layers.front().place), 1 / count);
    if (std::abs(Dot(step, first.Normal())) > 1e-6 * std::sqrt(Dot(step, step))) return step;
  }
  const double between = first.between != 0 && std::isfinite(first.between) ? first.between : 1;
  return Times(first.Normal(), between);
}

// MONOCHROME1 stores white as the smallest value. Inverts the values within the window, or within
// their range without one.
void TurnRound(SampledVolume* volume) {
  double sum = 0;
  if (volume->window) {
    sum = (*volume->window)[0] + (*volume->window)[1];
  } else {
    const auto [least, most] = std::minmax_element(volume->samples.begin(), volume->samples.end());
    if (least == volume->samples.end()) return;
    sum = double{*least} + double{*most};
  }
  for (float& sample : volume->samples) sample = static_cast<float>(sum - double{sample});
}

absl::StatusOr<Model> Finish(const SourceFile& file, const DicomFacts& facts, const Slice& first,
                             const Point3& origin, uint64_t depth, const Point3& step,
                             SampledVolume volume) {
  volume.size = {static_cast<uint32_t>(first.size[0]), static_cast<uint32_t>(first.size[1]),
                 static_cast<uint32_t>(depth)};
  const auto length = [](double given) { return given != 0 && std::isfinite(given) ? given : 1; };
  const absl::Status status = PlaceVolume(file, origin,
                                          {Times(first.right, length(first.spacing[0])),
                                           Times(first.down, length(first.spacing[1])), step},
                                          &volume);
  if (!status.ok()) return status;
  const std::vector<double> center = DicomNumbers(facts.window_center),
                            width = DicomNumbers(facts.window_width);
  if (!center.empty() && !width.empty() && width[0] > 0) {
    volume.window = {center[0] - width[0] / 2, center[0] + width[0] / 2};
  }
  if (facts.photometric == "MONOCHROME1") TurnRound(&volume);
  Model model;
  AddLeftOut("tables for displays", volume.window ? 0 : facts.display_tables, &model);
  model.path = file.path;
  model.format = "DICOM";
  model.up = Up::kZ;
  model.volumes.push_back(std::move(volume));
  return model;
}

// Keeps the frames that `layers` names, in their order.
void PickFrames(const std::vector<Layer>& layers, size_t frame, SampledVolume* volume) {
  const auto pick = [&](auto* values) {
    std::remove_reference_t<decltype(*values)> picked;
    if (values->empty()) return;
    picked.reserve(layers.size() * frame);
    for (const Layer& layer : layers) {
      const auto from = values->begin() + static_cast<std::ptrdiff_t>(layer.number * frame);
      picked.insert(picked.end(), from, from + static_cast<std::ptrdiff_t>(frame));
    }
    *values = std::move(picked);
  };
  pick(&volume->samples);
  pick(&volume->colors);
}

// Returns the file with its preamble, and without compression of the whole file.
absl::StatusOr<SourceFile> ReadPlain(const std::string& path) {
  absl::StatusOr<SourceFile> file = ReadSourceFile(path);
  if (!file.ok()) return file;
  absl::StatusOr<std::optional<SourceFile>> plain = PlainDicom(*file);
  if (!plain.ok()) return plain.status();
  return *plain ? **std::move(plain) : file;
}

// The slices of one series that have the same size and direction, or one file of several frames.
struct Stack {
  std::string series;
  Slice first;
  std::vector<std::string> paths;
  std::vector<Layer> layers;

  uint64_t Slices() const { return first.size[2] > 1 ? first.size[2] : layers.size(); }
  bool Takes(const std::string& other_series, const Slice& other) const {
    return series == other_series && first.size[2] == 1 && first.size == other.size &&
           first.channels == other.channels && first.places.empty() == other.places.empty() &&
           Dot(first.right, other.right) > kSameDirection &&
           Dot(first.down, other.down) > kSameDirection;
  }
};

void AddSlice(const std::string& path, const DicomFacts& facts, std::vector<Stack>* stacks) {
  const Slice slice = Locate(facts);
  auto stack = std::find_if(stacks->begin(), stacks->end(),
                            [&](const Stack& one) { return one.Takes(facts.series, slice); });
  if (stack == stacks->end()) {
    stacks->push_back({.series = facts.series, .first = slice, .paths = {}, .layers = {}});
    stack = stacks->end() - 1;
  }
  Layer layer{.number = stack->paths.size(), .place = {}, .along = 0, .time = {}};
  for (const std::string& text : facts.times) {
    const std::vector<double> number = DicomNumbers(text);
    layer.time.push_back(number.empty() ? 0 : number[0]);
  }
  // Without positions, slices are sorted by instance numbers or otherwise by name.
  layer.along = static_cast<double>(layer.number);
  if (slice.places.empty()) {
    layer.place = Times(stack->first.Normal(), layer.along * slice.between);
  } else {
    layer.place = slice.places[0];
    layer.along = Along(stack->first, layer.place);
  }
  stack->paths.push_back(path);
  stack->layers.push_back(std::move(layer));
}

// Instance numbers order slices without positions.
void OrderByInstance(Stack* stack) {
  if (!stack->first.places.empty()) return;
  std::stable_sort(stack->layers.begin(), stack->layers.end(),
                   [](const Layer& a, const Layer& b) { return a.time.back() < b.time.back(); });
  for (size_t i = 0; i < stack->layers.size(); ++i) {
    Layer& layer = stack->layers[i];
    layer.along = static_cast<double>(i);
    layer.place = Times(stack->first.Normal(), layer.along * stack->first.between);
  }
}

absl::StatusOr<Model> ReadStack(const SourceFile& folder, Stack* stack) {
  if (stack->paths.size() == 1) {
    const absl::StatusOr<SourceFile> file = ReadSourceFile(stack->paths[0]);
    return file.ok() ? ReadDicomVolume(*file) : file.status();
  }
  OrderByInstance(stack);
  const size_t further_times = SortLayers(&stack->layers);
  const std::vector<Layer>& layers = stack->layers;
  const Slice& first = stack->first;
  const absl::Status status =
      CheckVolumeSize(folder, {first.size[0], first.size[1], layers.size()});
  if (!status.ok()) return status;
  SampledVolume volume;
  volume.samples.reserve(first.size[0] * first.size[1] * layers.size());
  DicomFacts first_facts;
  uint64_t overlays = 0;
  for (const Layer& layer : layers) {
    const absl::StatusOr<SourceFile> file = ReadPlain(stack->paths[layer.number]);
    if (!file.ok()) return file.status();
    const absl::StatusOr<DicomFacts> facts = CheckDicom(*file);
    if (!facts.ok()) return facts.status();
    // The file was read before, and may have changed since.
    if (!stack->Takes(facts->series, Locate(*facts)))
      return FileError(*file, "has changed since it was read first", "read it again");
    if (&layer == &layers[0]) first_facts = *facts;
    overlays += facts->overlays;
    if (absl::Status decoded = DecodeDicomPixels(*file, *facts, &volume); !decoded.ok())
      return decoded;
  }
  std::string note;
  const Point3 step = StepOf(layers, first, &note);
  absl::StatusOr<Model> model =
      Finish(folder, first_facts, first, layers[0].place, layers.size(), step, std::move(volume));
  if (!model.ok()) return model;
  AddLeftOut("further times", further_times, &*model);
  AddLeftOut("overlays", overlays, &*model);
  if (!note.empty()) model->note = absl::StrCat(folder.path, ": ", note);
  return model;
}

}  // namespace

absl::StatusOr<Model> ReadDicomVolume(const SourceFile& file) {
  const absl::StatusOr<std::optional<SourceFile>> changed = PlainDicom(file);
  if (!changed.ok()) return changed.status();
  const SourceFile& plain = *changed ? **changed : file;
  const absl::StatusOr<DicomFacts> facts = CheckDicom(plain);
  if (!facts.ok()) return facts.status();
  SampledVolume volume;
  if (absl::Status status = DecodeDicomPixels(plain, *facts, &volume); !status.ok()) return status;
  const Slice slice = Locate(*facts);
  uint64_t depth = slice.size[2];
  Point3 origin = slice.places.empty() ? Point3{} : slice.places[0];
  Point3 step = StepOf({}, slice, nullptr);
  size_t further_times = 0;
  std::string note;
  const bool has_places = slice.places.size() >= depth,
             has_order = !has_places && facts->slice_order.size() == depth;
  if (depth > 1 && !has_places && AreAlternatives(*facts)) {
    further_times = depth - 1;
    depth = 1;
    PickFrames({Layer{}}, slice.size[0] * slice.size[1], &volume);
  } else if (depth > 1 && (has_places || has_order)) {
    std::vector<Layer> layers;
    for (size_t i = 0; i < depth; ++i) {
      const double along = has_order ? facts->slice_order[i] * std::abs(slice.between) : 0;
      const Point3 place = has_places ? slice.places[i]
                                      : Point3{origin.x + slice.Normal().x * along,
                                               origin.y + slice.Normal().y * along,
                                               origin.z + slice.Normal().z * along};
      layers.push_back({.number = i, .place = place, .along = Along(slice, place), .time = {}});
    }
    further_times = SortLayers(&layers);
    step = StepOf(layers, slice, &note);
    origin = layers[0].place;
    depth = layers.size();
    PickFrames(layers, slice.size[0] * slice.size[1], &volume);
  }
  absl::StatusOr<Model> model =
      Finish(plain, *facts, slice, origin, depth, step, std::move(volume));
  if (!model.ok()) return model;
  AddLeftOut("further times", further_times, &*model);
  AddLeftOut("overlays", facts->overlays, &*model);
  if (!note.empty()) model->note = absl::StrCat(file.path, ": ", note);
  return model;
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

  std::vector<Stack> stacks;
  size_t others = 0;
  absl::Status refused;
  for (const std::string& one : paths) {
    const absl::StatusOr<SourceFile> file = ReadPlain(one);
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
    AddSlice(one, *facts, &stacks);
  }
  if (stacks.empty()) {
    if (!refused.ok()) return refused;
    return FileError(folder,
                     absl::StrCat("is a folder; none of its ", paths.size(), " files is DICOM"),
                     "a file, or a folder of DICOM slices, is expected");
  }
  const auto shown =
      std::max_element(stacks.begin(), stacks.end(),
                       [](const Stack& a, const Stack& b) { return a.Slices() < b.Slices(); });
  Model left;
  for (const Stack& stack : stacks) {
    if (&stack == &*shown) continue;
    AddLeftOut(stack.series == shown->series ? "slices of another size or direction"
                                             : "slices of other series",
               stack.Slices(), &left);
  }
  AddLeftOut("files without an image", others, &left);
  absl::StatusOr<Model> model = ReadStack(folder, &*shown);
  if (!model.ok()) return model;
  for (const LeftOut& one : left.left_out) AddLeftOut(one.kind, one.count, &*model);
  return model;
}

}  // namespace voxeld::voxelctl
