// Tests a folder of assets that other programs have changed, and a disk that fails.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <spdlog/sinks/ostream_sink.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <latch>
#include <sstream>
#include <thread>
#include <utility>
#include <vector>

#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"
#include "daemon/assets/asset_store.h"
#include "display/sync/fake_clock.h"
#include "tests/daemon/assets/disk_calls.h"

namespace voxeld::daemon::assets {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

// By sha256sum.
const std::string kAbcName = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad";
const std::string kAbcDigest = absl::HexStringToBytes(kAbcName);
const std::string kHelloName = "2cf24dba5fb0a30e26e83b2ac5b9e29e1b161e5c1fa7425e73043362938b9824";
const std::string kHelloDigest = absl::HexStringToBytes(kHelloName);
constexpr uint64_t kLeast = AssetStore::kLeastCost;

class AssetFolder : public ::testing::Test {
 protected:
  AssetFolder() {
    fs::remove_all(folder_);
    fs::create_directory(folder_);
  }
  ~AssetFolder() override { fs::remove_all(folder_); }

  void Open(uint64_t max_bytes = 10 * kLeast) {
    store_.reset();
    store_ = AssetStore::Open(folder_, {.max_asset_bytes = 2 * kLeast, .max_bytes = max_bytes},
                              clock_, &log_);
  }
  void Put(const std::string& name, const std::string& bytes) const {
    std::ofstream(folder_ + "/" + name) << bytes;
  }
  std::string Read(const std::string& name) const {
    std::ifstream file(folder_ + "/" + name);
    return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
  }
  bool IsThere(const std::string& name) const {
    return fs::exists(fs::symlink_status(folder_ + "/" + name));
  }
  absl::Status Find(const std::string& digest, uint64_t size) {
    return store_->FindAsset(digest, 0, size).status();
  }
  absl::Status Upload(const std::string& digest, const std::string& bytes) {
    const auto upload = store_->Begin(digest, bytes.size(), 0);
    if (!upload.ok()) return upload.status();
    if (absl::Status status = store_->Append(*upload, 0, bytes); !status.ok()) return status;
    return store_->Finish(*upload).status();
  }
  // The least recently used asset is removed to reserve room for an upload, which is then
  // abandoned.
  void PushOut() {
    const auto other = store_->Begin(std::string(32, 'x'), 1, 0);
    ASSERT_TRUE(other.ok()) << other.status();
    store_->Abandon(*other);
  }
  AssetState StateOf(const std::string& digest) const { return store_->List({&digest, 1}).front(); }

