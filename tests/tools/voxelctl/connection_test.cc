// What needs no server: addresses, issues, captured volumes.
#include <gtest/gtest.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <map>
#include <optional>
#include <string>

#include "display/geometry/footprint.h"
#include "tests/tools/voxelctl/status_matchers.h"
#include "tests/tools/voxelctl/temp_folder.h"
#include "tools/voxelctl/commands/captured_volume.h"
#include "tools/voxelctl/connection/address.h"
#include "tools/voxelctl/connection/scene_session.h"

namespace voxeld::voxelctl {
namespace {

// --------------------------------------------------------------------------------- addresses

TEST(ServerTarget, TakesBothForms) {
  EXPECT_EQ(*ServerTarget("127.0.0.1:50551"), "dns:///127.0.0.1:50551");
  EXPECT_EQ(*ServerTarget("[::1]:1"), "dns:///[::1]:1");
  EXPECT_EQ(*ServerTarget("unix:/a/b"), "unix:/a/b");
}

TEST(ServerTarget, RefusesTheRest) {
  for (const char* address : {"", "host", "host:", ":1", "host:0", "host:65536", "host:x", "::1:5",
                              "http://host:80", "unix:", "unix:b", "ho\x1bst"}) {
    EXPECT_THAT(ServerTarget(address), Fails(Words{"HOST:PORT or unix:PATH"})) << address;
  }
}

TEST(ChooseServer, OptionThenVariableThenSocketThenPort) {
  TempFolder folder;
  std::map<std::string, std::string> variables = {{"XDG_RUNTIME_DIR", folder.Path("")}};
  const Environment environment = [&](const char* name) { return variables[name]; };
  variables["XDG_RUNTIME_DIR"].pop_back();  // the slash at its end

  const std::string path = folder.Path("voxeld.sock");
  folder.Write("voxeld.sock", "a plain file is no socket");
  EXPECT_NE(ChooseServer("", environment), "unix:" + path);
  ::unlink(path.c_str());
  const int listener = ::socket(AF_UNIX, SOCK_STREAM, 0);
  sockaddr_un address = {};
  address.sun_family = AF_UNIX;
  path.copy(address.sun_path, sizeof address.sun_path - 1);
  ASSERT_EQ(::bind(listener, reinterpret_cast<sockaddr*>(&address), sizeof address), 0);
  EXPECT_EQ(ChooseServer("", environment), "unix:" + path);
  ::close(listener);

  variables["VOXELD_SERVER"] = "there:1";
  EXPECT_EQ(ChooseServer("", environment), "there:1");
  EXPECT_EQ(ChooseServer("here:2", environment), "here:2");
}

// ------------------------------------------------------------------------------------- issues

TEST(IssueForTerminal, IsOneLineForPeople) {
  client::Issue issue;
  issue.layer = "l";
  issue.id = "i\n";
  issue.field = "upsert.entity";
  issue.message = "is 3; 2 is right";
  EXPECT_EQ(IssueForTerminal(issue), "l/i\\u{a}, upsert.entity: is 3; 2 is right");
  issue.layer = issue.id = "";
  EXPECT_EQ(IssueForTerminal(issue), "upsert.entity: is 3; 2 is right");
}

// --------------------------------------------------------------------------- captured volumes

v1::VolumeChunk Header(int slices, int width, int height) {
  v1::VolumeChunk chunk;
  v1::VolumeHeader* header = chunk.mutable_header();
  header->set_display("d");
  header->set_volume(7);
  v1::PlanarStack* stack = header->mutable_geometry()->mutable_planar_stack();
  stack->set_width_px(width);
  stack->set_height_px(height);
  stack->set_pitch_u_mm(1);
  stack->set_pitch_v_mm(1);
  stack->set_thickness_mm(1);
  for (int i = 0; i < slices && i < 100; ++i) stack->add_positions_mm(i);
  v1::VoxelGrid* grid = header->mutable_geometry()->mutable_grid();
  grid->set_nx(width);
  grid->set_ny(height);
  grid->set_nz(slices);
  for (v1::Vec3* v : {grid->mutable_pitch_mm(), grid->mutable_origin_mm()}) {
    v->set_x(1);
    v->set_y(1);
    v->set_z(1);
  }
  header->mutable_layout()->set_slices(slices);
  header->mutable_layout()->set_width(width);
  header->mutable_layout()->set_height(height);
  return chunk;
}

v1::VolumeChunk Slices(int first, const std::string& rgb) {
  v1::VolumeChunk chunk;
  chunk.mutable_slices()->set_first_slice(first);
  chunk.mutable_slices()->set_rgb(rgb);
  return chunk;
}

TEST(CapturedVolume, PutsSlicesTogetherInAnyOrder) {
  CapturedVolume captured;
  ASSERT_THAT(captured.Add(Header(3, 2, 1)), IsOk());
  ASSERT_THAT(captured.Add(Slices(2, "abcdef")), IsOk());
  ASSERT_THAT(captured.Add(Slices(0, "ABCDEFGHIJKL")), IsOk());
  const absl::StatusOr<Volume> volume = std::move(captured).Finish();
  ASSERT_THAT(volume, IsOk());
  EXPECT_EQ(std::string(volume->rgb.begin(), volume->rgb.end()), "ABCDEFGHIJKLabcdef");
  EXPECT_EQ(volume->display, "d");
  EXPECT_EQ(volume->number, 7u);
}

TEST(CapturedVolume, RefusesWhatDoesNotFit) {
  EXPECT_THAT(CapturedVolume().Add(Slices(0, "abc")), Fails(Words{"before the volume's header"}));
  EXPECT_THAT(CapturedVolume().Add(Header(1 << 20, 1 << 20, 1 << 20)), Fails(Words{"at most"}));
  EXPECT_THAT(CapturedVolume().Add(Header(-1, 2, 2)), Fails(Words{"-1 slices"}));
  CapturedVolume captured;
  ASSERT_THAT(captured.Add(Header(3, 2, 1)), IsOk());
  EXPECT_THAT(captured.Add(Slices(0, "abcde")), Fails(Words{"5 bytes"}));
  EXPECT_THAT(captured.Add(Slices(3, "abcdef")), Fails(Words{"from slice 3"}));
  EXPECT_THAT(captured.Add(Slices(-1, "abcdef")), Fails(Words{"from slice -1"}));
  EXPECT_THAT(captured.Add(Header(3, 2, 1)), Fails(Words{"two volumes"}));
  EXPECT_THAT(std::move(captured).Finish(),
              Fails(Words{"3 of the volume's 3 slices did not come"}));
  EXPECT_THAT(CapturedVolume().Finish(), Fails(Words{"no volume"}));
  v1::VolumeChunk no_shape = Header(1, 1, 1);
  no_shape.mutable_header()->mutable_geometry()->clear_planar_stack();
  EXPECT_THAT(CapturedVolume().Add(no_shape), Fails(Words{"geometry"}));
}

TEST(GeometryFromWire, TakesARotorWhole) {
  v1::Geometry wire;
  v1::Rotor* rotor = wire.mutable_rotor();
  rotor->set_slices_per_turn(90);
  rotor->set_width_px(8);
  rotor->set_height_px(4);
  rotor->set_clockwise(true);
  v1::Rotor::Panel* panel = rotor->add_panels();
  panel->set_pitch_u_mm(1);
  panel->set_pitch_v_mm(2);
  panel->set_eccentricity_mm(3);
  panel->set_shift_u_mm(4);
  panel->set_shift_v_mm(5);
  panel->set_phase_turns(0.5);
  panel->set_mirror_v(true);
  const absl::StatusOr<display::Geometry> geometry = GeometryFromWire(wire);
  ASSERT_THAT(geometry, IsOk());
  display::Rotor expected;
  expected.slices_per_turn = 90;
  expected.width_px = 8;
  expected.height_px = 4;
  expected.clockwise = true;
  expected.panels.push_back({1, 2, 3, 4, 5, 0.5, false, true});
  EXPECT_EQ(std::get<display::Rotor>(geometry->shape), expected);
}

TEST(GeometryFromWire, TakesALatticeWhole) {
  v1::Geometry wire;
  v1::Lattice* lattice = wire.mutable_lattice();
  lattice->set_width_px(2);
  lattice->set_slices(2);
  lattice->mutable_cell_mm()->set_x(1);
  lattice->mutable_cell_mm()->set_y(2);
  lattice->mutable_cell_mm()->set_z(3);
  for (const uint32_t pixel : {1u, 2u}) {
    lattice->add_pixels(pixel);
    lattice->add_x_mm(pixel);
    lattice->add_y_mm(pixel * 10.0);
    lattice->add_z_mm(pixel * -0.5);
  }
  const absl::StatusOr<display::Geometry> geometry = GeometryFromWire(wire);
  ASSERT_THAT(geometry, IsOk());
  const display::Lattice expected{.width_px = 2,
                                  .points_mm = {std::nullopt, display::Vec3{1, 10, -0.5},
                                                display::Vec3{2, 20, -1}, std::nullopt},
                                  .cell_mm = {1, 2, 3}};
  EXPECT_EQ(std::get<display::Lattice>(geometry->shape), expected);

  v1::Geometry wrong = wire;
  wrong.mutable_lattice()->add_x_mm(0);
  EXPECT_THAT(GeometryFromWire(wrong), Fails(Words{"2 lights with 3, 2 and 2 coordinates"}));
  wrong = wire;
  wrong.mutable_lattice()->set_pixels(1, 4);
  EXPECT_THAT(GeometryFromWire(wrong), Fails(Words{"4 pixels with a light in pixel 4"}));
  wrong = wire;
  wrong.mutable_lattice()->set_slices(1 << 30);
  wrong.mutable_lattice()->set_width_px(1 << 30);
  EXPECT_THAT(GeometryFromWire(wrong), Fails(Words{"1073741824 slices", "at most 16777216"}));
  wrong.mutable_lattice()->set_slices(0);
  EXPECT_THAT(GeometryFromWire(wrong), Fails(Words{"0 slices"}));
}

}  // namespace
}  // namespace voxeld::voxelctl
