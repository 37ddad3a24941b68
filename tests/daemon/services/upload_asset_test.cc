// Tests uploads that end while a part of them is under way: because they were told to, or because
// they ran out of memory.
#include <gmock/gmock.h>
#include <unistd.h>

#include <atomic>
#include <filesystem>
#include <latch>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"
#include "daemon/access/access.h"
#include "daemon/assets/asset_store.h"
#include "display/sync/fake_clock.h"
#include "tests/daemon/access/certificates.h"
#include "tests/daemon/assets/disk_calls.h"
#include "tests/daemon/services/daemon_fixture.h"

namespace voxeld::daemon::services {
namespace {

using assets::DiskCall;
using assets::DiskCalls;
using grpc::StatusCode;
using ::testing::HasSubstr;

// The hash is from sha256sum.
const std::string kHello = "hello";
const std::string kHelloDigest =
    absl::HexStringToBytes("2cf24dba5fb0a30e26e83b2ac5b9e29e1b161e5c1fa7425e73043362938b9824");

// A clock that stands still, and counts how often it is read.
class StandingClock final : public sync::Clock {
 public:
  sync::TimeNs Now() const override {
    ++asked_;
    return clock_.Now();
  }
  void WaitUntil(sync::Mutex& mutex, sync::CondVar& cv, sync::TimeNs deadline) override
      VOXELD_REQUIRES(mutex) {
    clock_.WaitUntil(mutex, cv, deadline);
  }
  void Advance(sync::TimeNs delta) { clock_.Advance(delta); }
  uint64_t asked() const { return asked_; }

 private:
  sync::FakeClock clock_;
  mutable std::atomic<uint64_t> asked_ = 0;
};

class UploadAsset : public ::testing::Test {
 protected:
  UploadAsset() {
    std::filesystem::remove_all(folder_);
    std::filesystem::create_directory(folder_);
    store_ = assets::AssetStore::Open(folder_ + "/assets", {}, clock_, nullptr);
  }
  ~UploadAsset() override {
    daemon_ = nullptr;
    std::filesystem::remove_all(folder_);
  }

  void Start(DaemonOptions options = {}) {
    options.assets = store_.get();
    daemon_ = std::make_unique<Daemon>(options);
  }
  // Starts the daemon with a token for uploads, which can be revoked.
  void StartWithToken() {
    PutGrants(absl::StrCat("[[token]]\nname = \"painter\"\nsha256 = \"", access::HashOf("painter"),
                           "\"\nscopes = [\"draw\"]\n"));
    access_ = std::make_unique<access::Access>(
        access::AccessOptions{.grants = folder_ + "/grants.toml",
                              .anonymous = *access::ParseScopes("none"),
                              .unix_users = *access::ParseScopes("view"),
                              .trusted = {}},
        access::Access::SystemWallClock(), nullptr);
    ASSERT_TRUE(access_->Look().ok());
    Start({.listen = {"127.0.0.1:0"}, .access = access_.get()});
    access_->SetOnChange([this] { daemon_->server().EndRevoked(); });
    painters_ = v1::SceneService::NewStub(grpc::CreateChannel(
        daemon_->server().addresses()[1].ToString(), grpc::InsecureChannelCredentials()));
  }
  // Revokes the token. When this returns, its calls have been told to end.
  void TakeTokenAway() {
    PutGrants("");
    ASSERT_TRUE(access_->Look(true).ok());
  }
  void PutGrants(const std::string& text) { access::PutFile(folder_ + "/grants.toml", text); }

  struct Call {
    explicit Call(v1::SceneService::Stub& scene) {
      SetDeadline(context);
      context.AddMetadata("authorization", "Bearer painter");
      writer = scene.UploadAsset(&context, &response);
    }
    bool Send(const std::string& bytes, uint64_t offset = 0) {
      v1::UploadAssetRequest request;
      request.set_sha256(kHelloDigest);
      request.set_size(kHello.size());
      request.set_offset(offset);
      request.set_data(bytes);
      return writer->Write(request);
    }
    grpc::Status End() {
      writer->WritesDone();
      return writer->Finish();
    }
    grpc::ClientContext context;
    v1::UploadAssetResponse response;
    std::unique_ptr<grpc::ClientWriter<v1::UploadAssetRequest>> writer;
  };

  assets::AssetState State() { return store_->List({&kHelloDigest, 1}).front(); }
  void AwaitStored(uint64_t bytes) {
    const sync::TimeNs patience = clock_.Now() + 60 * sync::kSecond;
    while (State().stored < bytes && clock_.Now() < patience) std::this_thread::yield();
    EXPECT_EQ(State().stored, bytes);
  }

  const std::string folder_ = absl::StrCat(::testing::TempDir(), "/voxeld-upload-", getpid());
  sync::SystemClock clock_;
  std::unique_ptr<assets::AssetStore> store_;
  std::unique_ptr<access::Access> access_;
  std::unique_ptr<Daemon> daemon_;
  std::unique_ptr<v1::SceneService::Stub> painters_;
};

// The first call of that kind waits until it is released.
class Held {
 public:
  explicit Held(DiskCall kind)
      : calls_([this, kind](DiskCall call) {
          if (call == kind && first_.exchange(false)) {
            began_.count_down();
            goes_on_.wait();
          }
          return 0;
        }) {}
  void AwaitBegun() { began_.wait(); }
  void GoOn() { goes_on_.count_down(); }

