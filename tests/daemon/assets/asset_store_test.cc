// What is kept by its hash: uploads that break off, what goes when room is needed, and what a folder
// has that is not as it was.
#include "daemon/assets/asset_store.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <unistd.h>

#include <csignal>
#include <filesystem>
#include <fstream>

#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"
#include "display/sync/fake_clock.h"

namespace voxeld::daemon::assets {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

// By sha256sum, not by the code under test.
struct Content {
  const char* bytes;
  const char* sha256;
  std::string digest() const { return absl::HexStringToBytes(sha256); }
};
constexpr Content kAbc = {"abc",
                          "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"};
constexpr Content kHello = {"hello",
                            "2cf24dba5fb0a30e26e83b2ac5b9e29e1b161e5c1fa7425e73043362938b9824"};
constexpr Content kWorld = {"world",
                            "486ea46224d1bb4fb680f34f7c9ad96a8f24ec88be73ea8e5a6c65260e9cb8a7"};

class AssetStoreTest : public ::testing::TestWithParam<bool> {
 protected:
  AssetStoreTest() {
    std::filesystem::remove_all(folder_);
    Open();
  }
  ~AssetStoreTest() override { std::filesystem::remove_all(folder_); }

  // Again, as after an end.
  void Open(AssetLimits limits = {.max_asset_bytes = 10, .max_bytes = 12, .max_uploads = 3}) {
    store_.reset();
    auto opened = AssetStore::Open(on_disk() ? folder_ : "", limits, clock_, nullptr);
    ASSERT_TRUE(opened.ok()) << opened.status();
    store_ = *std::move(opened);
  }
  bool on_disk() const { return GetParam(); }

  void Upload(const Content& content) {
    const std::string_view bytes = content.bytes;
    const auto upload = store_->Begin(content.digest(), bytes.size(), 0);
    ASSERT_TRUE(upload.ok()) << upload.status();
    ASSERT_TRUE(store_->Append(*upload, 0, bytes.substr(0, 2)).ok());
    ASSERT_TRUE(store_->Append(*upload, 2, bytes.substr(2)).ok());
    const auto size = store_->Finish(*upload);
    ASSERT_TRUE(size.ok()) << size.status();
    EXPECT_EQ(*size, bytes.size());
  }
  std::string Find(const Content& content) {
    const auto found =
        store_->FindAsset(content.digest(), 0, std::string_view(content.bytes).size());
    return found.ok() ? std::string(found->bytes) : std::string(found.status().message());
  }
  std::vector<std::string> Files() const {
    std::vector<std::string> names;
    for (const auto& file : std::filesystem::directory_iterator(folder_)) {
      names.push_back(file.path().filename());
    }
    return names;
  }

