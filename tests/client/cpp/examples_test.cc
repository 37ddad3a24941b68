// Runs the examples against the real daemon with a simulated display: each prints what it should.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>

#include "tests/e2e/voxeld_process.h"
#include "tests/programs.h"

namespace voxeld::e2e {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::MatchesRegex;

std::string Example(const std::string& name) { return ProgramBeside("example_" + name); }

class Examples : public ::testing::Test {
 protected:
  std::string RunIt(const std::string& name) {
    const Ended ended = RunToEnd({Example(name), daemon_.unix_target()});
    EXPECT_EQ(ended.code, 0) << ended.output;
    return ended.output;
  }
  Daemon daemon_;
};

TEST_F(Examples, HelloLine) {
  EXPECT_THAT(RunIt("01_hello_line"), MatchesRegex("sim: presented, volume [1-9][0-9]*\n"));
}

TEST_F(Examples, MovingPoints) {
  EXPECT_EQ(RunIt("02_moving_points"),
            "sim: 100 of 100 frames have their outcome, some presented\n");
}

TEST_F(Examples, Mesh) {
  EXPECT_EQ(RunIt("03_mesh"), "accepted with 0 operations refused; presented\n");
}

TEST_F(Examples, Handles) {
  EXPECT_EQ(RunIt("04_handles"),
            "put up: over 200 KiB\n"
            "moved ten times: each under 300 bytes\n"
            "changed and removed: under 400 bytes\n");
}

TEST_F(Examples, Layers) {
  EXPECT_EQ(RunIt("05_layers"),
            "three layers: presented\n"
            "into a hidden layer: not shown (hidden)\n");
}

TEST_F(Examples, Receipts) {
  EXPECT_THAT(RunIt("06_receipts"), AllOf(HasSubstr("sim: presented"), HasSubstr("  applied "),
                                          HasSubstr("  shown "), HasSubstr("stages ascend: yes"),
                                          HasSubstr("settled, as the callback was told: 20")));
}

TEST_F(Examples, LatestUnderOverload) {
  const std::string output = RunIt("07_latest");
  EXPECT_THAT(output, AllOf(HasSubstr("sums: right"), HasSubstr("the newest: kept"),
                            Not(HasSubstr("given up here 0, there 0\n"))));
}

TEST_F(Examples, PresentAt) {
  EXPECT_EQ(RunIt("09_present_at"),
            "the server's clock is known to under 50 ms\n"
            "5 shown, none before its time; 0 late\n");
}

TEST_F(Examples, TwoSessions) {
  const std::string output = RunIt("10_two_sessions");
  EXPECT_THAT(output, AllOf(HasSubstr("one owner: yes\nmoved by the other\nthe server refused"),
                            HasSubstr("shared/bad"), HasSubstr("radius"),
                            HasSubstr("\nnot strict: 1 refused, the rest is up\n")));
}

TEST(ExamplesWithoutAServer, SayWhereItWas) {
  const Folder folder;
  const std::string target = "unix:" + folder.path() + "/none";
  // The example keeps reconnecting until its own time limit.
  const Ended ended = RunToEnd({Example("05_layers"), target});
  EXPECT_EQ(ended.code, 1);
  EXPECT_THAT(ended.output, HasSubstr("voxeld at " + target + " is not available"));
}

TEST(Reconnect, TheServerIsKilledAndAnotherComes) {
  const Folder folder;
  const std::string target = "unix:" + folder.path() + "/voxeld.sock";
  const std::vector<std::string> arguments =
      Voxeld({"--listen", target, "--http", "127.0.0.1:0", "--display",
              "sim=simulated,size=16x16x8,rate=100", "--engine", "cpu", "--log-format", "json"});
  auto daemon = std::make_unique<Process>(arguments, CleanEnvironment(folder));
  ASSERT_TRUE(daemon->ReadLineWith("\"event\":\"ready\"").has_value()) << daemon->output();
  Process example({Example("08_reconnect"), target});
  ASSERT_EQ(example.ReadLine(), "up") << example.output();
  daemon->Signal(SIGKILL);
  EXPECT_EQ(daemon->Wait(), -SIGKILL);
  EXPECT_EQ(example.ReadLine(), "lost") << example.output();
  Process second(arguments, CleanEnvironment(folder));
  ASSERT_TRUE(second.ReadLineWith("\"event\":\"ready\"").has_value()) << second.output();
  EXPECT_EQ(example.ReadLine(), "restored") << example.output();
  EXPECT_EQ(example.ReadLine(), "still up: 0 operations refused, 0 commits lost");
  EXPECT_EQ(example.Wait(), 0) << example.output();
}

}  // namespace
}  // namespace voxeld::e2e