 private:
  std::atomic<bool> first_ = true;
  std::latch began_{1}, goes_on_{1};
  const DiskCalls calls_;
};

TEST_F(UploadAsset, ToldToEndWhileAPieceIsWrittenItReadsNoMore) {
  ASSERT_NO_FATAL_FAILURE(StartWithToken());
  Held disk(DiskCall::kWrite);
  Call call(*painters_);
  ASSERT_TRUE(call.Send("hel"));
  disk.AwaitBegun();
  TakeTokenAway();
  disk.GoOn();
  const grpc::Status status = call.writer->Finish();
  EXPECT_EQ(status.error_code(), StatusCode::UNAUTHENTICATED) << status.error_message();
  EXPECT_EQ(State().stored, 3u) << "what arrived before";
}

TEST_F(UploadAsset, ToldToEndAsItIsWholeItEndsOnce) {
  ASSERT_NO_FATAL_FAILURE(StartWithToken());
  Held disk(DiskCall::kRead);
  Call call(*painters_);
  ASSERT_TRUE(call.Send(kHello));
  ASSERT_TRUE(call.writer->WritesDone());
  disk.AwaitBegun();
  TakeTokenAway();
  disk.GoOn();
  EXPECT_EQ(call.writer->Finish().error_code(), StatusCode::UNAUTHENTICATED);
  EXPECT_EQ(call.response.stored(), 0u);
  EXPECT_TRUE(State().complete) << "it was stored all the same";
}

TEST_F(UploadAsset, BegunWhileTheServerEndsItEndsToo) {
  Start();
  grpc::ClientContext watchers;
  SetDeadline(watchers);
  v1::WatchStatsRequest request;
  request.set_interval_ns(10 * sync::kMillisecond);
  const auto watch = daemon_->displays().WatchStats(&watchers, request);
  v1::Stats stats;
  ASSERT_TRUE(watch->Read(&stats));

  Held disk(DiskCall::kWrite);
  Call first(daemon_->scene());
  ASSERT_TRUE(first.Send("hel"));
  disk.AwaitBegun();
  std::thread ends([&] { daemon_->server().Shutdown(60 * sync::kSecond); });
  while (watch->Read(&stats)) continue;
  EXPECT_EQ(watch->Finish().error_code(), StatusCode::UNAVAILABLE);
  Call late(daemon_->scene());
  grpc::ClientContext asks;
  SetDeadline(asks);
  v1::ListAssetsResponse listed;  // arrives after the late one
  EXPECT_TRUE(daemon_->scene().ListAssets(&asks, {}, &listed).ok());
  disk.GoOn();
  for (Call* call : {&first, &late}) {
    const grpc::Status status = call->writer->Finish();
    EXPECT_EQ(status.error_code(), StatusCode::UNAVAILABLE) << status.error_message();
  }
  ends.join();
  EXPECT_EQ(State().stored, 3u);
}

TEST_F(UploadAsset, WhatMemoryCannotHoldIsRefused) {
  Start();
  const std::shared_ptr<Budget> budget = daemon_->core().budget();
  const uint64_t all = budget->limit_bytes();
  budget->ChargeAnyway(Budget::Use::kOwed, all);
  Call refused(daemon_->scene());
  refused.Send(kHello);
  const grpc::Status status = refused.End();
  EXPECT_EQ(status.error_code(), StatusCode::RESOURCE_EXHAUSTED);
  EXPECT_THAT(status.error_message(), HasSubstr(absl::StrCat("max_memory_bytes allows ", all)));
  EXPECT_EQ(State().stored, 0u);
  budget->Release(Budget::Use::kOwed, all);

  Call call(daemon_->scene());
  ASSERT_TRUE(call.Send(kHello));
  AwaitStored(kHello.size());
  budget->ChargeAnyway(Budget::Use::kOwed, all + 1);
  const grpc::Status ended = call.End();
  EXPECT_TRUE(ended.ok()) << "ending takes no memory: " << ended.error_message();
  EXPECT_TRUE(State().complete);
  budget->Release(Budget::Use::kOwed, all + 1);
}

TEST_F(UploadAsset, IsSilentByTheServersClockAlone) {
  StandingClock clock;
  Start({.upload_silence_limit_ns = sync::kMillisecond, .clock = &clock});
  Call call(daemon_->scene());
  ASSERT_TRUE(call.Send("hel"));
  AwaitStored(3);
  // Its alarm fires again and again, and reads the clock.
  for (const uint64_t asked = clock.asked(); clock.asked() < asked + 100;) {
    std::this_thread::yield();
  }
  ASSERT_TRUE(call.Send("l", 3));
  AwaitStored(4);
  clock.Advance(sync::kMillisecond);
  const grpc::Status status = call.writer->Finish();
  EXPECT_EQ(status.error_code(), StatusCode::DEADLINE_EXCEEDED) << status.error_message();
  EXPECT_EQ(State().stored, 4u);
  daemon_ = nullptr;
}

}  // namespace
}  // namespace voxeld::daemon::services
