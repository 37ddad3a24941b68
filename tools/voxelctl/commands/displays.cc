#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "absl/strings/strip.h"
#include "tools/voxelctl/commands/commands.h"
#include "tools/voxelctl/text/proto_json.h"
#include "tools/voxelctl/text/table.h"

namespace voxeld::voxelctl {
namespace {

// Converts "DISPLAY_STATE_SHOWING" to "showing".
std::string Word(const std::string& name, absl::string_view prefix) {
  return absl::AsciiStrToLower(absl::StripPrefix(name, prefix));
}

std::string ShapeText(const v1::Geometry& geometry) {
  switch (geometry.shape_case()) {
    case v1::Geometry::kPlanarStack:
      return absl::StrCat(
          geometry.planar_stack().normal() == v1::PlanarStack::Z ? "lying" : "standing", " slices");
    case v1::Geometry::kRotor:
      return absl::StrCat("rotor, ", geometry.rotor().panels_size(),
                          geometry.rotor().panels_size() == 1 ? " panel" : " panels");
    case v1::Geometry::kLattice:
      return absl::StrCat("lattice, ", geometry.lattice().pixels_size(),
                          geometry.lattice().pixels_size() == 1 ? " light" : " lights");
    case v1::Geometry::kHelix:
      return absl::StrCat("helix, ", geometry.helix().blades(),
                          geometry.helix().blades() == 1 ? " blade" : " blades");
    case v1::Geometry::SHAPE_NOT_SET:
      return "unknown";
  }
  return "unknown";
}

std::string Shown(const v1::DisplayDescription& display) {
  const std::string state = Word(v1::DisplayState_Name(display.state()), "DISPLAY_STATE_");
  return display.state_reason().empty() || display.state_reason() == state
             ? state
             : absl::StrCat(state, " (", display.state_reason(), ")");
}

}  // namespace

absl::Status Displays(Connection& connection, Console& console) {
  const absl::StatusOr<v1::ListDisplaysResponse> response = connection.ListDisplays();
  if (!response.ok()) return response.status();
  if (console.json()) {
    console.Data(JsonText(ToJson(*response), false));
    return absl::OkStatus();
  }
  using Align = Table::Align;
  Table table({{"NAME"},
               {"DRIVER"},
               {"STATE"},
               {"SHAPE"},
               {"VOXELS"},
               {"SIZE mm"},
               {"SLICES"},
               {"PIXELS"},
               {"VOLUMES/s", Align::kRight},
               {"BRIGHTNESS", Align::kRight},
               {"LIMIT W", Align::kRight},
               {"GENLOCK"},
               {"PATTERN"}});
  for (const v1::DisplayDescription& d : response->displays()) {
    const v1::VoxelGrid& grid = d.geometry().grid();
    const v1::Vec3& pitch = grid.pitch_mm();
    table.Add({d.name(), d.driver(), Shown(d), ShapeText(d.geometry()),
               absl::StrCat(grid.nx(), "x", grid.ny(), "x", grid.nz()),
               absl::StrFormat("%.4gx%.4gx%.4g", grid.nx() * pitch.x(), grid.ny() * pitch.y(),
                               grid.nz() * pitch.z()),
               absl::StrCat(d.layout().slices()),
               absl::StrCat(d.layout().width(), "x", d.layout().height()),
               absl::StrFormat("%.4g", d.volumes_per_second()),
               absl::StrFormat("%.0f %%", d.brightness() * 100),
               d.power_limit_w() > 0 ? absl::StrFormat("%.4g", d.power_limit_w()) : "-",
               d.genlock().empty() ? "-" : d.genlock(),
               Word(v1::TestPattern_Name(d.test_pattern()), "TEST_PATTERN_")});
  }
  console.Data(table.Text());
  if (response->displays().empty()) console.Say("the server has no display");
  return absl::OkStatus();
}

}  // namespace voxeld::voxelctl
