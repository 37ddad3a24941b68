// A real daemon in this process: core, simulated displays, and the gRPC server on a Unix socket.
#pragma once

#include <grpcpp/grpcpp.h>
#include <gtest/gtest.h>

#include <chrono>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "daemon/core/core.h"
#include "daemon/services/server.h"
#include "display/sync/clock.h"
#include "voxeld/v1/display.grpc.pb.h"
#include "voxeld/v1/scene.grpc.pb.h"

namespace voxeld::daemon::services {

// Sets the time limit for every call of a test.
inline void SetDeadline(grpc::ClientContext& context,
                        std::chrono::seconds patience = std::chrono::seconds(60)) {
  context.set_deadline(std::chrono::system_clock::now() + patience);
}

// Waits until the statistics satisfy `right`. Returns them, or nullopt after a generous time.
std::optional<v1::Stats> AwaitStats(v1::DisplayService::Stub& displays,
                                    const std::function<bool(const v1::Stats&)>& right);
// Returns whether every display has attached: commits before that have no display to be shown on.
bool AllShowing(const v1::Stats& stats);

struct DaemonOptions {
  Limits limits;
  std::vector<std::string> displays = {"sim"};
  sync::TimeNs open_limit_ns = 30 * sync::kSecond;
  sync::TimeNs drain_limit_ns = 30 * sync::kSecond;
  size_t max_queued_answers = 16384;
  sync::TimeNs watch_write_limit_ns = 30 * sync::kSecond;
  sync::TimeNs upload_silence_limit_ns = 30 * sync::kSecond;
  uint32_t max_scene_watches = 64;
  uint32_t max_stats_watches = 64;
  uint32_t max_volume_watches = 16;
  bool local_socket = false;
  bool stuck = false;               // displays that accept volumes and never show one
  std::vector<std::string> listen;  // more addresses
  const access::Access* access = nullptr;
  const access::TlsStore* tls = nullptr;
  access::Audit* audit = nullptr;
  assets::AssetStore* assets = nullptr;  // outlives the daemon
  sync::Clock* clock = nullptr;  // the server's clock; outlives the daemon; null: the system's
};

class Daemon {
 public:
  explicit Daemon(DaemonOptions options = {});
  ~Daemon();
  Daemon(const Daemon&) = delete;
  Daemon& operator=(const Daemon&) = delete;

  const std::string& target() const { return target_; }
  const std::string& folder() const { return folder_; }  // a folder for the test's own files
  std::shared_ptr<grpc::Channel> NewChannel() const;     // a connection of its own
  v1::SceneService::Stub& scene() { return *scene_; }
  v1::DisplayService::Stub& displays() { return *displays_; }
  Server& server() { return *server_; }
  Core& core() { return *core_; }

  v1::Stats Stats();
  v1::ListEntitiesResponse Entities();
  // Waits until the statistics satisfy `right`. Returns false after a generous time.
  bool Await(const std::function<bool(const v1::Stats&)>& right) {
    return AwaitStats(*displays_, right).has_value();
  }

 private:
  const std::string folder_;
  const std::string target_;
  sync::SystemClock clock_;
  std::unique_ptr<Core> core_;
  std::unique_ptr<Server> server_;
  std::shared_ptr<grpc::Channel> channel_;
  std::unique_ptr<v1::SceneService::Stub> scene_;
  std::unique_ptr<v1::DisplayService::Stub> displays_;
};

// One stream, written and read in the test's thread.
class Client {
 public:
  // `patience` limits the whole stream.
  explicit Client(v1::SceneService::Stub& stub,
                  std::chrono::seconds patience = std::chrono::seconds(60))
      : call_(Begin(stub, patience)) {}

  // Sends Open and expects Opened.
  v1::Opened Open(const v1::Open& open = {});
  bool Send(const v1::StreamRequest& request) { return call_->Write(request); }
  bool Commit(uint64_t frame_id);
  void HalfClose() { call_->WritesDone(); }
  void Cancel() { context_.TryCancel(); }

  std::optional<v1::StreamResponse> Read();
  // Reads until that many outcomes have arrived (and whatever arrives with them).
  void ReadOutcomes(size_t count);
  // Reads to the end.
  grpc::Status Finish();

  // Everything that has been read.
  std::vector<v1::Issue> issues;
  std::vector<v1::Receipt> answers;  // Accepted and Refused
  std::vector<v1::Receipt> outcomes;

 private:
  std::unique_ptr<grpc::ClientReaderWriter<v1::StreamRequest, v1::StreamResponse>> Begin(
      v1::SceneService::Stub& stub, std::chrono::seconds patience);

  grpc::ClientContext context_;
  std::unique_ptr<grpc::ClientReaderWriter<v1::StreamRequest, v1::StreamResponse>> call_;
};

v1::StreamRequest SphereIn(const std::string& layer, const std::string& id, double radius = 0.5);

}  // namespace voxeld::daemon::services
