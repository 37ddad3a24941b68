// Tests assets stored by their hash: interrupted uploads, eviction when room is needed, and a
// folder whose files have changed.
#include "daemon/assets/asset_store.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <unistd.h>

#include <atomic>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <thread>

#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"
#include "display/sync/fake_clock.h"

namespace voxeld::daemon::assets {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

// The hashes are from sha256sum, not from the code under test.
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

  // Opens it again, as after a restart.
  void Open(AssetLimits limits = {
                .max_asset_bytes = 10, .max_bytes = 4 * kSmall, .max_uploads = 3}) {
    store_.reset();
    store_ = AssetStore::Open(on_disk() ? folder_ : "", limits, clock_, nullptr);
    EXPECT_EQ(store_->figures().trouble, "");
  }
  // The part of the budget that a small asset takes.
  static constexpr uint64_t kSmall = AssetStore::kLeastCost;
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
  EXPECT_EQ(store_->figures().bytes, kSmall);
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
  EXPECT_TRUE(absl::IsInvalidArgument(store_->Append(*second, 3, "")));
  ASSERT_TRUE(store_->Append(*second, 3, "lo").ok());
  ASSERT_TRUE(store_->Finish(*second).ok());
  EXPECT_EQ(Find(kHello), "hello");
}

TEST_P(AssetStoreTest, AnUploadThatHasEndedIsNone) {
  Upload(kAbc);
  const auto first = store_->Begin(kHello.digest(), 5, 0);
  ASSERT_TRUE(first.ok());
  ASSERT_TRUE(store_->Append(*first, 0, "hel").ok());
  store_->Abandon(*first);
  const auto second = store_->Begin(kHello.digest(), 5, 3);
  ASSERT_TRUE(second.ok());
  clock_.Advance(30 * sync::kSecond);
  store_->Heard(*first);  // has no effect on the second
  store_->Abandon(*first);
  EXPECT_TRUE(absl::IsAborted(store_->Append(*first, 3, "lo")));
  EXPECT_TRUE(absl::IsAborted(store_->Finish(*first).status()));
  EXPECT_TRUE(store_->Append(*second, 3, "lo").ok()) << "its place was not taken";
  const std::vector<AssetState> states =
      store_->List(std::vector{kWorld.digest(), kAbc.digest(), kHello.digest()});
  EXPECT_THAT(states, ElementsAre(::testing::FieldsAre(kWorld.digest(), 0u, false),
                                  ::testing::FieldsAre(kAbc.digest(), 3u, true),
                                  ::testing::FieldsAre(kHello.digest(), 5u, false)));
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
  Open({.max_asset_bytes = 10, .max_bytes = 2 * kSmall});
  Upload(kAbc);
  Upload(kHello);
  EXPECT_EQ(Find(kAbc), "abc");  // so hello is the older one
  const auto kept = store_->FindAsset(kHello.digest(), 0, 5);
  Find(kAbc);
  Upload(kWorld);  // two fit
  EXPECT_THAT(Find(kHello), HasSubstr("not here"));
  EXPECT_EQ(Find(kAbc), "abc");
  EXPECT_EQ(Find(kWorld), "world");
  EXPECT_EQ(kept->bytes, "hello") << "a holder keeps the bytes";
  EXPECT_EQ(store_->figures().evicted, 1u);
  const std::vector<AssetState> all = store_->ListAll();
  ASSERT_EQ(all.size(), 2u);
  EXPECT_EQ(all.front().digest, kWorld.digest());
}

