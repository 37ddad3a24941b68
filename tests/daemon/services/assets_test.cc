// Tests assets over the wire: uploaded in pieces, over calls that are interrupted, and drawn by
// their hash.
#include <gmock/gmock.h>
#include <sys/resource.h>
#include <unistd.h>

#include <atomic>
#include <csignal>
#include <cstring>
#include <filesystem>
#include <latch>
#include <thread>
#include <vector>

#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"
#include "daemon/assets/asset_store.h"
#include "tests/daemon/services/daemon_fixture.h"

namespace voxeld::daemon::services {
namespace {

using ::testing::HasSubstr;

// Twelve bytes: the point (1, 2, 3) as floats; the hash is from sha256sum.
const std::string kPoint = absl::HexStringToBytes("0000803f0000004000004040");
const std::string kPointHash =
    absl::HexStringToBytes("8e628779e6a74ee0b36991c10158f63cafec7d340ad4e075592502c8708524dd");

class Assets : public ::testing::Test {
 protected:
  void TearDown() override {
    daemon_ = nullptr;
    store_ = nullptr;
    std::filesystem::remove_all(folder_);
  }

  // If `folder` is empty, assets are in memory.
  void Start(bool keeps = true, sync::TimeNs silence = 30 * sync::kSecond,
             const std::string& folder = "") {
    store_ = assets::AssetStore::Open(folder, {.max_asset_bytes = 1000, .max_bytes = 100'000},
                                      clock_, nullptr);
    daemon_ = std::make_unique<Daemon>(DaemonOptions{.upload_silence_limit_ns = silence,
                                                     .assets = keeps ? store_.get() : nullptr});
  }

  struct Piece {
    std::string bytes;
    uint64_t offset = 0;
  };
  // If `stored_before_break` is not 0, the call is cancelled once that many bytes are stored.
  grpc::Status Upload(const std::string& hash, uint64_t size, const std::vector<Piece>& pieces,
                      uint64_t stored_before_break = 0) {
    grpc::ClientContext context;
    SetDeadline(context);
    response_.Clear();
    const auto call = daemon_->scene().UploadAsset(&context, &response_);
    bool first = true;
    for (const Piece& piece : pieces) {
      v1::UploadAssetRequest request;
      if (first) {
        request.set_sha256(hash);
        request.set_size(size);
      }
      first = false;
      request.set_offset(piece.offset);
      request.set_data(piece.bytes);
      if (!call->Write(request)) break;
    }
    if (stored_before_break > 0) {
      while (List(hash).assets(0).stored() < stored_before_break) continue;
      context.TryCancel();
    }
    call->WritesDone();
    return call->Finish();
  }

  // A call that has uploaded the first four bytes of the point.
  struct Begun {
    explicit Begun(Assets& test) {
      SetDeadline(context);
      call = test.daemon_->scene().UploadAsset(&context, &response);
      request.set_sha256(kPointHash);
      request.set_size(12);
      request.set_data(kPoint.substr(0, 4));
      written = call->Write(request);
    }
    grpc::ClientContext context;
    v1::UploadAssetResponse response;
    v1::UploadAssetRequest request;
    std::unique_ptr<grpc::ClientWriter<v1::UploadAssetRequest>> call;
    bool written = false;
  };

  v1::ListAssetsResponse List(const std::string& hash = "") {
    grpc::ClientContext context;
    SetDeadline(context);
    v1::ListAssetsRequest request;
    if (!hash.empty()) request.add_sha256(hash);
    v1::ListAssetsResponse response;
    const grpc::Status status = daemon_->scene().ListAssets(&context, request, &response);
    EXPECT_TRUE(status.ok()) << status.error_message();
    return response;
  }

  static v1::StreamRequest DrawByHash(const std::string& hash) {
    v1::StreamRequest request;
    v1::Upsert* upsert = request.mutable_upsert();
    upsert->set_layer("l");
    upsert->set_id("point");
    v1::Vertices* vertices =
        upsert->mutable_entity()->mutable_primitive()->mutable_points()->mutable_vertices();
    vertices->set_count(1);
    vertices->mutable_positions_in()->set_asset(hash);
    vertices->mutable_positions_in()->set_size(12);
    return request;
  }

  const std::string folder_ =
      absl::StrCat(::testing::TempDir(), "/voxeld-assets-over-the-wire-", getpid());
  sync::SystemClock clock_;
  std::unique_ptr<assets::AssetStore> store_;
  std::unique_ptr<Daemon> daemon_;
  v1::UploadAssetResponse response_;
};

TEST_F(Assets, AreBroughtInPiecesAndDrawnByManyRequests) {
  Start();
  const grpc::Status status =
      Upload(kPointHash, 12, {{kPoint.substr(0, 5), 0}, {kPoint.substr(5), 5}});
  ASSERT_TRUE(status.ok()) << status.error_message();
  EXPECT_EQ(response_.stored(), 12u);
  EXPECT_EQ(response_.sha256(), kPointHash);
  const v1::ListAssetsResponse all = List();
  ASSERT_EQ(all.assets_size(), 1);
  EXPECT_TRUE(all.assets(0).complete());
  EXPECT_EQ(all.used_bytes(), 4096u);
  EXPECT_GT(all.max_piece_bytes(), 100'000u);

  Client client(daemon_->scene());
  const v1::Opened opened = client.Open();
  EXPECT_EQ(opened.limits().max_assets_bytes(), 512u << 20) << "as configured";
  client.Send(DrawByHash(kPointHash));
  client.Commit(1);
  client.ReadOutcomes(1);
  EXPECT_TRUE(client.issues.empty());

  v1::ApplyUpdateRequest update;
  *update.add_operations() = DrawByHash(kPointHash);
  v1::ApplyUpdateResponse updated;
  grpc::ClientContext context;
  SetDeadline(context);
  ASSERT_TRUE(daemon_->scene().ApplyUpdate(&context, update, &updated).ok());
  EXPECT_EQ(updated.issues_size(), 0);
  EXPECT_EQ(daemon_->Stats().assets().uploaded(), 1u);
  EXPECT_EQ(daemon_->Stats().entities(), 2u);

  EXPECT_TRUE(Upload(kPointHash, 12, {{kPoint.substr(0, 5), 0}}).ok()) << "it is already stored";
  EXPECT_EQ(response_.stored(), 12u);
}

TEST_F(Assets, GoOnAfterACallThatBrokeOff) {
  Start();
  EXPECT_EQ(Upload(kPointHash, 12, {{kPoint.substr(0, 7), 0}}, 7).error_code(),
            grpc::StatusCode::CANCELLED);
  EXPECT_EQ(List(kPointHash).assets(0).stored(), 7u);
  EXPECT_FALSE(List(kPointHash).assets(0).complete());
  grpc::Status status;
  do {  // the server may not have noticed the cancelled call yet
    status = Upload(kPointHash, 12, {{kPoint.substr(7), 7}});
  } while (status.error_code() == grpc::StatusCode::ABORTED);
  EXPECT_TRUE(status.ok()) << status.error_message();
  EXPECT_TRUE(List(kPointHash).assets(0).complete());
}

TEST_F(Assets, WhatIsWrongIsSaid) {
  Start();
  const auto expect = [this](const grpc::Status& status, grpc::StatusCode code,
                             const std::string& why) {
    EXPECT_EQ(status.error_code(), code) << why;
    EXPECT_THAT(status.error_message(), HasSubstr(why));
    EXPECT_EQ(List().used_bytes(), 0u);
  };
  expect(Upload("short", 12, {{kPoint}}), grpc::StatusCode::INVALID_ARGUMENT,
         "sha256 has 5 bytes; give the 32");
  expect(Upload(kPointHash, 1001, {{kPoint}}), grpc::StatusCode::INVALID_ARGUMENT,
         "size is 1001; an asset has 1 to 1000 bytes, which is max_asset_bytes");
  expect(Upload(kPointHash, 12, {{kPoint, 3}}), grpc::StatusCode::OUT_OF_RANGE,
         "offset is 3, and 0 bytes of it are here");
  expect(Upload(kPointHash, 12, {{std::string(12, 'x')}}), grpc::StatusCode::DATA_LOSS,
         "what came has the SHA-256");
  expect(Upload(kPointHash, 12, {}), grpc::StatusCode::INVALID_ARGUMENT, "without a piece");

  Client client(daemon_->scene());
  client.Open();
  client.Send(DrawByHash(kPointHash));
  client.Commit(1);
  client.ReadOutcomes(1);
  ASSERT_EQ(client.issues.size(), 1u);
  EXPECT_EQ(client.issues[0].reason(), v1::REASON_NOT_FOUND);
  EXPECT_THAT(client.issues[0].message(), HasSubstr("not here, or not any more; bring it"));
}

TEST_F(Assets, AServerMayKeepNone) {
  Start(false);
  const grpc::Status status = Upload(kPointHash, 12, {{kPoint}});
  EXPECT_EQ(status.error_code(), grpc::StatusCode::FAILED_PRECONDITION);
  EXPECT_THAT(status.error_message(), HasSubstr("max_assets_bytes is 0"));
  grpc::ClientContext context;
  SetDeadline(context);
  v1::ListAssetsResponse response;
  EXPECT_EQ(daemon_->scene().ListAssets(&context, {}, &response).error_code(),
            grpc::StatusCode::FAILED_PRECONDITION);
}

TEST_F(Assets, AnUploadUnderWayEndsWithTheServer) {
  Start();
  Begun begun(*this);
  ASSERT_TRUE(begun.written);
  while (List(kPointHash).assets(0).stored() < 4) continue;
  daemon_->server().Shutdown(5 * sync::kSecond);
  EXPECT_EQ(begun.call->Finish().error_code(), grpc::StatusCode::UNAVAILABLE);
}

TEST_F(Assets, AnUploadThatFallsSilentEnds) {
  Start(true, sync::kSecond / 5);
  Begun begun(*this);
  ASSERT_TRUE(begun.written);
  const grpc::Status silent = begun.call->Finish();  // the client sends nothing more
  EXPECT_EQ(silent.error_code(), grpc::StatusCode::DEADLINE_EXCEEDED);
  EXPECT_THAT(silent.error_message(), HasSubstr("upload_silence_limit_ns"));
  EXPECT_EQ(List(kPointHash).assets(0).stored(), 4u);
  EXPECT_TRUE(Upload(kPointHash, 12, {{kPoint.substr(4), 4}}).ok()) << "another call continues";
}

TEST_F(Assets, AFullDiskIsSaidAndTheServerGoesOn) {
  std::signal(SIGXFSZ, SIG_IGN);
  Start(true, 30 * sync::kSecond, folder_);
  rlimit before;
  ASSERT_EQ(getrlimit(RLIMIT_FSIZE, &before), 0);
  rlimit small = before;
  small.rlim_cur = 6;
  ASSERT_EQ(setrlimit(RLIMIT_FSIZE, &small), 0);
  const grpc::Status full =
      Upload(kPointHash, 12, {{kPoint.substr(0, 4), 0}, {kPoint.substr(4), 4}});
  ASSERT_EQ(setrlimit(RLIMIT_FSIZE, &before), 0);
  EXPECT_EQ(full.error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED);
  EXPECT_THAT(full.error_message(), HasSubstr(absl::BytesToHexString(kPointHash)));
  EXPECT_EQ(List(kPointHash).assets(0).stored(), 4u) << "what arrived before it was full";
  EXPECT_TRUE(Upload(kPointHash, 12, {{kPoint.substr(4), 4}}).ok()) << "there is room again";
}

TEST_F(Assets, TwoAtOnceOfOneContent) {
  Start();
  Begun begun(*this);
  ASSERT_TRUE(begun.written);
  while (List(kPointHash).assets(0).stored() < 4) continue;
  const grpc::Status second = Upload(kPointHash, 12, {{kPoint, 0}});
  EXPECT_EQ(second.error_code(), grpc::StatusCode::ABORTED);
  EXPECT_THAT(second.error_message(), HasSubstr("another upload"));
  begun.request.set_offset(4);
  begun.request.set_data(kPoint.substr(4));
  ASSERT_TRUE(begun.call->Write(begun.request));
  begun.call->WritesDone();
  EXPECT_TRUE(begun.call->Finish().ok());
}

TEST_F(Assets, OneCallBringsOne) {
  Start();
  Begun begun(*this);
  ASSERT_TRUE(begun.written);
  begun.request.set_sha256(std::string(32, 'x'));
  begun.request.set_offset(4);
  ASSERT_TRUE(begun.call->Write(begun.request));
  const grpc::Status status = begun.call->Finish();
  EXPECT_EQ(status.error_code(), grpc::StatusCode::INVALID_ARGUMENT);
  EXPECT_THAT(status.error_message(), HasSubstr("one call brings one asset"));
}

TEST_F(Assets, ManyCallsAreNotHeld) {
  Start();
  struct Open {
    grpc::ClientContext context;
    v1::UploadAssetResponse response;
    std::unique_ptr<grpc::ClientWriter<v1::UploadAssetRequest>> call;
  };
  constexpr int kCalls = 40, kMost = 32;
  std::vector<std::unique_ptr<Open>> calls;
  for (int i = 0; i < kCalls; ++i) {
    calls.push_back(std::make_unique<Open>());
    SetDeadline(calls.back()->context);
    calls.back()->call =
        daemon_->scene().UploadAsset(&calls.back()->context, &calls.back()->response);
  }
  // Accepted calls stay open until as many calls have ended as must be refused.
  std::atomic<int> refused = 0, ended = 0;
  std::latch enough(kCalls - kMost);
  std::vector<std::thread> waiting;
  for (const auto& open : calls) {
    waiting.emplace_back([&, &call = *open->call] {
      const grpc::Status status = call.Finish();
      if (status.error_code() == grpc::StatusCode::RESOURCE_EXHAUSTED) {
        EXPECT_THAT(status.error_message(), HasSubstr("32 uploads are open"));
        ++refused;
      }
      if (++ended <= kCalls - kMost) enough.count_down();
    });
  }
  enough.wait();
  for (const auto& open : calls) open->call->WritesDone();
  for (std::thread& thread : waiting) thread.join();
  EXPECT_EQ(refused, kCalls - kMost);
  EXPECT_TRUE(Upload(kPointHash, 12, {{kPoint, 0}}).ok())
      << "they have ended, and others are accepted";
}

TEST_F(Assets, WhatIsAskedForIsLookedAt) {
  Start();
  const auto ask = [this](const v1::ListAssetsRequest& request) {
    grpc::ClientContext context;
    SetDeadline(context);
    v1::ListAssetsResponse response;
    return daemon_->scene().ListAssets(&context, request, &response);
  };
  v1::ListAssetsRequest request;
  request.add_sha256("short");
  EXPECT_THAT(ask(request).error_message(), HasSubstr("sha256 has 5 bytes; give the 32"));
  request.clear_sha256();
  for (int i = 0; i < 1001; ++i) request.add_sha256(kPointHash);
  EXPECT_THAT(ask(request).error_message(), HasSubstr("sha256 has 1001 entries; give 1000"));
}

}  // namespace
}  // namespace voxeld::daemon::services
