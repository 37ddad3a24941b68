#include "daemon/play/play_file.h"

#include <gmock/gmock.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <fstream>
#include <iterator>

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
    EXPECT_NE(access(path.c_str(), F_OK), 0) << "what it was is gone";
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

TEST(SafeNames, AreOneWordOfAPath) {
  EXPECT_EQ(SafeName("arrow.stl"), "arrow.stl");
  EXPECT_EQ(SafeName("My Tea Pot (2).obj"), "My Tea Pot (2).obj");
  EXPECT_EQ(SafeName("größe.obj"), "größe.obj");
  EXPECT_EQ(SafeName("/etc/passwd"), "passwd");
  EXPECT_EQ(SafeName("..\\..\\x.stl"), "x.stl");
  EXPECT_EQ(SafeName("a\n\x1b[1m\x7f.stl"), "a__[1m_.stl");
  EXPECT_EQ(SafeName("frame_%04d.obj"), "frame__04d.obj") << "no sequence";
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