TEST_P(AssetStoreTest, UploadsUnderWayAreNotPushedOut) {
  Open({.max_asset_bytes = 4 * kSmall, .max_bytes = 4 * kSmall});
  Upload(kAbc);
  const auto slow = store_->Begin(kHello.digest(), 2 * kSmall, 0);
  ASSERT_TRUE(slow.ok());
  const auto large = store_->Begin(kWorld.digest(), 3 * kSmall, 0);
  EXPECT_TRUE(absl::IsResourceExhausted(large.status()));
  EXPECT_THAT(std::string(large.status().message()),
              HasSubstr("12288 bytes more do not fit beside 8192 of 1 uploads under way"));
  EXPECT_EQ(Find(kAbc), "abc") << "a refused upload evicts nothing";
  clock_.Advance(20 * sync::kSecond);
  store_->Heard(*slow);  // bytes have arrived, and wait
  clock_.Advance(20 * sync::kSecond);
  EXPECT_FALSE(store_->Begin(kWorld.digest(), 3 * kSmall, 0).ok());
  clock_.Advance(10 * sync::kSecond);  // and nothing was stored
  EXPECT_TRUE(store_->Begin(kWorld.digest(), 3 * kSmall, 0).ok());
  EXPECT_TRUE(absl::IsAborted(store_->Append(*slow, 0, "x")));
}

TEST_P(AssetStoreTest, WhatWasPromisedAndDoesNotComeIsNoLongerKept) {
  Open({.max_asset_bytes = 4 * kSmall, .max_bytes = 4 * kSmall});
  const auto nothing = store_->Begin(kHello.digest(), 4 * kSmall, 0);
  ASSERT_TRUE(nothing.ok());
  EXPECT_EQ(store_->figures().bytes, 4 * kSmall);
  store_->Abandon(*nothing);
  EXPECT_EQ(store_->figures().bytes, 0u);
  EXPECT_THAT(store_->ListAll(), IsEmpty());
  const auto something = store_->Begin(kHello.digest(), 4 * kSmall, 0);
  ASSERT_TRUE(store_->Append(*something, 0, std::string(kSmall + 1, 'x')).ok());
  store_->Abandon(*something);
  EXPECT_EQ(store_->figures().bytes, kSmall + 1) << "what was stored alone";
  Upload(kAbc);
  EXPECT_EQ(store_->ListAll().size(), 2u);
}

TEST_P(AssetStoreTest, TheirNumberHasALimit) {
  Open({.max_asset_bytes = 10, .max_bytes = 100 * kSmall, .max_assets = 2});
  Upload(kAbc);
  Upload(kHello);
  Upload(kWorld);
  EXPECT_THAT(Find(kAbc), HasSubstr("not here"));
  EXPECT_EQ(store_->figures().count, 2u);
}

TEST_P(AssetStoreTest, APartOfAnotherSizeIsBegunAnew) {
  const auto first = store_->Begin(kHello.digest(), 9, 0);
  ASSERT_TRUE(store_->Append(*first, 0, "hello, x").ok());
  store_->Abandon(*first);
  const auto beyond = store_->Begin(kHello.digest(), 5, 8);
  EXPECT_TRUE(absl::IsOutOfRange(beyond.status()));
  EXPECT_THAT(std::string(beyond.status().message()),
              HasSubstr("8 bytes are here for a size of 5; begin anew at 0"));
  Upload(kHello);
  EXPECT_EQ(Find(kHello), "hello");
}

// Assets are named and evicted at the same time, by several threads.
TEST_P(AssetStoreTest, MayBeNamedWhileOthersGo) {
  Open({.max_asset_bytes = 10, .max_bytes = 2 * kSmall});
  std::atomic<bool> stop = false;
  std::vector<std::thread> readers;
  for (int i = 0; i < 3; ++i) {
    readers.emplace_back([&] {
      while (!stop) {
        for (const Content& content : {kAbc, kHello, kWorld}) {
          const auto found = store_->FindAsset(content.digest(), 1, 2);
          if (found.ok()) {
            EXPECT_EQ(found->bytes, std::string_view(content.bytes).substr(1, 2));
          } else {
            EXPECT_TRUE(absl::IsNotFound(found.status())) << found.status();
          }
          store_->figures();
        }
      }
    });
  }
  for (int i = 0; i < 100; ++i) {
    for (const Content& content : {kAbc, kHello, kWorld}) {
      const std::string_view bytes = content.bytes;
      const auto upload = store_->Begin(content.digest(), bytes.size(), 0);
      if (!upload.ok()) continue;  // it still exists
      EXPECT_TRUE(store_->Append(*upload, 0, bytes).ok());
      EXPECT_TRUE(store_->Finish(*upload).ok());
    }
  }
  stop = true;
  for (std::thread& reader : readers) reader.join();
  EXPECT_GE(store_->figures().evicted, 100u);
}

