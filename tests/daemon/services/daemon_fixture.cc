#include "tests/daemon/services/daemon_fixture.h"

#include <stdlib.h>

#include <algorithm>
#include <filesystem>
#include <utility>

#include "absl/strings/str_cat.h"
#include "display/drivers/registry.h"
#include "tests/daemon/fakes/scripted_display.h"

namespace voxeld::daemon::services {
namespace {

std::string NewFolder() {
  std::string path = (std::filesystem::temp_directory_path() / "voxeld-test-XXXXXX").string();
  EXPECT_NE(mkdtemp(path.data()), nullptr);
  return path;
}

std::unique_ptr<display::Display> QuickDisplay(const std::string& name, sync::Clock& clock) {
  auto display = display::CreateDisplay(
      {.name = name, .driver = "simulated", .options = {{"size", "8x8x4"}, {"rate", "200"}}},
      clock);
  EXPECT_TRUE(display.ok()) << display.status();
  return *std::move(display);
}

std::unique_ptr<display::Display> StuckDisplay(const std::string& name, sync::Clock& clock) {
  return std::make_unique<testing::ScriptedDisplay>(testing::SmallDisplay(name), clock);
}

}  // namespace

Daemon::Daemon(DaemonOptions options)
    : folder_(NewFolder()), target_(absl::StrCat("unix:", folder_, "/voxeld.sock")) {
  const auto counters = std::make_shared<listen::Counters>();
  core_ = std::make_unique<Core>(
      CoreOptions{.limits = options.limits,
                  .version = "9.8.7",
                  .asset_figures =
                      [assets = options.assets] {
                        return assets == nullptr ? AssetFigures() : assets->figures();
                      },
                  .connections = [counters] { return counters->Read(); }},
      clock_);
  for (const std::string& name : options.displays) {
    const absl::Status added =
        core_->AddDisplay(options.stuck ? StuckDisplay(name, clock_) : QuickDisplay(name, clock_),
                          {.kind = gpu::EngineKind::kCpu, .inline_execution = true});
    EXPECT_TRUE(added.ok()) << added;
  }
  const absl::Status started = core_->Start();
  EXPECT_TRUE(started.ok()) << started;
  std::optional<local::LocalSocketOptions> local;
  if (options.local_socket) {
    local = {.listen = *ParseAddress(target_ + ".local"),
             .limits = {.max_bytes = options.limits.max_local_bytes}};
  }
  std::vector<Address> listen = {*ParseAddress(target_)};
  for (const std::string& address : options.listen) listen.push_back(*ParseAddress(address));
  auto server =
      Server::Start(*core_, options.clock == nullptr ? clock_ : *options.clock,
                    {.listen = listen,
                     .version = "9.8.7",
                     .streams = {.open_limit_ns = options.open_limit_ns,
                                 .drain_limit_ns = options.drain_limit_ns,
                                 .max_queued_answers = options.max_queued_answers,
                                 .watch_write_limit_ns = options.watch_write_limit_ns,
                                 .upload_silence_limit_ns = options.upload_silence_limit_ns},
                     .counters = counters,
                     .max_scene_watches = options.max_scene_watches,
                     .max_stats_watches = options.max_stats_watches,
                     .max_volume_watches = options.max_volume_watches,
                     .local = local,
                     .access = options.access,
                     .tls = options.tls,
                     .audit = options.audit,
                     .assets = options.assets});
  EXPECT_TRUE(server.ok()) << server.status();
  server_ = *std::move(server);
  channel_ = NewChannel();
  scene_ = v1::SceneService::NewStub(channel_);
  displays_ = v1::DisplayService::NewStub(channel_);
  // A display that is still attaching would answer commits with ABSENT.
  EXPECT_TRUE(Await([](const v1::Stats& stats) {
    return std::all_of(stats.displays().begin(), stats.displays().end(), [](const auto& display) {
      return display.state() == v1::DISPLAY_STATE_SHOWING;
    });
  }));
}

Daemon::~Daemon() {
  server_->Shutdown(5 * sync::kSecond);
  const absl::Status stopped = core_->Stop(10 * sync::kSecond);
  EXPECT_TRUE(stopped.ok()) << stopped;
  std::error_code ignored;
  std::filesystem::remove_all(folder_, ignored);
}

std::shared_ptr<grpc::Channel> Daemon::NewChannel() const {
  grpc::ChannelArguments arguments;
  arguments.SetInt(GRPC_ARG_USE_LOCAL_SUBCHANNEL_POOL, 1);
  return grpc::CreateCustomChannel(target_, grpc::InsecureChannelCredentials(), arguments);
}

v1::Stats Daemon::Stats() {
  grpc::ClientContext context;
  SetDeadline(context);
  v1::WatchStatsRequest request;
  request.set_once(true);
  const auto call = displays_->WatchStats(&context, request);
  v1::Stats stats;
  EXPECT_TRUE(call->Read(&stats));
  EXPECT_TRUE(call->Finish().ok());
  return stats;
}

std::optional<v1::Stats> AwaitStats(v1::DisplayService::Stub& displays,
                                    const std::function<bool(const v1::Stats&)>& right) {
  grpc::ClientContext context;
  SetDeadline(context);
  v1::WatchStatsRequest request;
  request.set_interval_ns(10 * sync::kMillisecond);
  const auto call = displays.WatchStats(&context, request);
  v1::Stats stats;
  bool found = false;
  while (!found && call->Read(&stats)) found = right(stats);
  context.TryCancel();
  const grpc::Status ended = call->Finish();
  EXPECT_TRUE(found) << ended.error_message() << "\n" << stats.DebugString();
  if (!found) return std::nullopt;
  return stats;
}

bool AllShowing(const v1::Stats& stats) {
  return std::all_of(stats.displays().begin(), stats.displays().end(), [](const auto& display) {
    return display.state() == v1::DISPLAY_STATE_SHOWING;
  });
}

v1::ListEntitiesResponse Daemon::Entities() {
  grpc::ClientContext context;
  SetDeadline(context);
  v1::ListEntitiesResponse response;
  const grpc::Status status = scene_->ListEntities(&context, {}, &response);
  EXPECT_TRUE(status.ok()) << status.error_message();
  return response;
}

std::unique_ptr<grpc::ClientReaderWriter<v1::StreamRequest, v1::StreamResponse>> Client::Begin(
    v1::SceneService::Stub& stub, std::chrono::seconds patience) {
  SetDeadline(context_, patience);
  return stub.Stream(&context_);
}

v1::Opened Client::Open(const v1::Open& open) {
  v1::StreamRequest request;
  *request.mutable_open() = open;
  EXPECT_TRUE(Send(request));
  const std::optional<v1::StreamResponse> response = Read();
  EXPECT_TRUE(response.has_value() && response->has_opened());
  return response.has_value() ? response->opened() : v1::Opened();
}

bool Client::Commit(uint64_t frame_id) {
  v1::StreamRequest request;
  request.mutable_commit()->set_frame_id(frame_id);
  return Send(request);
}

std::optional<v1::StreamResponse> Client::Read() {
  v1::StreamResponse response;
  if (!call_->Read(&response)) return {};
  for (const v1::Issue& issue : response.issues()) issues.push_back(issue);
  for (const v1::Receipt& receipt : response.receipts()) {
    (receipt.has_outcome() ? outcomes : answers).push_back(receipt);
  }
  return response;
}

void Client::ReadOutcomes(size_t count) {
  while (outcomes.size() < count) {
    if (!Read().has_value()) {
      ADD_FAILURE() << "the stream ended after " << outcomes.size() << " outcomes of " << count;
      return;
    }
  }
}

grpc::Status Client::Finish() {
  while (Read().has_value()) {
  }
  return call_->Finish();
}

v1::StreamRequest SphereIn(const std::string& layer, const std::string& id, double radius) {
  v1::StreamRequest request;
  v1::Upsert* upsert = request.mutable_upsert();
  upsert->set_layer(layer);
  upsert->set_id(id);
  upsert->mutable_entity()->mutable_primitive()->mutable_sphere()->set_radius(radius);
  return request;
}

}  // namespace voxeld::daemon::services
