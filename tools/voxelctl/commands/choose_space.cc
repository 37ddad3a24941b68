#include "tools/voxelctl/commands/choose_space.h"

#include <algorithm>
#include <climits>
#include <optional>
#include <span>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "common/text/printable.h"
#include "tools/voxelctl/commands/not_showing.h"

namespace voxeld::voxelctl {
namespace {

// Returns the space that all of `displays` show, or the first one's if they have none in common.
absl::StatusOr<Room> CommonRoom(std::span<const v1::DisplayDescription* const> displays) {
  std::optional<DisplaySpace> common;
  int least_side = INT_MAX;
  std::array<uint32_t, 2> voxels = {};
  for (const v1::DisplayDescription* display : displays) {
    if (display->scene_to_voxel().m_size() != 12) continue;
    gpu::Affine view;
    std::copy(display->scene_to_voxel().m().begin(), display->scene_to_voxel().m().end(), view.m);
    const v1::VoxelGrid& grid = display->geometry().grid();
    absl::StatusOr<DisplaySpace> space =
        VisibleSpace(grid.nx(), grid.ny(), grid.nz(), view,
                     display->geometry().has_rotor() || display->geometry().has_helix());
    if (!space.ok()) return space.status();
    common = common ? Intersection(*common, *space) : *space;
    least_side = std::min({least_side, static_cast<int>(grid.nx()), static_cast<int>(grid.ny()),
                           static_cast<int>(grid.nz())});
    voxels = {std::max(voxels[0], static_cast<uint32_t>(grid.nx())),
              std::max(voxels[1], static_cast<uint32_t>(grid.nz()))};
  }
  return common ? Room{*common, voxels, least_side} : Room();
}

}  // namespace

absl::StatusOr<Room> ChooseSpace(Connection& connection, const std::string& name,
                                 Console& console) {
  const absl::StatusOr<v1::ListDisplaysResponse> all = connection.ListDisplays();
  if (!all.ok()) return all.status();
  std::vector<const v1::DisplayDescription*> displays;
  std::vector<std::string> names;
  v1::ListDisplaysResponse chosen;
  for (const v1::DisplayDescription& display : all->displays()) {
    names.push_back(EscapeForTerminal(display.name()));
    if (!name.empty() && display.name() != name) continue;
    displays.push_back(&display);
    *chosen.add_displays() = display;
  }
  if (!name.empty() && displays.empty()) {
    return absl::NotFoundError(absl::StrCat("there is no display \"", EscapeForTerminal(name),
                                            "\"; there are ", absl::StrJoin(names, ", ")));
  }
  if (displays.empty()) console.Say("the server has no display: the scene is put up unseen");
  for (const std::string& sentence : NotShowing(chosen)) console.Say(sentence);
  return CommonRoom(displays);
}

}  // namespace voxeld::voxelctl