  const std::string folder_ = absl::StrCat(::testing::TempDir(), "/voxeld-assets-", getpid());
  sync::FakeClock clock_;
  std::unique_ptr<AssetStore> store_;
};

INSTANTIATE_TEST_SUITE_P(In, AssetStoreTest, ::testing::Bool(),
                         [](const auto& info) { return info.param ? "AFolder" : "Memory"; });

TEST_P(AssetStoreTest, WhatCameIsFoundByItsHash) {
  Upload(kAbc);
  EXPECT_EQ(Find(kAbc), "abc");
  const auto part = store_->FindAsset(kAbc.digest(), 1, 2);
  ASSERT_TRUE(part.ok());
  EXPECT_EQ(part->bytes, "bc");
  EXPECT_THAT(Find(kHello), HasSubstr("which is not here"));
  const auto beyond = store_->FindAsset(kAbc.digest(), 1, 3);
  EXPECT_TRUE(absl::IsOutOfRange(beyond.status()));
  EXPECT_THAT(std::string(beyond.status().message()), HasSubstr("is 3 from 1 on; the asset has 3"));
  EXPECT_TRUE(absl::IsOutOfRange(store_->FindAsset(kAbc.digest(), ~uint64_t{0}, 2).status()));
  EXPECT_TRUE(absl::IsAlreadyExists(store_->Begin(kAbc.digest(), 3, 0).status()));
  EXPECT_EQ(store_->figures().count, 1u);
  EXPECT_EQ(store_->figures().bytes, 3u);
  EXPECT_EQ(store_->figures().bytes_in, 3u);
}

TEST_P(AssetStoreTest, AnUploadGoesOnWhereItBrokeOff) {
  const auto first = store_->Begin(kHello.digest(), 5, 0);
  ASSERT_TRUE(first.ok());
  ASSERT_TRUE(store_->Append(*first, 0, "hel").ok());
  store_->Abandon(*first);
  EXPECT_THAT(Find(kHello), HasSubstr("not whole: 3 bytes are here"));

  const auto wrong = store_->Begin(kHello.digest(), 5, 2);
  EXPECT_TRUE(absl::IsOutOfRange(wrong.status()));
  EXPECT_THAT(std::string(wrong.status().message()), HasSubstr("offset is 2, and 3 bytes"));
  const auto second = store_->Begin(kHello.digest(), 5, 3);
  ASSERT_TRUE(second.ok()) << second.status();
  EXPECT_TRUE(absl::IsOutOfRange(store_->Append(*second, 0, "lo")));
  EXPECT_TRUE(absl::IsOutOfRange(store_->Append(*second, 3, "lo!")));
  ASSERT_TRUE(store_->Append(*second, 3, "lo").ok());
  ASSERT_TRUE(store_->Finish(*second).ok());
  EXPECT_EQ(Find(kHello), "hello");
}

TEST_P(AssetStoreTest, AnEndTooEarlyLeavesWhatCame) {
  const auto upload = store_->Begin(kHello.digest(), 5, 0);
  ASSERT_TRUE(store_->Append(*upload, 0, "hell").ok());
  const auto finished = store_->Finish(*upload);
  EXPECT_TRUE(absl::IsOutOfRange(finished.status()));
  EXPECT_THAT(std::string(finished.status().message()), HasSubstr("after 4 of 5 bytes"));
  EXPECT_EQ(store_->List(std::vector{kHello.digest()}).front().stored, 4u);
}

TEST_P(AssetStoreTest, WhatHasAnotherHashIsNotKept) {
  const auto upload = store_->Begin(kHello.digest(), 5, 0);
  ASSERT_TRUE(store_->Append(*upload, 0, "hallo").ok());
  const auto finished = store_->Finish(*upload);
  EXPECT_TRUE(absl::IsDataLoss(finished.status()));
  EXPECT_THAT(std::string(finished.status().message()), HasSubstr(kHello.sha256));
  EXPECT_THAT(store_->ListAll(), IsEmpty());
  EXPECT_EQ(store_->figures().bytes, 0u);
  Upload(kHello);
  EXPECT_EQ(Find(kHello), "hello");
}

TEST_P(AssetStoreTest, WhatWasUsedLeastRecentlyGoes) {
  Upload(kAbc);
  Upload(kHello);
  EXPECT_EQ(Find(kAbc), "abc");  // so hello is the older one
  const auto kept = store_->FindAsset(kHello.digest(), 0, 5);
  Find(kAbc);
  Upload(kWorld);  // 3 + 5 + 5 is beyond 12
  EXPECT_THAT(Find(kHello), HasSubstr("not here"));
  EXPECT_EQ(Find(kAbc), "abc");
  EXPECT_EQ(Find(kWorld), "world");
  EXPECT_EQ(kept->bytes, "hello") << "whoever has it keeps it";
  EXPECT_EQ(store_->figures().evicted, 1u);
  const std::vector<AssetState> all = store_->ListAll();
  ASSERT_EQ(all.size(), 2u);
  EXPECT_EQ(all.front().digest, kWorld.digest());
}

TEST_P(AssetStoreTest, UploadsUnderWayAreNotPushedOut) {
  const auto slow = store_->Begin(kHello.digest(), 10, 0);
  ASSERT_TRUE(slow.ok());
  const auto large = store_->Begin(kWorld.digest(), 5, 0);
  EXPECT_TRUE(absl::IsResourceExhausted(large.status()));
  EXPECT_THAT(std::string(large.status().message()),
              HasSubstr("5 bytes more do not fit beside 10 of uploads under way"));
  clock_.Advance(10 * sync::kSecond);  // and brought nothing
  EXPECT_TRUE(store_->Begin(kWorld.digest(), 5, 0).ok());
  EXPECT_TRUE(absl::IsAborted(store_->Append(*slow, 0, "x")));
}

TEST_P(AssetStoreTest, OneUploadOfAContentAtATime) {
  const auto first = store_->Begin(kHello.digest(), 5, 0);
  const auto second = store_->Begin(kHello.digest(), 5, 0);
  EXPECT_TRUE(absl::IsAborted(second.status()));
  clock_.Advance(10 * sync::kSecond - 1);
  EXPECT_TRUE(absl::IsAborted(store_->Begin(kHello.digest(), 5, 0).status()));
  clock_.Advance(1);
  EXPECT_TRUE(store_->Begin(kHello.digest(), 5, 0).ok());
  EXPECT_TRUE(absl::IsAborted(store_->Append(*first, 0, "hello")));
  EXPECT_TRUE(absl::IsAborted(store_->Finish(*first).status()));
}

TEST_P(AssetStoreTest, SoManyAtOnceAndNoMore) {
  std::string digest(32, '\0');
  for (int i = 0; i < 3; ++i) {
    digest[0] = static_cast<char>(i);
    ASSERT_TRUE(store_->Begin(digest, 1, 0).ok());
  }
  EXPECT_TRUE(absl::IsResourceExhausted(store_->Begin(kAbc.digest(), 3, 0).status()));
  clock_.Advance(10 * sync::kSecond);
  EXPECT_TRUE(store_->Begin(kAbc.digest(), 3, 0).ok());
}

TEST_P(AssetStoreTest, SizesHaveLimits) {
  for (const uint64_t size : {uint64_t{0}, uint64_t{11}, ~uint64_t{0}}) {
    const auto begun = store_->Begin(kAbc.digest(), size, 0);
    EXPECT_TRUE(absl::IsInvalidArgument(begun.status())) << size;
    EXPECT_THAT(std::string(begun.status().message()), HasSubstr("an asset has 1 to 10 bytes"));
  }
  EXPECT_THAT(store_->ListAll(), IsEmpty());
}

using AssetFolderTest = AssetStoreTest;
INSTANTIATE_TEST_SUITE_P(In, AssetFolderTest, ::testing::Values(true),
                         [](const auto&) { return "AFolder"; });

TEST_P(AssetFolderTest, OutlivesItsEnd) {
  Upload(kAbc);
  const auto upload = store_->Begin(kHello.digest(), 5, 0);
  ASSERT_TRUE(store_->Append(*upload, 0, "hel").ok());
  std::ofstream(folder_ + "/README") << "not one of ours";
  Open();
  EXPECT_EQ(Find(kAbc), "abc");
  EXPECT_EQ(store_->List(std::vector{kHello.digest()}).front().stored, 3u);
  const auto more = store_->Begin(kHello.digest(), 5, 3);
  ASSERT_TRUE(more.ok());
  ASSERT_TRUE(store_->Append(*more, 3, "lo").ok());
  ASSERT_TRUE(store_->Finish(*more).ok());
  EXPECT_EQ(Find(kHello), "hello");
  EXPECT_THAT(Files(), ::testing::UnorderedElementsAre(kAbc.sha256, kHello.sha256, "README"));
}

TEST_P(AssetFolderTest, WhatWasUsedIsRememberedOverTheEnd) {
  Upload(kAbc);
  Upload(kHello);
  using namespace std::chrono_literals;  // as if abc had been used a minute later
  const auto at = std::filesystem::last_write_time(folder_ + "/" + kHello.sha256);
  std::filesystem::last_write_time(folder_ + "/" + kAbc.sha256, at + 1min);
  Open({.max_asset_bytes = 10, .max_bytes = 7, .max_uploads = 3});
  EXPECT_THAT(Files(), ElementsAre(kAbc.sha256)) << "less room than there was";
  EXPECT_EQ(store_->figures().evicted, 1u);
}

TEST_P(AssetFolderTest, WhatIsDamagedIsNeverGivenOut) {
  Upload(kAbc);
  std::ofstream(folder_ + "/" + kAbc.sha256) << "abd";
  Open();
  EXPECT_THAT(Find(kAbc), HasSubstr("damaged on the disk"));
  EXPECT_THAT(Find(kAbc), HasSubstr("not here"));
  EXPECT_EQ(store_->figures().damaged, 1u);
  EXPECT_THAT(Files(), IsEmpty());
  Upload(kAbc);
  EXPECT_EQ(Find(kAbc), "abc");
}

TEST_P(AssetFolderTest, ShorterThanItWasIsAnError) {
  Upload(kAbc);
  std::filesystem::resize_file(folder_ + "/" + kAbc.sha256, 1);
  EXPECT_THAT(Find(kAbc), HasSubstr("shorter than it was"));
}

TEST_P(AssetFolderTest, ADiskThatIsFullIsSaidAndWhatCameStays) {
  std::signal(SIGXFSZ, SIG_IGN);
  const auto upload = store_->Begin(kHello.digest(), 5, 0);
  ASSERT_TRUE(store_->Append(*upload, 0, "hel").ok());
  rlimit before;
  ASSERT_EQ(getrlimit(RLIMIT_FSIZE, &before), 0);
  rlimit small = before;
  small.rlim_cur = 3;
  ASSERT_EQ(setrlimit(RLIMIT_FSIZE, &small), 0);
  const absl::Status full = store_->Append(*upload, 3, "lo");
  ASSERT_EQ(setrlimit(RLIMIT_FSIZE, &before), 0);
  EXPECT_TRUE(absl::IsResourceExhausted(full)) << full;
  EXPECT_THAT(std::string(full.message()), HasSubstr(absl::StrCat("asset ", kHello.sha256)));
  EXPECT_EQ(store_->List(std::vector{kHello.digest()}).front().stored, 3u);
  EXPECT_TRUE(store_->Begin(kHello.digest(), 5, 3).ok()) << "there is room again";
}

TEST(AssetStore, AFolderThatCannotBeUsedIsAnError) {
  sync::FakeClock clock;
  const auto store = AssetStore::Open("/proc/voxeld-assets", {}, clock, nullptr);
  EXPECT_TRUE(absl::IsUnavailable(store.status()));
  EXPECT_THAT(std::string(store.status().message()), HasSubstr("/proc/voxeld-assets"));
}

}  // namespace
}  // namespace voxeld::daemon::assets
