#include "tools/child/child_process.h"

#include <gmock/gmock.h>
#include <signal.h>

#include <filesystem>
#include <fstream>
#include <utility>

#include "tools/child/programs.h"

namespace voxeld::child {
namespace {

using std::chrono::milliseconds;
using ::testing::HasSubstr;

std::unique_ptr<ChildProcess> Shell(const std::string& script, ChildOptions options = {}) {
  auto child = ChildProcess::Start({"/bin/sh", "-c", script}, std::move(options));
  EXPECT_TRUE(child.ok()) << child.status();
  return *std::move(child);
}

TEST(ChildProcess, LinesComeOneByOneAndTheEndIsNothing) {
  const auto child = Shell("echo a; echo b1 >&2; echo c; printf d; exit 3");
  EXPECT_EQ(child->ReadLine(), "a");
  EXPECT_EQ(child->ReadLineWith("b"), "b1");
  EXPECT_EQ(child->ReadLine(), "c");
  EXPECT_EQ(child->ReadLine(), std::nullopt);  // no newline
  EXPECT_EQ(child->Wait(), 3);
  EXPECT_EQ(child->output(), "a\nb1\nc\nd");
  EXPECT_EQ(child->errors(), "");
}

TEST(ChildProcess, ErrorsCanBeKeptApart) {
  const auto child = Shell("echo out; echo err >&2", {.errors = Errors::kApart});
  EXPECT_EQ(child->Wait(), 0);
  EXPECT_EQ(child->output(), "out\n");
  EXPECT_EQ(child->errors(), "err\n");
}

TEST(ChildProcess, MoreThanAPipeHoldsComesThrough) {
  const auto child =
      Shell("head -c 300000 /dev/zero; head -c 300000 /dev/zero >&2", {.errors = Errors::kApart});
  EXPECT_EQ(child->Wait(), 0);
  EXPECT_EQ(child->output().size(), 300'000u);
  EXPECT_EQ(child->errors().size(), 300'000u);
}

TEST(ChildProcess, TheEnvironmentGoesOverOnesOwn) {
  const auto child =
      Shell("echo $VOXELD_ONE:${PATH:+there}", {.environment = {{"VOXELD_ONE", "x y"}}});
  EXPECT_EQ(child->ReadLine(), "x y:there");
}

TEST(ChildProcess, NoSignalIsBlockedWhateverIsBlockedHere) {
  sigset_t blocked, before;
  sigemptyset(&blocked);
  sigaddset(&blocked, SIGTERM);
  pthread_sigmask(SIG_BLOCK, &blocked, &before);
  const auto child = Shell("echo up; exec sleep 1000");
  pthread_sigmask(SIG_SETMASK, &before, nullptr);
  ASSERT_EQ(child->ReadLine(), "up");
  EXPECT_EQ(child->Wait(milliseconds(0)), std::nullopt);
  child->Signal(SIGTERM);
  EXPECT_EQ(child->Wait(), -SIGTERM);
}

TEST(ChildProcess, IsKilledWithItsObject) {
  pid_t pid = 0;
  {
    const auto child = Shell("echo up; exec sleep 1000");
    ASSERT_EQ(child->ReadLine(), "up");
    pid = child->pid();
    EXPECT_EQ(kill(pid, 0), 0);
  }
  EXPECT_NE(kill(pid, 0), 0);
}

TEST(ChildProcess, WhatIsNoProgramIsAnError) {
  const auto child = ChildProcess::Start({"/nowhere/at/all"});
  EXPECT_THAT(std::string(child.status().message()), HasSubstr("/nowhere/at/all"));
}

TEST(TemporaryFolder, GoesWithAllThatIsInIt) {
  std::string path;
  {
    absl::StatusOr<TemporaryFolder> made = TemporaryFolder::Make("voxeld-test");
    ASSERT_TRUE(made.ok()) << made.status();
    const TemporaryFolder folder = *std::move(made);
    path = folder.path();
    std::ofstream(path + "/file") << "text";
    EXPECT_TRUE(std::filesystem::exists(path + "/file"));
  }
  EXPECT_FALSE(std::filesystem::exists(path));
}

TEST(Programs, AreFoundBesideOrAbove) {
  // This test is in bin/tests, programs are in bin.
  const std::filesystem::path self = std::filesystem::read_symlink("/proc/self/exe");
  EXPECT_EQ(ProgramBeside(self.filename()), self);
  EXPECT_EQ(ProgramBeside("none"), self.parent_path().parent_path() / "none");
}

}  // namespace
}  // namespace voxeld::child
