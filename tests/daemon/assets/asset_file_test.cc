// Tests the bytes of one asset on disks that are full, that fail, and with interruptions.
#include "daemon/assets/asset_file.h"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <iterator>

#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"
#include "tests/daemon/assets/disk_calls.h"

namespace voxeld::daemon::assets {
namespace {

using ::testing::HasSubstr;

class AssetFileTest : public ::testing::Test {
 protected:
  AssetFileTest() {
    std::filesystem::remove_all(folder_);
    std::filesystem::create_directory(folder_);
  }
  ~AssetFileTest() override { std::filesystem::remove_all(folder_); }

  static std::string Read(const std::string& path) {
    std::ifstream file(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
  }

  const std::string folder_ = absl::StrCat(::testing::TempDir(), "/voxeld-asset-file-", getpid());
  const std::string part_ = folder_ + "/a.part", whole_ = folder_ + "/a";
};

TEST_F(AssetFileTest, IsItsOwnersAlone) {
  auto file = AssetFile::Open(part_, true);
  ASSERT_TRUE(file.ok()) << file.status();
  ASSERT_TRUE(file->Write(0, "hello").ok());
  struct stat found;
  ASSERT_EQ(stat(part_.c_str(), &found), 0);
  EXPECT_EQ(found.st_mode & 0777, 0600u);
  ASSERT_TRUE(AssetFile::Open(part_, false).ok());
  EXPECT_EQ(Read(part_), "hello");
  ASSERT_TRUE(AssetFile::Open(part_, true).ok());
  EXPECT_EQ(Read(part_), "");
}

TEST_F(AssetFileTest, ADeviceThatIsFullHasNoRoom) {
  auto full = AssetFile::Open("/dev/full", false);
  ASSERT_TRUE(full.ok()) << full.status();
  const absl::Status status = full->Write(0, "abc");
  EXPECT_TRUE(absl::IsResourceExhausted(status)) << status;
  EXPECT_THAT(std::string(status.message()), HasSubstr("No space left on device"));
}

TEST_F(AssetFileTest, WantOfRoomIsToldFromOtherFailures) {
  auto file = AssetFile::Open(part_, true);
  ASSERT_TRUE(file.ok());
  const auto code = [&](int error) {
    const DiskCalls fails([=](DiskCall) { return error; });
    return file->Write(0, "abc").code();
  };
  for (const int error : {ENOSPC, EDQUOT, EFBIG, EMFILE, ENFILE, ENOMEM}) {
    EXPECT_EQ(code(error), absl::StatusCode::kResourceExhausted) << error;
  }
  for (const int error : {EIO, EROFS, EBADF}) {
    EXPECT_EQ(code(error), absl::StatusCode::kUnavailable) << error;
  }
  EXPECT_EQ(Read(part_), "");
}

TEST_F(AssetFileTest, WhatIsInterruptedGoesOn) {
  int interrupted = 0;
  const DiskCalls signals([&](DiskCall) { return ++interrupted % 3 == 0 ? 0 : EINTR; });
  auto file = AssetFile::Open(part_, true);
  ASSERT_TRUE(file.ok());
  ASSERT_TRUE(file->Write(0, "hello").ok());
  EXPECT_EQ(interrupted, 3);
  const auto read = ReadAssetFile(part_, 1, 3);
  ASSERT_TRUE(read.ok()) << read.status();
  EXPECT_EQ(read->bytes, "ell");
  EXPECT_EQ(interrupted, 6);
}

TEST_F(AssetFileTest, WhatGoesInPartsIsWhole) {
  const DiskCalls little([](DiskCall) { return DiskCalls::kOneByte; });
  auto file = AssetFile::Open(part_, true);
  ASSERT_TRUE(file.ok());
  ASSERT_TRUE(file->Write(0, "hello").ok());
  ASSERT_TRUE(file->Write(5, ", you").ok());
  EXPECT_EQ(Read(part_), "hello, you");
  const auto read = ReadAssetFile(part_, 4, 5);
  ASSERT_TRUE(read.ok()) << read.status();
  EXPECT_EQ(read->bytes, "o, yo");
  EXPECT_EQ(HashAssetFile(part_, 10).value(), HashBytes("hello, you"));
}

TEST_F(AssetFileTest, ThatItIsUsedIsSeen) {
  using namespace std::chrono_literals;
  std::ofstream(whole_) << "hello";
  const auto before = std::filesystem::last_write_time(whole_) - 24h;
  std::filesystem::last_write_time(whole_, before);
  TouchAssetFile(whole_);
  EXPECT_GT(std::filesystem::last_write_time(whole_), before + 23h);
}

TEST_F(AssetFileTest, WhatCannotBeReadIsNotTakenForMissing) {
  std::ofstream(whole_) << "hello";
  const DiskCalls fails([](DiskCall) { return EIO; });
  EXPECT_TRUE(absl::IsUnavailable(ReadAssetFile(whole_, 0, 5).status()));
  EXPECT_TRUE(absl::IsUnavailable(HashAssetFile(whole_, 5).status()));
}

TEST_F(AssetFileTest, WhatIsShorterOrNotThereIsOutOfRange) {
  std::ofstream(whole_) << "hello";
  for (const std::string& path : {whole_, part_}) {
    EXPECT_TRUE(absl::IsOutOfRange(ReadAssetFile(path, 3, 3).status())) << path;
    EXPECT_TRUE(absl::IsOutOfRange(HashAssetFile(path, 6).status())) << path;
  }
}

TEST_F(AssetFileTest, ALinkIsNotFollowed) {
  std::ofstream(folder_ + "/elsewhere") << "hello";
  std::filesystem::create_symlink(folder_ + "/elsewhere", whole_);
  EXPECT_TRUE(absl::IsUnavailable(ReadAssetFile(whole_, 0, 5).status()));
  EXPECT_TRUE(absl::IsUnavailable(HashAssetFile(whole_, 5).status()));
  EXPECT_TRUE(absl::IsUnavailable(AssetFile::Open(whole_, true).status()));
  EXPECT_EQ(Read(folder_ + "/elsewhere"), "hello");
}

// 3.5 MiB of "a": more than is hashed at once. The hash is from sha256sum.
TEST_F(AssetFileTest, WhatIsLargeIsHashedWhole) {
  constexpr uint64_t kBytes = 3'670'016;
  std::ofstream(whole_) << std::string(kBytes, 'a') << "and what comes behind";
  const auto hash = HashAssetFile(whole_, kBytes);
  ASSERT_TRUE(hash.ok()) << hash.status();
  EXPECT_EQ(absl::BytesToHexString(*hash),
            "34c8bdd269f89a091cf17d5d23503940e0abf61c4b6544e42854b9af437f31bb");
}

// An asset that cannot be kept stays under its previous path, so that another upload can continue
// it.
class AssetFileKept : public AssetFileTest {
 protected:
  void ExpectNotKept(absl::StatusCode code, AssetFile& file) {
    const absl::Status status = file.Keep(whole_);
    EXPECT_EQ(status.code(), code) << status;
    ExpectAsItWas();
  }
  void ExpectAsItWas() {
    EXPECT_TRUE(std::filesystem::exists(std::filesystem::symlink_status(part_)));
    EXPECT_FALSE(std::filesystem::exists(std::filesystem::symlink_status(whole_)));
  }
};

TEST_F(AssetFileKept, WhereTheDiskDoesNotTakeItsBytes) {
  ASSERT_EQ(mkfifo(part_.c_str(), 0600), 0);  // which cannot be synced to a disk
  const Descriptor reads(open(part_.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC));
  ASSERT_TRUE(reads.ok());
  auto file = AssetFile::Open(part_, false);
  ASSERT_TRUE(file.ok()) << file.status();
  ExpectNotKept(absl::StatusCode::kUnavailable, *file);
}

TEST_F(AssetFileKept, WhereThereIsNoDescriptorForItsFolder) {
  auto file = AssetFile::Open(part_, true);
  ASSERT_TRUE(file.ok());
  rlimit before;
  ASSERT_EQ(getrlimit(RLIMIT_NOFILE, &before), 0);
  const rlimit none{0, before.rlim_max};
  ASSERT_EQ(setrlimit(RLIMIT_NOFILE, &none), 0);
  const absl::Status status = file->Keep(whole_);
  ASSERT_EQ(setrlimit(RLIMIT_NOFILE, &before), 0);
  EXPECT_TRUE(absl::IsResourceExhausted(status)) << status;
  ExpectAsItWas();
}

TEST_F(AssetFileKept, WhereTheDiskDoesNotTakeItsName) {
  auto file = AssetFile::Open(part_, true);
  ASSERT_TRUE(file.ok());
  {
    const DiskCalls fails([](DiskCall call) { return call == DiskCall::kSync ? EIO : 0; });
    ExpectNotKept(absl::StatusCode::kUnavailable, *file);
  }
  EXPECT_TRUE(file->Keep(whole_).ok()) << "the disk accepts it now";
  EXPECT_TRUE(std::filesystem::exists(whole_));
  EXPECT_FALSE(std::filesystem::exists(part_));
  EXPECT_TRUE(file->Keep(part_).ok()) << "and is known by it";
  EXPECT_FALSE(std::filesystem::exists(whole_));
}

TEST_F(AssetFileKept, WhereAFolderHasItsName) {
  auto file = AssetFile::Open(part_, true);
  ASSERT_TRUE(file.ok());
  std::filesystem::create_directory(whole_);
  EXPECT_TRUE(absl::IsUnavailable(file->Keep(whole_)));
  EXPECT_TRUE(std::filesystem::exists(part_));
}

}  // namespace
}  // namespace voxeld::daemon::assets
