// Tests the player with scripts in place of voxelctl.
#include "daemon/play/player.h"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <poll.h>
#include <signal.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <fstream>
#include <iterator>
#include <sstream>

#include "absl/strings/str_cat.h"
#include "daemon/address/descriptor.h"
#include "display/sync/mutex.h"

namespace voxeld::daemon::play {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;

class PlayerTest : public ::testing::Test {
 protected:
  void SetUp() override {
    absl::StatusOr<PrivateFolder> folder = PrivateFolder::Make();
    ASSERT_TRUE(folder.ok());
    folder_.emplace(*std::move(folder));
  }

  std::string Path(const std::string& name) const {
    return absl::StrCat(folder_->path(), "/", name);
  }

  // Starts a player that runs `script` in place of voxelctl.
  void Start(const std::string& script, PlayerOptions options = {.grace_ns = 60 * sync::kSecond}) {
    const std::string program = Path("voxelctl");
    std::ofstream(program) << "#!/bin/sh\nHERE=" << folder_->path() << "\n" << script << "\n";
    chmod(program.c_str(), 0700);
    options.program = program;
    options.server = "unix:/run/v.sock";
    auto player = Player::Make(options);
    ASSERT_TRUE(player.ok()) << player.status();
    player_ = *std::move(player);
    player_->SetOnChange([this] {
      sync::MutexLock lock(mutex_);
      changed_.NotifyAll();
    });
  }

  std::string Play(const std::string& name) {
    absl::StatusOr<PlayFile> file = PlayFile::Make(name);
    EXPECT_TRUE(file.ok()) << file.status();
    const std::string path = file->path();
    player_->Play(*std::move(file));
    return path;
  }

  Playing AwaitState(const std::function<bool(const Playing&)>& is) {
    sync::MutexLock lock(mutex_);
    for (;;) {
      Playing state = player_->state();
      if (is(state)) return state;
      changed_.Wait(mutex_);
    }
  }
  Playing AwaitFailed(const std::string& name) {
    return AwaitState([&](const Playing& state) { return state.failed == name; });
  }
  void AwaitNothing() {
    AwaitState([](const Playing& state) { return state == Playing(); });
  }

  // Makes a named pipe, by which a script reports its progress.
  void MakeFifo(const std::string& name) { ASSERT_EQ(mkfifo(Path(name).c_str(), 0600), 0); }
  std::string ReadFifo(const std::string& name) {
    std::ifstream file(Path(name));  // waits for a writer, and reads until it closes
    return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
  }

  static Descriptor Watch(pid_t pid) {
    return Descriptor(static_cast<int>(syscall(SYS_pidfd_open, pid, 0)));
  }
  static bool HasEnded(const Descriptor& watched, int milliseconds = 60'000) {
    pollfd end = {watched.get(), POLLIN, 0};
    return watched.ok() && poll(&end, 1, milliseconds) == 1;
  }