  const std::string folder_ = absl::StrCat(::testing::TempDir(), "/voxeld-folder-", getpid());
  sync::FakeClock clock_;
  std::ostringstream logged_;
  Logger log_{Logger::Level::kInfo, Logger::Format::kText,
              std::make_shared<spdlog::sinks::ostream_sink_mt>(logged_, true)};
  std::unique_ptr<AssetStore> store_;
};

TEST_F(AssetFolder, WhatHasAnotherNameIsLeftAlone) {
  std::vector<std::string> names;
  for (const char odd : {'A', 'F', 'G', 'g', 'z', '-', ':', '`'}) {
    std::string name = kAbcName;
    name[63] = odd;
    names.push_back(name);
  }
  for (const std::string& name : {kAbcName.substr(1), kAbcName + "0", kAbcName + ".part2",
                                  kAbcName + ".PART", std::string(".part"), "x" + kAbcName}) {
    names.push_back(name);
  }
  for (const std::string& name : names) Put(name, "");
  Open();
  EXPECT_THAT(store_->ListAll(), IsEmpty());
  for (const std::string& name : names) EXPECT_TRUE(IsThere(name)) << name;
}

TEST_F(AssetFolder, WhatIsNoFileIsNoAsset) {
  fs::create_directory(folder_ + "/" + kHelloName);
  Put("elsewhere", "abd");
  fs::create_symlink("elsewhere", folder_ + "/" + kAbcName);
  fs::create_symlink("nowhere", folder_ + "/" + std::string(64, '0'));
  Open();
  EXPECT_THAT(store_->ListAll(), IsEmpty());
  EXPECT_TRUE(Upload(kAbcDigest, "abc").ok()) << "a link does not prevent it";
  EXPECT_TRUE(Find(kAbcDigest, 3).ok());
  EXPECT_EQ(Read("elsewhere"), "abd");
  EXPECT_TRUE(absl::IsUnavailable(Upload(kHelloDigest, "hello"))) << "a folder has its name";
  EXPECT_FALSE(StateOf(kHelloDigest).complete);
}

TEST_F(AssetFolder, AFileInItsPlaceIsNone) {
  for (const fs::perms mode : {fs::perms{0600}, fs::perms{0700}}) {
    fs::remove_all(folder_);
    std::ofstream(folder_) << "mine";
    fs::permissions(folder_, mode);
    Open();
    EXPECT_THAT(store_->figures().trouble, HasSubstr(folder_));
    EXPECT_THAT(std::move(logged_).str(), HasSubstr("the folder of assets cannot be used"));
    logged_.str("");
    EXPECT_TRUE(Upload(kAbcDigest, "abc").ok()) << "in memory";
    EXPECT_TRUE(Find(kAbcDigest, 3).ok());
    EXPECT_EQ(fs::file_size(folder_), 4u);
  }
}

TEST_F(AssetFolder, OfAWholeOneAndItsPartTheWholeStays) {
  using namespace std::chrono_literals;
  for (const auto later : {-60s, 60s}) {
    Put(kAbcName, "abc");
    Put(kAbcName + ".part", "ab");
    const std::string path = folder_ + "/" + kAbcName;
    fs::last_write_time(path + ".part", fs::last_write_time(path) + later);
    Open();
    EXPECT_TRUE(StateOf(kAbcDigest).complete);
    EXPECT_EQ(store_->figures().bytes, kLeast);
    EXPECT_FALSE(IsThere(kAbcName + ".part"));
    EXPECT_TRUE(Find(kAbcDigest, 3).ok());
  }
  Put(kAbcName, "");
  Put(kAbcName + ".part", "ab");
  Open();
  EXPECT_FALSE(IsThere(kAbcName)) << "nothing was written of it";
  EXPECT_EQ(StateOf(kAbcDigest).stored, 2u);
}

TEST_F(AssetFolder, LessForAllIsTheLimitOfOne) {
  Open(kLeast);
  const auto begun = store_->Begin(kAbcDigest, kLeast + 1, 0);
  EXPECT_TRUE(absl::IsInvalidArgument(begun.status()));
  EXPECT_THAT(std::string(begun.status().message()),
              HasSubstr("an asset has 1 to 4096 bytes, which is max_assets_bytes"));
}

TEST_F(AssetFolder, WhoWasSilentForLongestGivesWay) {
  store_ = AssetStore::Open(folder_, {.max_uploads = 3}, clock_, nullptr);
  std::vector<AssetStore::UploadId> uploads;
  for (const char c : {'1', '2', '3'}) {
    uploads.push_back(store_->Begin(std::string(32, c), 1, 0).value());
    clock_.Advance(1);
  }
  store_->Heard(uploads[0]);
  store_->Heard(uploads[2]);
  clock_.Advance(30 * sync::kSecond);
  ASSERT_TRUE(store_->Begin(kAbcDigest, 3, 0).ok());
  EXPECT_TRUE(store_->Append(uploads[0], 0, "x").ok());
  EXPECT_TRUE(absl::IsAborted(store_->Append(uploads[1], 0, "x")));
  EXPECT_TRUE(store_->Append(uploads[2], 0, "x").ok());
}

TEST_F(AssetFolder, WhatTheDiskDoesNotKeepStaysAPart) {
  Open();
  for (const DiskCall failing : {DiskCall::kRead, DiskCall::kSync}) {
    {
      const DiskCalls fails([=](DiskCall call) { return call == failing ? EIO : 0; });
      const absl::Status status = Upload(kAbcDigest, "abc");
      EXPECT_TRUE(absl::IsUnavailable(status)) << status;
      EXPECT_THAT(std::string(status.message()), HasSubstr(absl::StrCat("asset ", kAbcName)));
    }
    EXPECT_EQ(StateOf(kAbcDigest).stored, 3u);
    EXPECT_FALSE(StateOf(kAbcDigest).complete);
    EXPECT_FALSE(IsThere(kAbcName));
    EXPECT_EQ(Read(kAbcName + ".part"), "abc");
  }
  EXPECT_EQ(store_->figures().uploaded, 0u);
  EXPECT_TRUE(Upload(kAbcDigest, "abc").ok());
  EXPECT_TRUE(Find(kAbcDigest, 3).ok());
}

TEST_F(AssetFolder, WhatCannotBeReadNowIsNotDamaged) {
  Put(kAbcName, "abc");
  Open();
  for (const bool checked : {false, true}) {
    {
      const DiskCalls fails([](DiskCall) { return EIO; });
      EXPECT_TRUE(absl::IsUnavailable(Find(kAbcDigest, 3))) << checked;
      const absl::Status begun = store_->Begin(kAbcDigest, 3, 0).status();
      if (checked) {
        EXPECT_TRUE(absl::IsAlreadyExists(begun));
      } else {
        EXPECT_TRUE(absl::IsUnavailable(begun));
        EXPECT_THAT(std::string(begun.message()), HasSubstr(absl::StrCat("asset ", kAbcName)));
      }
    }
    EXPECT_TRUE(Find(kAbcDigest, 3).ok()) << checked;
  }
  EXPECT_EQ(store_->figures().damaged, 0u);
}

TEST_F(AssetFolder, WhatIsDamagedOrTakenAwayIsLogged) {
  Put(kAbcName, "abd");
  Put(kHelloName, "hello");
  Open();
  fs::remove(folder_ + "/" + kHelloName);
  EXPECT_TRUE(absl::IsNotFound(Find(kAbcDigest, 3)));
  EXPECT_THAT(logged_.str(), HasSubstr("an asset was damaged, and is gone sha256=" + kAbcName));
  EXPECT_TRUE(absl::IsNotFound(Find(kHelloDigest, 5)));
  EXPECT_THAT(logged_.str(), HasSubstr("sha256=" + kHelloName));
  EXPECT_EQ(store_->figures().damaged, 2u);
  EXPECT_THAT(store_->ListAll(), IsEmpty());
  EXPECT_TRUE(fs::is_empty(folder_));
}

TEST_F(AssetFolder, MayBePushedOutWhileItIsHashed) {
  for (const bool again : {false, true}) {
    Put(kAbcName, "abc");
    Open(kLeast);
    bool first = true;
    AssetStore::UploadId part = 0;
    const DiskCalls meanwhile([&](DiskCall call) {
      if (call != DiskCall::kRead || !std::exchange(first, false)) return 0;
      PushOut();
      if (again) {
        part = store_->Begin(kAbcDigest, 3, 0).value();
        EXPECT_TRUE(store_->Append(part, 0, "ab").ok());
      }
      return 0;
    });
    const absl::Status found = Find(kAbcDigest, 3);
    EXPECT_TRUE(absl::IsNotFound(found)) << found;
    EXPECT_THAT(std::string(found.message()), HasSubstr("gone meanwhile"));
    EXPECT_EQ(store_->figures().damaged, 0u);
    if (!again) continue;
    EXPECT_EQ(StateOf(kAbcDigest).stored, 2u);
    EXPECT_TRUE(store_->Append(part, 2, "c").ok());
    EXPECT_TRUE(store_->Finish(part).ok());
    EXPECT_TRUE(Find(kAbcDigest, 3).ok());
  }
}

TEST_F(AssetFolder, WhatIsBroughtAnewIsNotDamagedWithWhatWas) {
  Open(kLeast);
  ASSERT_TRUE(Upload(kAbcDigest, "abc").ok());
  bool first = true;
  const DiskCalls meanwhile([&](DiskCall call) {
    if (call != DiskCall::kRead || !std::exchange(first, false)) return 0;
    fs::resize_file(folder_ + "/" + kAbcName, 1);
    PushOut();
    EXPECT_TRUE(Upload(kAbcDigest, "abc").ok());
    return 0;
  });
  EXPECT_TRUE(absl::IsNotFound(Find(kAbcDigest, 3)));
  EXPECT_FALSE(first);
  EXPECT_EQ(store_->figures().damaged, 0u);
  const auto found = store_->FindAsset(kAbcDigest, 0, 3);
  ASSERT_TRUE(found.ok()) << found.status();
  EXPECT_EQ(found->bytes, "abc");
}

// One asset is hashed at a time; a caller that waited finds out whether its own is still there.
TEST_F(AssetFolder, MayBePushedOutWhileAnotherIsHashed) {
  Put(kAbcName, "abc");
  Put(kHelloName, "hello");
  Open(2 * kLeast);
  std::latch hashing(1), gone(1);
  std::atomic<bool> first = true;
  const DiskCalls waits([&](DiskCall call) {
    if (call != DiskCall::kRead || !first.exchange(false)) return 0;
    hashing.count_down();
    gone.wait();
    return 0;
  });
  absl::Status hello, abc;
  std::thread hashes([&] { hello = Find(kHelloDigest, 5); });
  hashing.wait();
  std::thread asks([&] { abc = Find(kAbcDigest, 3); });
  while (store_->ListAll().front().digest != kAbcDigest) std::this_thread::yield();
  EXPECT_TRUE(store_->Begin(std::string(32, 'x'), 2 * kLeast, 0).ok());
  gone.count_down();
  hashes.join();
  asks.join();
  EXPECT_TRUE(absl::IsNotFound(hello)) << hello;
  EXPECT_TRUE(absl::IsNotFound(abc)) << abc;
  EXPECT_EQ(store_->figures().damaged, 0u);
  EXPECT_EQ(logged_.str(), "");
}

}  // namespace
}  // namespace voxeld::daemon::assets
