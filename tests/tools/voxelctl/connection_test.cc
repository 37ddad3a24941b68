// Tests that need no server: addresses, issues, captured volumes.
#include <gmock/gmock.h>
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
#include "tools/voxelctl/connection/status.h"

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
  variables["XDG_RUNTIME_DIR"].pop_back();  // without the final slash

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

TEST(WhyUnreachable, TellsTheCausesApart) {
  const std::string all = "failed to connect to all addresses; last error: ";
  const std::string tls = "tls:there:1";
  const client::Credentials none, mine{.ca = "a.pem", .certificate = "c.pem", .server_name = "x"};
  EXPECT_EQ(WhyUnreachable("DNS resolution failed for there:1: Domain name not found", tls, mine),
            "its host's name is not known to this machine");
  EXPECT_EQ(WhyUnreachable(all + "Connection refused", tls, mine), "nobody listens there");
  EXPECT_EQ(WhyUnreachable(all + "Peer name there is not in peer certificate", tls, none),
            "its certificate is not for this host; VOXELD_TLS_NAME says which name it is for");
  EXPECT_THAT(WhyUnreachable(all + "Peer name x is not in peer certificate", tls, mine),
              ::testing::StartsWith("its certificate is not for \"x\""));
  const std::string verify = all + "SSL routines::certificate verify failed";
  EXPECT_THAT(WhyUnreachable(verify, tls, none), ::testing::HasSubstr("VOXELD_TLS_CA names"));
  EXPECT_THAT(WhyUnreachable(verify, tls, mine), ::testing::HasSubstr("the authority in a.pem"));
  EXPECT_THAT(WhyUnreachable(all + "Socket closed", tls, none),
              ::testing::HasSubstr("asks for a certificate, and none is given"));
  EXPECT_THAT(WhyUnreachable(all + "Socket closed", tls, mine),
              ::testing::HasSubstr("the certificate in c.pem is not taken"));
  EXPECT_THAT(WhyUnreachable(all + "Trying to connect an http1.x server", "there:1", none),
              ::testing::HasSubstr("it has no room for another connection"));
  EXPECT_EQ(WhyUnreachable(all + "Socket closed", "there:1", none),
            "nobody listens there, or what does is no voxeld");
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

}  // namespace
}  // namespace voxeld::voxelctl