  std::optional<PrivateFolder> folder_;
  sync::Mutex mutex_;
  sync::CondVar changed_;
  std::unique_ptr<Player> player_;
};

// A script that reports its process id, and runs until it is terminated.
constexpr char kStays[] = "echo $$ >$HERE/started; exec tail -f /dev/null";

TEST_F(PlayerTest, RunsVoxelctlWithTheFileAndNothingOfTheDaemons) {
  setenv("VOXELD_TOKEN", "secret", 1);
  Start(
      "printf '%s\\n' \"$@\" >$HERE/words; env >$HERE/environment; ls /proc/self/fd "
      ">$HERE/descriptors; cut -d' ' -f5 /proc/$$/stat >$HERE/group; cat \"$7\" >$HERE/contents");
  const Descriptor open_here(open("/dev/null", O_RDONLY));  // without CLOEXEC, as a library might
  absl::StatusOr<PlayFile> file = PlayFile::Make("my arrow.stl");
  ASSERT_TRUE(file.ok() && file->Append("solid").ok());
  const std::string path = file->path();
  player_->Play(*std::move(file));
  EXPECT_EQ(player_->state().failed, "");
  AwaitNothing();
  unsetenv("VOXELD_TOKEN");
  const auto lines = [this](const std::string& name) {
    std::ifstream in(Path(name));
    std::vector<std::string> all;
    for (std::string line; std::getline(in, line);) all.push_back(line);
    return all;
  };
  EXPECT_THAT(lines("words"), ElementsAre("--server", "unix:/run/v.sock", "play", "--clear",
                                          "--other-files", "none", path));
  EXPECT_THAT(lines("contents"), ElementsAre("solid"));
  EXPECT_THAT(lines("environment"), Not(::testing::Contains(HasSubstr("secret"))));
  EXPECT_THAT(lines("descriptors"), ElementsAre("0", "1", "2", "3")) << "3 belongs to ls itself";
  ASSERT_EQ(lines("group").size(), 1u);
  EXPECT_NE(std::stoi(lines("group")[0]), getpgrp());
  EXPECT_NE(access(path.c_str(), F_OK), 0) << "the file was removed with it";
}

TEST_F(PlayerTest, StopsAndIsReplaced) {
  Start(kStays);
  MakeFifo("started");
  const std::string first = Play("one.stl");
  EXPECT_EQ(player_->state(), Playing{.name = "one.stl"});
  const Descriptor one = Watch(std::stoi(ReadFifo("started")));
  EXPECT_FALSE(HasEnded(one, 0));
  const std::string second = Play("two.stl");
  const pid_t pid = std::stoi(ReadFifo("started"));
  EXPECT_TRUE(HasEnded(one, 0)) << "the old one has ended before the new one begins";
  EXPECT_NE(access(first.c_str(), F_OK), 0);
  EXPECT_EQ(access(second.c_str(), F_OK), 0);
  EXPECT_EQ(player_->state(), Playing{.name = "two.stl"});
  const Descriptor two = Watch(pid);
  player_->Stop();
  AwaitNothing();
  EXPECT_TRUE(HasEnded(two, 0));
  EXPECT_NE(access(second.c_str(), F_OK), 0);
  player_->Stop();  // nothing is played
  const std::string third = Play("three.stl");
  const Descriptor three = Watch(std::stoi(ReadFifo("started")));
  player_.reset();
  EXPECT_TRUE(HasEnded(three, 0)) << "it ends with the player";
  EXPECT_NE(access(third.c_str(), F_OK), 0);
}

TEST_F(PlayerTest, TellsWhatWasWrong) {
  Start(
      "echo 'a note' >&2; echo \"voxelctl: first\" >&2; echo \"voxelctl: $7: is not a model;\" "
      ">&2; "
      "echo "
      "'  models begin otherwise' >&2; exit 1");
  Play("bad.obj");
  const Playing state = AwaitFailed("bad.obj");
  EXPECT_EQ(state.name, "");
  EXPECT_EQ(state.why, "bad.obj: is not a model; models begin otherwise");
}

TEST_F(PlayerTest, TellsWhatWasWrongWithWhoeverSaysNothing) {
  Start("exit 3");
  Play("a.obj");
  EXPECT_THAT(AwaitFailed("a.obj").why, HasSubstr("ended with 3"));
  Start("kill -SEGV $$");
  Play("b.obj");
  EXPECT_THAT(AwaitFailed("b.obj").why, HasSubstr("signal 11"));
  std::ofstream(Path("voxelctl")) << "";
  chmod(Path("voxelctl").c_str(), 0600);
  Play("c.obj");
  EXPECT_THAT(AwaitFailed("c.obj").why,
              HasSubstr("ended with"));  // setpriv's; it prints its own message
}

TEST_F(PlayerTest, KeepsLittleOfWhoeverSaysMuch) {
  Start(
      "head -c 300000 /dev/zero | tr '\\0' x >&2; printf '\\nvoxelctl: ' >&2; head -c 5000 "
      "/dev/zero "
      "| tr '\\0' y >&2; exit 1");
  Play("much.obj");
  const std::string why = AwaitFailed("much.obj").why;
  EXPECT_LE(why.size(), kLongestWhy);
  EXPECT_THAT(why, ::testing::StartsWith("yyyy"));
}

// It is asked to exit, and then killed, together with the processes that it has started.
TEST_F(PlayerTest, EndsWhoDoesNotListenWithItsChildren) {
  Start("trap '' TERM; tail -f /dev/null & echo $! $$ >$HERE/started; wait; wait; wait",
        {.grace_ns = 50 * sync::kMillisecond});
  MakeFifo("started");
  Play("stubborn.stl");
  std::istringstream numbers(ReadFifo("started"));
  pid_t of_child = 0, of_script = 0;
  numbers >> of_child >> of_script;
  const Descriptor child = Watch(of_child), script = Watch(of_script);
  player_->Stop();
  AwaitNothing();
  EXPECT_TRUE(HasEnded(script));
  EXPECT_TRUE(HasEnded(child));
}

TEST_F(PlayerTest, RemovesFirstWhatOthersHaveLeft) {
  const char* const before = std::getenv("TMPDIR");
  const std::string temporary = before == nullptr ? "" : before;
  setenv("TMPDIR", folder_->path().c_str(), 1);
  const std::string left = Path("voxeld-play-left");
  ASSERT_EQ(mkdir(left.c_str(), 0700), 0);
  Start("exit 0", {.remove_left = true});
  Play("a.obj");
  AwaitNothing();
  EXPECT_NE(access(left.c_str(), F_OK), 0);
  player_.reset();
  before == nullptr ? unsetenv("TMPDIR") : setenv("TMPDIR", temporary.c_str(), 1);
}

TEST_F(PlayerTest, PlaysNothingOnceItHasEnded) {
  Start(kStays);
  MakeFifo("started");
  Play("one.stl");
  const Descriptor one = Watch(std::stoi(ReadFifo("started")));
  player_->End();
  EXPECT_TRUE(HasEnded(one, 0));
  const std::string late = Play("late.stl");
  EXPECT_EQ(player_->state(), Playing());
  EXPECT_NE(access(late.c_str(), F_OK), 0);
}

}  // namespace
}  // namespace voxeld::daemon::play
