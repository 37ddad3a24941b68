#include "daemon/play/play_file.h"

#include <gmock/gmock.h>
#include <signal.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <optional>

namespace voxeld::daemon::play {
namespace {

using ::testing::HasSubstr;

std::string Contents(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
}

mode_t ModeOf(const std::string& path) {
  struct stat found = {};
  EXPECT_EQ(stat(path.c_str(), &found), 0) << path;
  return found.st_mode & 07777;
}

TEST(PlayFile, IsForItsOwnerAloneAndGoesWithItsFolder) {
  std::string path, folder;
  {
    absl::StatusOr<PlayFile> file = PlayFile::Make("arrow.stl");
    ASSERT_TRUE(file.ok()) << file.status();
    ASSERT_TRUE(file->Append("solid ").ok());
    ASSERT_TRUE(file->Append("arrow\n").ok());
    path = file->path();
    folder = file->prefix();
    EXPECT_EQ(path, folder + "arrow.stl");
    EXPECT_EQ(file->bytes(), 12u);
    EXPECT_EQ(Contents(path), "solid arrow\n");
    EXPECT_EQ(ModeOf(path), 0600u);
    EXPECT_EQ(ModeOf(folder), 0700u);
    PlayFile moved = *std::move(file);
    EXPECT_EQ(access(path.c_str(), F_OK), 0);
    absl::StatusOr<PlayFile> other = PlayFile::Make("arrow.stl");
    ASSERT_TRUE(other.ok());
    EXPECT_NE(other->path(), path);
    moved = *std::move(other);
    EXPECT_NE(access(path.c_str(), F_OK), 0) << "the earlier file is removed";
    path = moved.path();
    folder = moved.prefix();
  }
  EXPECT_NE(access(path.c_str(), F_OK), 0);
  EXPECT_NE(access(folder.c_str(), F_OK), 0);
}

TEST(PlayFile, SaysWhenThereIsNoRoom) {
  size_t room = 100;
  const auto write = [&room](int descriptor, const char* bytes, size_t size) -> ssize_t {
    if (room == 0) {
      errno = ENOSPC;
      return -1;
    }
    const ssize_t written = ::write(descriptor, bytes, std::min({size, room, size_t{7}}));
    room -= static_cast<size_t>(written);
    return written;
  };
  absl::StatusOr<PlayFile> file = PlayFile::Make("a.obj", write);
  ASSERT_TRUE(file.ok());
  EXPECT_TRUE(file->Append(std::string(60, 'a')).ok());
  const absl::Status full = file->Append(std::string(60, 'b'));
  EXPECT_TRUE(absl::IsResourceExhausted(full)) << full;
  EXPECT_THAT(std::string(full.message()), HasSubstr("No space left on device after 100 bytes"));
  EXPECT_EQ(Contents(file->path()), std::string(60, 'a') + std::string(40, 'b'));
}

// Temporary files are in a folder of the test's own.
class LeftFolders : public ::testing::Test {
 protected:
  void SetUp() override {
    absl::StatusOr<PrivateFolder> temporary = PrivateFolder::Make();
    ASSERT_TRUE(temporary.ok());
    temporary_.emplace(*std::move(temporary));
    if (const char* before = std::getenv("TMPDIR")) before_ = before;
    setenv("TMPDIR", temporary_->path().c_str(), 1);
  }
  void TearDown() override {
    before_.has_value() ? setenv("TMPDIR", before_->c_str(), 1) : unsetenv("TMPDIR");
  }
  std::string Path(const std::string& name) const { return temporary_->path() + "/" + name; }
  // A folder as the daemon makes it, with a file.
  std::string Folder(const std::string& name, mode_t mode = 0700) const {
    EXPECT_EQ(mkdir(Path(name).c_str(), 0700), 0);
    std::ofstream(Path(name) + "/a.obj") << "v 0 0 0\n";
    EXPECT_EQ(chmod(Path(name).c_str(), mode), 0);
    return Path(name);
  }
  static bool Is(const std::string& path) { return access(path.c_str(), F_OK) == 0; }

