#include "tools/voxelctl/profile/profile.h"

#include <algorithm>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "common/text/printable.h"
#include "display/drivers/options.h"
#include "display/drivers/simulated/emulated_device.h"
#include "display/drivers/usb_options.h"
#include "display/geometry/footprint.h"
#include "display/profiles/profile.h"
#include "tools/voxelctl/text/proto_json.h"

namespace voxeld::voxelctl {
namespace {

// How evenly voxels are lit in one volume: for each number of times, how many voxels are lit that
// often.
struct Evenness {
  std::map<uint64_t, uint64_t> voxels;  // by how many pixels contain them completely
  uint64_t all = 0;

  uint64_t reached() const {
    const auto none = voxels.find(0);
    return all - (none == voxels.end() ? 0 : none->second);
  }
  double Share() const { return static_cast<double>(reached()) / static_cast<double>(all); }
  // Returns the count at rank `share` among the voxels that are reached at all.
  uint64_t Quantile(double share) const {
    auto left = static_cast<double>(reached()) * share;
    for (const auto& [count, number] : voxels) {
      if (count == 0) continue;
      left -= static_cast<double>(number);
      if (left <= 0) return count;
    }
    return voxels.empty() ? 0 : voxels.rbegin()->first;
  }
};

// A table is a product of outer and inner places, by set. Returns nothing for grids that are too
// large to iterate over.
std::optional<Evenness> EvennessOf(const display::FootprintTable& table,
                                   const display::VoxelGrid& grid) {
  const size_t n[3] = {static_cast<size_t>(grid.nx), static_cast<size_t>(grid.ny),
                       static_cast<size_t>(grid.nz)};
  const auto sets = static_cast<size_t>(table.inner_sets);
  const auto axis = static_cast<size_t>(table.inner_axis);
  const bool whole = table.inner.entries.size() == 1;  // outer entries extend along all three axes
  const size_t cells = whole ? 1 : n[axis];
  constexpr uint64_t kMostPlaces = uint64_t{1} << 27, kMostVoxels = uint64_t{1} << 31;
  if (uint64_t{n[0]} * n[1] * n[2] > kMostVoxels ||
      uint64_t{n[0]} * n[1] * n[2] / cells * sets > kMostPlaces) {
    return std::nullopt;
  }
  std::vector<uint32_t> inner(sets * cells),
      outer(sets * n[0] * n[1] * n[2] / (whole ? 1 : n[axis]));
  for (size_t row = 0; row + 1 < table.inner.begin.size(); ++row) {
    for (const display::FootprintEntry& e : table.inner.list(row)) {
      const size_t at[3] = {e.x, e.y, e.z};
      if (e.weight == display::kFullWeight) {
        ++inner[row / static_cast<size_t>(table.height) * cells + (whole ? 0 : at[axis])];
      }
    }
  }
  const size_t places = outer.size() / sets;
  for (int32_t s = 0; s < table.slices; ++s) {
    uint32_t* const of_set = outer.data() + static_cast<size_t>(s % table.inner_sets) * places;
    for (int32_t u = 0; u < table.width; ++u) {
      for (const display::FootprintEntry& e : table.Outer(s, u)) {
        if (e.weight != display::kFullWeight) continue;
        size_t place = 0;
        const size_t at[3] = {e.x, e.y, e.z};
        for (size_t a = 3; a-- > 0;) {
          if (whole || a != axis) place = place * n[a] + at[a];
        }
        ++of_set[place];
      }
    }
  }
  Evenness out;
  out.all = places * cells;
  for (size_t place = 0; place < places; ++place) {
    for (size_t cell = 0; cell < cells; ++cell) {
      uint64_t count = 0;
      for (size_t set = 0; set < sets; ++set) {
        count += uint64_t{outer[set * places + place]} * inner[set * cells + cell];
      }
      ++out.voxels[count];
    }
  }
  return out;
}

const char* ShapeOf(const display::Geometry& geometry) {
  constexpr const char* kNames[] = {"planar stack", "rotor", "lattice", "helix"};
  return kNames[geometry.shape.index()];
}

// Splits the options as the daemon does: its own first, the rest is the driver's.
absl::StatusOr<display::DisplayInfo> InfoOf(const std::string& name,
                                            const display::Profile& profile) {
  display::DisplayOptions given{name, profile.driver, profile.options};
  for (const char* const key : {"view", "view_box", "gpus"}) given.options.erase(key);
  if (profile.driver.empty() || profile.driver == "simulated") {
    auto device = display::simulated::ReadEmulatedDevice(given);
    if (!device.ok()) return device.status();
    return std::move(device->info);
  }
  if (profile.driver == "voxlink") {
    display::OptionReader reader(given);
    display::ReadUsbMatch(reader);
    display::ReadUsbRecord(reader);
    return display::ReadDisplayInfo(given, reader);
  }
  return absl::InvalidArgumentError(absl::StrCat(
      name,
      ": `voxelctl profile check` checks only profiles of the drivers simulated and voxlink; the "
      "driver of this one is ",
      profile.driver, ". To check it, run: voxeld --check-config --display NAME=", profile.driver,
      ",profile=", name));
}

absl::Status List(Console& console) {
  std::map<std::string, std::string> titles;
  for (const std::string& place : display::ProfilePlaces()) {
    for (const std::string& name : display::ProfilesIn(place)) {
      const auto path = display::FindProfile(name, {place});
      const auto profile = path.ok() ? display::ReadProfile(*path) : path.status();
      titles.emplace(name, profile.ok() ? profile->title : std::string(profile.status().message()));
    }
  }
  if (console.json()) {
    nlohmann::ordered_json json = nlohmann::ordered_json::array();
    for (const auto& [name, title] : titles) json.push_back({{"name", name}, {"title", title}});
    console.Data(JsonText(json, false));
    return absl::OkStatus();
  }
  for (const auto& [name, title] : titles) {
    console.Data(absl::StrCat(EscapeForTerminal(name), ": ", EscapeForTerminal(title), "\n"));
  }
  if (titles.empty())
    console.Say(
        "no profile is installed; VOXELD_PROFILES names a folder of some, in a clone "
        "display/profiles");
  return absl::OkStatus();
}

}  // namespace

std::vector<std::string> ProfileNames() {
  std::vector<std::string> names;
  for (const std::string& place : display::ProfilePlaces()) {
    for (std::string& name : display::ProfilesIn(place)) names.push_back(std::move(name));
  }
  return names;
}

absl::Status ShowProfile(const ProfileOptions& options, Console& console) {
  if (options.list) return List(console);
  const absl::StatusOr<display::Profile> profile = display::LoadProfile(options.profile);
  if (!profile.ok()) return profile.status();
  absl::StatusOr<display::DisplayInfo> info = InfoOf(options.profile, *profile);
  if (!info.ok()) return info.status();

  const display::FootprintTable table =
      display::BuildFootprints(info->geometry, info->tone.sampling);
  const std::optional<Evenness> even = EvennessOf(table, info->geometry.grid);
  const display::VoxelGrid& grid = info->geometry.grid;
  const display::FrameLayout& layout = info->layout;
  const uint64_t table_bytes =
      (table.outer.entries.size() + table.inner.entries.size()) * sizeof(display::FootprintEntry) +
      (table.outer.begin.size() + table.inner.begin.size()) * sizeof(uint32_t);
  const double link = static_cast<double>(layout.bytes()) * info->volumes_per_second;
  if (console.json()) {
    nlohmann::ordered_json json = {
        {"title", profile->title},
        {"shape", ShapeOf(info->geometry)},
        {"slices", layout.slices},
        {"width", layout.width},
        {"height", layout.height},
        {"sub_frames", layout.sub_frames},
        {"voxels", {grid.nx, grid.ny, grid.nz}},
        {"pitch_mm", {grid.pitch_mm.x, grid.pitch_mm.y, grid.pitch_mm.z}},
        {"volume_bytes", layout.bytes()},
        {"bytes_per_second", link},
        {"table_bytes", table_bytes}};
    if (even) {
      json["reachable_share"] = even->Share();
      json["lit_per_volume"] = {{"least", even->Quantile(0)},
                                {"median", even->Quantile(0.5)},
                                {"most", even->Quantile(1)}};
    }
    console.Data(JsonText(json, false));
    return absl::OkStatus();
  }
  if (!profile->title.empty()) console.Data(absl::StrCat(EscapeForTerminal(profile->title), "\n"));
  console.Data(
      absl::StrFormat("  %s: %d slices of %dx%d pixels, %d in a volume, %.4g volumes a second\n"
                      "  %dx%dx%d voxels of %.4gx%.4gx%.4g mm, %.4gx%.4gx%.4g mm in all\n",
                      ShapeOf(info->geometry), layout.slices, layout.width, layout.height,
                      layout.pictures(), info->volumes_per_second, grid.nx, grid.ny, grid.nz,
                      grid.pitch_mm.x, grid.pitch_mm.y, grid.pitch_mm.z, grid.nx * grid.pitch_mm.x,
                      grid.ny * grid.pitch_mm.y, grid.nz * grid.pitch_mm.z));
  if (even) {
    console.Data(absl::StrFormat(
        "  %.1f %% of them reached; a voxel is lit %d to %d times in a volume, half of them up to "
        "%d\n",
        100 * even->Share(), even->Quantile(0), even->Quantile(1), even->Quantile(0.5)));
  }
  console.Data(absl::StrFormat("  %d bytes a volume, %.4g MB/s; %.4g MB of footprints\n",
                               layout.bytes(), link / 1e6, static_cast<double>(table_bytes) / 1e6));
  return absl::OkStatus();
}

}  // namespace voxeld::voxelctl