TEST_P(AssetStoreTest, OneUploadOfAContentAtATime) {
  const auto first = store_->Begin(kHello.digest(), 5, 0);
  const auto second = store_->Begin(kHello.digest(), 5, 0);
  EXPECT_TRUE(absl::IsAborted(second.status()));
  clock_.Advance(30 * sync::kSecond - 1);
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
  clock_.Advance(30 * sync::kSecond);
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
  Open({.max_asset_bytes = 10, .max_bytes = kSmall});
  EXPECT_THAT(Files(), ElementsAre(kAbc.sha256)) << "less room than before";
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

TEST_P(AssetFolderTest, WhatIsCutWhileItIsUsedCanBeBroughtAnew) {
  Upload(kAbc);
  std::filesystem::resize_file(folder_ + "/" + kAbc.sha256, 1);
  EXPECT_THAT(Find(kAbc), HasSubstr("damaged on the disk"));
  EXPECT_EQ(store_->figures().damaged, 1u);
  Upload(kAbc);
  EXPECT_EQ(Find(kAbc), "abc");
}

TEST_P(AssetFolderTest, WhatIsSaidToBeHereHasBeenLookedAt) {
  Upload(kAbc);
  std::ofstream(folder_ + "/" + kAbc.sha256) << "abd";
  Open();
  EXPECT_TRUE(store_->Begin(kAbc.digest(), 3, 0).ok()) << "not ALREADY_EXISTS";
}

TEST_P(AssetFolderTest, AnUploadThatWasKilledGoesOn) {
  const auto upload = store_->Begin(kHello.digest(), 5, 0);
  ASSERT_TRUE(store_->Append(*upload, 0, "hel").ok());
  // As SIGKILL leaves it: a part whose owner was silent, and one that has only just begun.
  std::filesystem::copy_file(folder_ + "/" + kHello.sha256 + ".part", folder_ + "/kept");
  store_.reset();
  std::filesystem::rename(folder_ + "/kept", folder_ + "/" + kHello.sha256 + ".part");
  std::ofstream(folder_ + "/" + kWorld.sha256 + ".part");
  Open();
  EXPECT_EQ(store_->List(std::vector{kHello.digest()}).front().stored, 3u);
  EXPECT_THAT(Files(), ElementsAre(std::string(kHello.sha256) + ".part")) << "empty, so removed";
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

TEST_P(AssetFolderTest, AFullDiskAtTheBeginningTakesNothing) {
  Upload(kAbc);
  rlimit before;
  ASSERT_EQ(getrlimit(RLIMIT_NOFILE, &before), 0);
  rlimit none = before;
  none.rlim_cur = 0;  // no descriptors are available
  ASSERT_EQ(setrlimit(RLIMIT_NOFILE, &none), 0);
  const auto begun = store_->Begin(kHello.digest(), 5, 0);
  ASSERT_EQ(setrlimit(RLIMIT_NOFILE, &before), 0);
  EXPECT_TRUE(absl::IsResourceExhausted(begun.status())) << begun.status();
  EXPECT_EQ(store_->figures().bytes, kSmall);
  EXPECT_EQ(Find(kAbc), "abc");
}

TEST(AssetStore, AFolderThatCannotBeUsedIsToldAndMemoryIsUsed) {
  sync::FakeClock clock;
  const auto store = AssetStore::Open("/proc/voxeld-assets", {}, clock, nullptr);
  EXPECT_THAT(store->figures().trouble, HasSubstr("/proc/voxeld-assets"));
  const auto upload = store->Begin(kAbc.digest(), 3, 0);
  ASSERT_TRUE(upload.ok());
  ASSERT_TRUE(store->Append(*upload, 0, "abc").ok());
  ASSERT_TRUE(store->Finish(*upload).ok());
  EXPECT_EQ(store->FindAsset(kAbc.digest(), 0, 3)->bytes, "abc");
}

}  // namespace
}  // namespace voxeld::daemon::assets