  std::optional<PrivateFolder> temporary_;
  std::optional<std::string> before_;
};

TEST_F(LeftFolders, GoOnceTheirProcessIsGone) {
  std::array<int, 2> told;
  ASSERT_EQ(pipe(told.data()), 0);
  const pid_t other = fork();
  if (other == 0) {
    absl::StatusOr<PlayFile> file = PlayFile::Make("arrow.stl");
    const std::string path = file.ok() && file->Append("solid").ok() ? file->path() : "";
    (void)!write(told[1], path.c_str(), path.size() + 1);
    pause();
    _exit(0);
  }
  std::string path;
  for (char c = 1; read(told[0], &c, 1) == 1 && c != 0;) path += c;
  EXPECT_TRUE(Is(path)) << path;
  absl::StatusOr<PlayFile> own = PlayFile::Make("own.stl");
  ASSERT_TRUE(own.ok());
  const PlayFile moved = *std::move(own);
  EXPECT_EQ(PrivateFolder::RemoveLeft(), 0u);
  EXPECT_TRUE(Is(path)) << "it is being played";
  kill(other, SIGKILL);
  ASSERT_EQ(waitpid(other, nullptr, 0), other);
  EXPECT_TRUE(Is(path)) << "there was no process to remove it";
  EXPECT_EQ(PrivateFolder::RemoveLeft(), 1u);
  EXPECT_FALSE(Is(std::filesystem::path(path).parent_path()));
  EXPECT_TRUE(Is(moved.path()));
  for (const int fd : told) close(fd);
}

TEST_F(LeftFolders, AreNothingElse) {
  const std::string elsewhere = Folder("elsewhere"), open_to_all = Folder("voxeld-play-open", 0755);
  const std::string with_more = Folder("voxeld-play-more"), left = Folder("voxeld-play-left");
  ASSERT_EQ(mkdir((with_more + "/folder").c_str(), 0700), 0);
  std::ofstream(with_more + "/folder/kept") << "kept";
  ASSERT_EQ(symlink(elsewhere.c_str(), Path("voxeld-play-link").c_str()), 0);
  ASSERT_EQ(symlink((elsewhere + "/a.obj").c_str(), (left + "/link").c_str()), 0);
  std::ofstream(Path("voxeld-play-file")) << "kept";
  std::string of_another;
  if (geteuid() == 0) {  // only root can change the owner of folders
    of_another = Folder("voxeld-play-other");
    ASSERT_EQ(chown(of_another.c_str(), 1, 1), 0);
  }
  EXPECT_EQ(PrivateFolder::RemoveLeft(), 1u);
  EXPECT_FALSE(Is(left));
  EXPECT_TRUE(Is(elsewhere + "/a.obj"));
  EXPECT_TRUE(Is(open_to_all + "/a.obj"));
  EXPECT_TRUE(Is(with_more + "/folder/kept"));
  EXPECT_TRUE(Is(Path("voxeld-play-link")));
  EXPECT_TRUE(Is(Path("voxeld-play-file")));
  if (!of_another.empty()) {
    EXPECT_TRUE(Is(of_another + "/a.obj"));
  }
}

TEST_F(LeftFolders, AreNotWhereThereIsNoFolderAtAll) {
  setenv("TMPDIR", Path("nowhere").c_str(), 1);
  EXPECT_EQ(PrivateFolder::RemoveLeft(), 0u);
  EXPECT_FALSE(PrivateFolder::Make().ok());
}

TEST(SafeNames, AreOneWordOfAPath) {
  EXPECT_EQ(SafeName("arrow.stl"), "arrow.stl");
  EXPECT_EQ(SafeName("My Tea Pot (2).obj"), "My Tea Pot (2).obj");
  EXPECT_EQ(SafeName("größe.obj"), "größe.obj");
  EXPECT_EQ(SafeName("/etc/passwd"), "passwd");
  EXPECT_EQ(SafeName("..\\..\\x.stl"), "x.stl");
  EXPECT_EQ(SafeName("a\n\x1b[1m\x7f.stl"), "a__[1m_.stl");
  EXPECT_EQ(SafeName("frame_%04d.obj"), "frame__04d.obj") << "not a sequence";
  EXPECT_EQ(SafeName("frame_####.obj"), "frame_____.obj");
  for (const char* none : {"", ".", "..", "...", "a/", "/"}) EXPECT_EQ(SafeName(none), "file");
}

TEST(SafeNames, AreShortAndKeepTheirExtension) {
  const std::string name = SafeName(std::string(300, 'x') + ".gltf");
  EXPECT_EQ(name, std::string(kLongestName - 5, 'x') + ".gltf");
  std::string umlauts;
  for (int i = 0; i < 200; ++i) umlauts += "ä";
  EXPECT_EQ(SafeName("x" + umlauts + ".ply"), "x" + umlauts.substr(0, 114) + ".ply");
  EXPECT_EQ(SafeName("x." + std::string(300, 'y')).size(), kLongestName);
}

}  // namespace
}  // namespace voxeld::daemon::play
