#include "display/drivers/wiring/wiring.h"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <iterator>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <tuple>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "common/json/bounded_json.h"
#include "common/json/json_depth.h"
#include "display/geometry/footprint.h"

namespace voxeld::display::wiring {
namespace {

using Json = nlohmann::json;

constexpr double kMostMm = 1e6;
constexpr size_t kMostLayoutBytes = size_t{16} << 20;

Lattice EmptyLattice(const PixelNumbers& pixels, double pitch_mm) {
  Lattice lattice;
  lattice.width_px = pixels.a_slice;
  lattice.points_mm.resize(static_cast<size_t>(pixels.count()));
  lattice.cell_mm = {pitch_mm, pitch_mm, pitch_mm};
  return lattice;
}

// Returns the place of the chain's `index`-th light before the cube is flipped and turned.
std::array<int32_t, 3> PlaceOf(const CubeWiring& wiring, int32_t index) {
  const auto along = [&](int n) { return wiring.size[static_cast<size_t>(wiring.order[n])]; };
  int32_t fast = index % along(0);
  const int32_t row = index / along(0);  // row in the whole chain
  int32_t middle = row % along(1);
  const int32_t slow = row / along(1);
  const bool rows = wiring.serpentine != CubeWiring::Serpentine::kNone;
  const bool slices = wiring.serpentine == CubeWiring::Serpentine::kRowsAndSlices;
  if (rows && (slices ? row : middle) % 2 == 1) fast = along(0) - 1 - fast;
  if (slices && slow % 2 == 1) middle = along(1) - 1 - middle;
  std::array<int32_t, 3> place{};
  place[static_cast<size_t>(wiring.order[0])] = fast;
  place[static_cast<size_t>(wiring.order[1])] = middle;
  place[static_cast<size_t>(wiring.order[2])] = slow;
  return place;
}

Vec3 PointOf(const CubeWiring& wiring, std::array<int32_t, 3> place, double pitch_mm) {
  std::array<double, 3> at{};
  for (size_t axis = 0; axis < 3; ++axis) {
    const int32_t n = wiring.size[axis];
    const int32_t from = wiring.flip[axis] ? n - 1 - place[axis] : place[axis];
    at[axis] = (from - (n - 1) / 2.0) * pitch_mm;
  }
  for (int turn = 0; turn < wiring.quarter_turns; ++turn) {
    at = {0 - at[1], at[0], at[2]};
  }
  return {at[0], at[1], at[2]};
}

absl::Status BadEntry(size_t index, const Json& entry, const std::string& what) {
  std::string text = entry.dump(-1, ' ', true, Json::error_handler_t::replace);
  if (text.size() > 60) text = text.substr(0, 60) + "…";
  return absl::InvalidArgumentError(absl::StrCat("entry ", index, " is ", text, "; ", what));
}

absl::StatusOr<std::optional<Vec3>> ParsePoint(size_t index, const Json& entry, double pitch_mm) {
  if (entry.is_null() || (entry.is_object() && entry.empty())) return std::nullopt;
  const auto point = entry.is_object() ? entry.find("point") : entry.end();
  if (!entry.is_object() || point == entry.end() || !point->is_array() || point->size() != 3) {
    return BadEntry(index, entry,
                    "it must be {\"point\": [x, y, z]}, or null where there is no light");
  }
  std::array<double, 3> at{};
  for (size_t axis = 0; axis < 3; ++axis) {
    const Json& number = (*point)[axis];
    at[axis] = number.is_number() ? number.get<double>() * pitch_mm : HUGE_VAL;
    if (!(std::abs(at[axis]) <= kMostMm)) {
      return BadEntry(
          index, entry,
          absl::StrCat("x, y and z must be numbers that make at most ", kMostMm, " mm"));
    }
  }
  return Vec3{at[0], at[1], at[2]};
}

absl::Status Centre(Lattice& lattice) {
  Vec3 low{HUGE_VAL, HUGE_VAL, HUGE_VAL}, high{-HUGE_VAL, -HUGE_VAL, -HUGE_VAL};
  std::map<std::tuple<double, double, double>, size_t> seen;
  for (size_t i = 0; i < lattice.points_mm.size(); ++i) {
    if (!lattice.points_mm[i].has_value()) continue;
    const Vec3& p = *lattice.points_mm[i];
    const auto [first, fresh] = seen.emplace(std::tuple(p.x, p.y, p.z), i);
    if (!fresh) {
      return absl::InvalidArgumentError(
          absl::StrCat("entries ", first->second, " and ", i, " are both at ", p.x, ", ", p.y, ", ",
                       p.z, " mm; each light must have a place of its own"));
    }
    low = {std::min(low.x, p.x), std::min(low.y, p.y), std::min(low.z, p.z)};
    high = {std::max(high.x, p.x), std::max(high.y, p.y), std::max(high.z, p.z)};
  }
  if (seen.empty()) return absl::InvalidArgumentError("there is no light; there must be one");
  for (std::optional<Vec3>& point : lattice.points_mm) {
    if (!point.has_value()) continue;
    point->x -= (low.x + high.x) / 2;
    point->y -= (low.y + high.y) / 2;
    point->z -= (low.z + high.z) / 2;
  }
  return absl::OkStatus();
}

absl::StatusOr<std::string> ReadFile(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  if (!file.is_open()) return absl::InvalidArgumentError("it cannot be opened");
  std::string text(kMostLayoutBytes + 1, '\0');
  file.read(text.data(), static_cast<std::streamsize>(text.size()));
  if (file.bad()) return absl::InvalidArgumentError("it cannot be read");
  text.resize(static_cast<size_t>(file.gcount()));
  if (text.size() > kMostLayoutBytes) {
    return absl::InvalidArgumentError(
        absl::StrCat("it has more than ", kMostLayoutBytes, " bytes"));
  }
  return text;
}

// Reads an order of the three axes: "xyz".
void ReadOrder(OptionReader& reader, CubeWiring& wiring) {
  const std::string text = reader.Text("order", "xyz");
  std::string sorted = text;
  std::sort(sorted.begin(), sorted.end());
  if (sorted != "xyz") {
    return reader.Refuse("order", "x, y and z in some order, the one that runs fastest first");
  }
  for (size_t i = 0; i < 3; ++i) wiring.order[i] = text[i] - 'x';
}

void ReadFlip(OptionReader& reader, CubeWiring& wiring) {
  const std::string text = reader.Text("flip", "");
  if (text.empty()) return;
  for (const std::string& axis : std::vector<std::string>(absl::StrSplit(text, ';'))) {
    if (axis.size() != 1 || axis[0] < 'x' || axis[0] > 'z' ||
        std::exchange(wiring.flip[static_cast<size_t>(axis[0] - 'x')], true)) {
      return reader.Refuse("flip", "axes of x, y and z, each once, with ';' between them");
    }
  }
}

CubeWiring ReadWiring(OptionReader& reader, const PixelNumbers& pixels) {
  CubeWiring wiring;
  const std::vector<int32_t> size = reader.Size("cube", {8, 8, 8}, 3, 3);
  std::copy(size.begin(), size.end(), wiring.size.begin());
  ReadOrder(reader, wiring);
  wiring.serpentine = static_cast<CubeWiring::Serpentine>(
      reader.Choice("serpentine", {"none", "rows", "rows_and_slices"}, 0));
  wiring.reverse = reader.Flag("reverse", false);
  ReadFlip(reader, wiring);
  wiring.quarter_turns = static_cast<int>(reader.Choice("rotate", {"0", "90", "180", "270"}, 0));
  wiring.per_strip =
      static_cast<int32_t>(reader.Integer("per_strip", pixels.a_strip, 1, pixels.a_strip));
  wiring.first = static_cast<int32_t>(reader.Integer("first", 0, 0, pixels.count() - 1));
  return wiring;
}

}  // namespace

absl::StatusOr<Lattice> CubeLattice(const CubeWiring& wiring, const PixelNumbers& numbers,
                                    double pitch_mm) {
  Lattice lattice = EmptyLattice(numbers, pitch_mm);
  const int64_t lights = int64_t{wiring.size[0]} * wiring.size[1] * wiring.size[2];
  const auto pixel_of = [&](int64_t light) {
    return wiring.first + light / wiring.per_strip * static_cast<int64_t>(numbers.a_strip) +
           light % wiring.per_strip;
  };
  const auto pixels = static_cast<int64_t>(lattice.points_mm.size());
  if (pixel_of(lights - 1) >= pixels) {
    return absl::InvalidArgumentError(
        absl::StrCat("a cube of ", wiring.size[0], "x", wiring.size[1], "x", wiring.size[2],
                     " lights, ", wiring.per_strip, " on a strip, from pixel ", wiring.first,
                     " on, ends at pixel ", pixel_of(lights - 1), "; the last one there is, with ",
                     numbers.a_slice, " a ", numbers.unit, ", is ", pixels - 1));
  }
  for (int64_t light = 0; light < lights; ++light) {
    const int64_t index = wiring.reverse ? lights - 1 - light : light;
    lattice.points_mm[static_cast<size_t>(pixel_of(light))] =
        PointOf(wiring, PlaceOf(wiring, static_cast<int32_t>(index)), pitch_mm);
  }
  return lattice;
}

absl::StatusOr<Lattice> ParseLayout(std::string_view json, const PixelNumbers& numbers,
                                    double pitch_mm) {
  if (const int depth = JsonDepth(json); depth > kMaxJsonDepth) {
    return absl::InvalidArgumentError(absl::StrCat("its arrays and objects are nested ", depth,
                                                   " levels deep; at most ", kMaxJsonDepth,
                                                   " are allowed"));
  }
  const Json entries = ParseBoundedJson(json);
  if (!entries.is_array()) {
    return absl::InvalidArgumentError(
        entries.is_discarded() ? "it is not JSON, or has a number beyond all bounds"
                               : "it is not an array; it must be one, with an entry a pixel");
  }
  Lattice lattice = EmptyLattice(numbers, pitch_mm);
  if (entries.size() > lattice.points_mm.size()) {
    return absl::InvalidArgumentError(
        absl::StrCat("it has ", entries.size(), " entries; there are ", lattice.points_mm.size(),
                     " pixels, ", numbers.a_slice, " a ", numbers.unit));
  }
  for (size_t i = 0; i < entries.size(); ++i) {
    absl::StatusOr<std::optional<Vec3>> point = ParsePoint(i, entries[i], pitch_mm);
    if (!point.ok()) return point.status();
    lattice.points_mm[i] = *point;
  }
  absl::Status status = Centre(lattice);
  if (!status.ok()) return status;
  return lattice;
}

absl::StatusOr<Lattice> ReadLattice(OptionReader& reader, const PixelNumbers& numbers) {
  const double pitch = reader.Number("pitch_mm", 1, 1e-6, kMostMm);
  const std::vector<double> cell = reader.Numbers("cell_mm");
  if (!cell.empty() && cell.size() != 1 && cell.size() != 3) {
    reader.Refuse("cell_mm", "one length, or three with ';' between them");
  }
  if (std::any_of(cell.begin(), cell.end(), [](double length) { return !(length >= 1e-6); })) {
    reader.Refuse("cell_mm", "lengths of at least 1e-06");
  }
  absl::StatusOr<Lattice> lattice;
  if (const std::string path = reader.Text("layout", ""); !path.empty()) {
    if (reader.has("cube")) reader.Refuse("cube", "left out where there is a layout");
    absl::StatusOr<std::string> json = ReadFile(path);
    lattice = json.ok() ? ParseLayout(*json, numbers, pitch) : json.status();
    if (!lattice.ok()) {
      return absl::InvalidArgumentError(
          absl::StrCat("layout \"", path, "\": ", lattice.status().message()));
    }
  } else {
    lattice = CubeLattice(ReadWiring(reader, numbers), numbers, pitch);
    if (!lattice.ok()) return lattice.status();
  }
  if (!cell.empty()) lattice->cell_mm = {cell[0], cell[cell.size() / 2], cell.back()};
  return lattice;
}

absl::Status TakeLattice(DisplayInfo& info, absl::StatusOr<Lattice> lattice) {
  absl::Status status = lattice.status();
  if (status.ok()) {
    info.geometry.shape = *std::move(lattice);
    status = ValidateShape(info.geometry);
  }
  if (status.ok()) {
    info.geometry.grid = DefaultGrid(info.geometry);
    status = ValidateGeometry(info.geometry);
  }
  if (status.ok()) return status;
  return absl::InvalidArgumentError(
      absl::StrCat("display \"", info.name, "\": ", status.message()));
}

}  // namespace voxeld::display::wiring
