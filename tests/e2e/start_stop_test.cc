// Tests the real binary: command line, configuration, start, stop.
#include <gmock/gmock.h>
#include <grpcpp/grpcpp.h>
#include <signal.h>
#include <sys/socket.h>

#include <atomic>
#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <future>
#include <memory>
#include <nlohmann/json.hpp>
#include <thread>
#include <vector>

#include "absl/strings/str_cat.h"
#include "daemon/version/version.h"
#include "tests/daemon/services/daemon_fixture.h"
#include "tests/e2e/http_get.h"
#include "tests/e2e/voxeld_process.h"

namespace voxeld::e2e {
namespace {

using daemon::services::Client;
using daemon::services::SetDeadline;
using daemon::services::SphereIn;
using ::testing::AnyOf;
using ::testing::ContainsRegex;
using ::testing::HasSubstr;
using ::testing::StartsWith;

constexpr std::chrono::seconds kPromised{5};

std::shared_ptr<grpc::Channel> Channel(const std::string& target) {
  return grpc::CreateChannel(target, grpc::InsecureChannelCredentials());
}

TEST(CommandLine, Version) {
  const Ended ended = RunToEnd(Voxeld({"--version"}));
  EXPECT_EQ(ended.code, 0);
  EXPECT_EQ(ended.output, absl::StrCat("voxeld ", daemon::Version(), "\n"));
}

TEST(CommandLine, UsageErrorsExitWith2AndSuggest) {
  const Folder folder;
  const auto refusal = [&](const std::vector<std::string>& arguments) {
    const Ended ended = RunToEnd(Voxeld(arguments), CleanEnvironment(folder));
    EXPECT_EQ(ended.code, 2) << ended.output;
    EXPECT_THAT(ended.output, StartsWith("voxeld: "));
    return ended.output;
  };
  EXPECT_THAT(refusal({"--lisen", "a:1"}), HasSubstr("did you mean --listen?"));
  EXPECT_THAT(refusal({"--listen", "nowhere"}), HasSubstr("HOST:PORT or unix:PATH"));
  EXPECT_THAT(refusal({"--display", "sim"}), HasSubstr("NAME=DRIVER"));
  EXPECT_THAT(refusal({"--display", "sim=simulatd"}), HasSubstr("simulated"));
  EXPECT_THAT(refusal({"--display", "sim=simulated,siz=8x8x8"}), HasSubstr("siz"));
  EXPECT_THAT(refusal({"--engine", "gpu"}), HasSubstr("--engine is \"gpu\""));
}

TEST(CheckConfig, PrintsWhatIsInForceOrWhatIsWrong) {
  const Folder folder;
  const std::string good = folder.File("good.toml", "[limits]\nmax_sessions = 7\n");
  Ended ended = RunToEnd(Voxeld({"--config", good, "--check-config", "--http", "off"}),
                         CleanEnvironment(folder));
  EXPECT_EQ(ended.code, 0) << ended.output;
  EXPECT_THAT(ended.output, HasSubstr("max_sessions = 7\n"));
  EXPECT_THAT(ended.output, HasSubstr("http = 'off'\n"));
  EXPECT_THAT(ended.output, HasSubstr(absl::StrCat("unix:", folder.path(), "/voxeld.sock")));

  const std::string bad = folder.File("bad.toml", "\n[limits]\n max_sesions = 7\n[log]\nlevel=1\n");
  ended = RunToEnd(Voxeld({"--config", bad, "--check-config"}), CleanEnvironment(folder));
  EXPECT_EQ(ended.code, 1);
  EXPECT_THAT(ended.output, HasSubstr(absl::StrCat(bad, ":3:2: ")));
  EXPECT_THAT(ended.output, HasSubstr("did you mean max_sessions?"));
  EXPECT_THAT(ended.output, HasSubstr(absl::StrCat(bad, ":5:7: ")));

  const std::string option = folder.File(
      "option.toml", "[[display]]\nname = \"a\"\ndriver = \"simulated\"\nsize = \"big\"\n");
  ended = RunToEnd(Voxeld({"--config", option, "--check-config"}), CleanEnvironment(folder));
  EXPECT_EQ(ended.code, 1);
  EXPECT_THAT(ended.output, HasSubstr(absl::StrCat(option, ":1:1: ")));

  EXPECT_EQ(RunToEnd(Voxeld({"--config", "/nowhere.toml", "--check-config"})).code, 1);
}

TEST(CheckConfig, FindsTheUsersFile) {
  const Folder folder;
  std::filesystem::create_directory(folder.path() + "/voxeld");
  folder.File("voxeld/voxeld.toml", "[limits]\nmax_sessions = 9\n");
  const Ended ended = RunToEnd(Voxeld({"--check-config"}), CleanEnvironment(folder));
  EXPECT_EQ(ended.code, 0);
  EXPECT_THAT(ended.output, HasSubstr("max_sessions = 9\n"));
}

TEST(Start, BusyAddressesAreErrors) {
  Daemon first;
  const Folder folder;
  for (const std::string& address : {first.unix_target(), first.tcp_target()}) {
    const Ended ended =
        RunToEnd(Voxeld({"--listen", address, "--http", "off"}), CleanEnvironment(folder));
    EXPECT_EQ(ended.code, 1) << ended.output;
    EXPECT_THAT(ended.output, HasSubstr(absl::StrCat("somebody listens on ", address,
                                                     " already; end that, or "
                                                     "give another address with --listen")));
  }
  const Ended ended = RunToEnd(
      Voxeld({"--listen", absl::StrCat("unix:", folder.path(), "/b.sock"), "--http", first.http()}),
      CleanEnvironment(folder));
  EXPECT_EQ(ended.code, 1);
  EXPECT_THAT(ended.output, HasSubstr(absl::StrCat("somebody listens on ", first.http())));
}

TEST(Start, ABusyDefaultHttpPortIsAWarning) {
  // The first daemon gets the port; the other one warns.
  const Folder folder;
  const auto start = [&](const std::string& name) {
    return Voxeld(
        {"--listen", absl::StrCat("unix:", folder.path(), "/", name), "--log-format", "json"});
  };
  Process first(start("a.sock"), CleanEnvironment(folder));
  ASSERT_TRUE(first.ReadLineWith("\"ready\"").has_value()) << first.output();
  Process second(start("b.sock"), CleanEnvironment(folder));
  const std::optional<std::string> warning = second.ReadLineWith("no http port");
  ASSERT_TRUE(warning.has_value()) << second.output();
  EXPECT_THAT(*warning, HasSubstr("\"level\":\"warning\""));
  EXPECT_THAT(*warning, HasSubstr("127.0.0.1:8088"));
  EXPECT_TRUE(second.ReadLineWith("\"http\":\"off\"").has_value());
}

TEST(Start, SaysWhatItIs) {
  Daemon daemon;
  const std::string& output = daemon.process().output();
  EXPECT_THAT(output, HasSubstr(absl::StrCat("\"version\":\"", daemon::Version(), "\"")));
  EXPECT_THAT(output, HasSubstr("\"name\":\"sim\""));
  EXPECT_THAT(output, HasSubstr("\"engine\":\"cpu\""));
  EXPECT_THAT(output, HasSubstr("\"why\":\""));
}

TEST(Http, HealthAndMetricsOfTheRunningDaemon) {
  Daemon daemon;
  // The daemon is ready before its display has attached.
  constexpr const char* kShowing = "voxeld_display_state{display=\"sim\",state=\"showing\"} 1";
  const auto deadline = std::chrono::steady_clock::now() + std::chrono::seconds(30);
  std::string metrics;
  do {
    metrics = HttpGet(daemon.http(), "/metrics");
  } while (metrics.find(kShowing) == std::string::npos &&
           std::chrono::steady_clock::now() < deadline);
  // On a busy machine the daemon may not have run for a second, which it reports.
  EXPECT_THAT(HttpGet(daemon.http(), "/healthz"),
              AnyOf(HasSubstr("{\"status\":\"ok\",\"reasons\":[]}"),
                    ContainsRegex("degraded.*\"reasons\":\\[\\{\"what\":\"time\",[^{]*\\]")));
  EXPECT_THAT(metrics, StartsWith("HTTP/1.1 200 "));
  EXPECT_THAT(metrics, HasSubstr(kShowing));
  EXPECT_THAT(HttpGet(daemon.http(), "/other"), StartsWith("HTTP/1.1 404 "));
}

TEST(Full, AFurtherClientIsToldSoAtOnce) {
  const Folder folder;
  Daemon daemon(
      {"--config", folder.File("full.toml", "[server]\nmax_connections_per_address = 2\n")});
  // Each client has a connection of its own.
  const auto channel = [&] {
    grpc::ChannelArguments arguments;
    arguments.SetInt(GRPC_ARG_USE_LOCAL_SUBCHANNEL_POOL, 1);
    return grpc::CreateCustomChannel(daemon.tcp_target(), grpc::InsecureChannelCredentials(),
                                     arguments);
  };
  const auto first = v1::SceneService::NewStub(channel());
  const auto second = v1::SceneService::NewStub(channel());
  Client one(*first), other(*second);
  one.Open();
  other.Open();
  const auto third = v1::SceneService::NewStub(channel());
  grpc::ClientContext context;
  SetDeadline(context);
  v1::ListEntitiesResponse entities;
  const grpc::Status refused = third->ListEntities(&context, {}, &entities);
  EXPECT_EQ(refused.error_code(), grpc::StatusCode::UNAVAILABLE);
  EXPECT_THAT(refused.error_message(), HasSubstr("http1.x server"));
}

class Stop : public ::testing::TestWithParam<int> {};

TEST_P(Stop, WithClientsConnectedEndsInTimeAndWell) {
  Daemon daemon;
  const auto scene = v1::SceneService::NewStub(Channel(daemon.tcp_target()));
  Client idle(*scene), busy(*scene), half_open(*scene);
  idle.Open();
  busy.Open();
  busy.Send(SphereIn("layer", "ball"));
  busy.Commit(1);
  busy.ReadOutcomes(1);
  // A client that never reads.
  Client deaf(*scene);
  deaf.Open();
  for (int i = 0; i < 200; ++i) deaf.Commit(i);
  const auto displays = v1::DisplayService::NewStub(Channel(daemon.unix_target()));
  grpc::ClientContext context;
  SetDeadline(context);
  v1::WatchStatsRequest request;
  request.set_interval_ns(3'600'000'000'000);
  const auto watch = displays->WatchStats(&context, request);
  v1::Stats stats;
  ASSERT_TRUE(watch->Read(&stats));
  HttpConnection kept_open(daemon.http());

  const auto begin = std::chrono::steady_clock::now();
  daemon.process().Signal(GetParam());
  const std::optional<int> code = daemon.process().Wait();
  EXPECT_LT(std::chrono::steady_clock::now() - begin, kPromised);
  EXPECT_EQ(code, 0) << daemon.process().output();
  for (Client* client : {&idle, &busy}) {
    const grpc::Status status = client->Finish();
    EXPECT_EQ(status.error_code(), grpc::StatusCode::UNAVAILABLE);
    EXPECT_EQ(status.error_message(), "shutting down");
  }
  EXPECT_FALSE(half_open.Finish().ok());
  EXPECT_FALSE(deaf.Finish().ok());
  EXPECT_FALSE(watch->Read(&stats));
  EXPECT_EQ(watch->Finish().error_code(), grpc::StatusCode::UNAVAILABLE);
  EXPECT_FALSE(std::filesystem::exists(daemon.folder().path() + "/voxeld.sock"));
  EXPECT_THAT(daemon.process().output(), HasSubstr("\"event\":\"stopped\""));
}

INSTANTIATE_TEST_SUITE_P(Signal, Stop, ::testing::Values(SIGTERM, SIGINT), [](const auto& info) {
  return std::string(info.param == SIGTERM ? "SIGTERM" : "SIGINT");
});

// Returns a commit that takes minutes to apply: each of its last operations examines every
// instance.
v1::ApplyUpdateRequest LongCommit() {
  v1::ApplyUpdateRequest request;
  const v1::Entity ball = SphereIn("", "").upsert().entity();
  const auto define = [&] {
    v1::DefineObject* define = request.add_operations()->mutable_define_object();
    define->set_object("object");
    *define->mutable_definition()->add_parts()->mutable_primitive() = ball.primitive();
  };
  define();
  constexpr int kMany = 20'000;
  for (int i = 0; i < kMany; ++i) {
    v1::Upsert* upsert = request.add_operations()->mutable_upsert();
    upsert->set_layer("layer");
    upsert->set_id(absl::StrCat(i));
    upsert->mutable_entity()->mutable_primitive()->mutable_instance()->set_object("object");
  }
  for (int i = 0; i < kMany; ++i) define();
  return request;
}

// Commits 8⁶ balls.
void PutHeavyScene(Client& client) {
  const v1::Entity ball = SphereIn("", "").upsert().entity();
  std::string inner;
  for (int depth = 0; depth < 6; ++depth) {
    v1::StreamRequest request;
    v1::DefineObject* define = request.mutable_define_object();
    define->set_object(absl::StrCat("object", depth));
    for (int i = 0; i < 8; ++i) {
      auto* part = define->mutable_definition()->add_parts();
      if (depth == 0) {
        *part->mutable_primitive() = ball.primitive();
      } else {
        part->mutable_primitive()->mutable_instance()->set_object(inner);
      }
    }
    inner = define->object();
    client.Send(request);
  }
  v1::StreamRequest put;
  v1::Upsert* upsert = put.mutable_upsert();
  upsert->set_layer("layer");
  upsert->set_id("heavy");
  upsert->mutable_entity()->mutable_primitive()->mutable_instance()->set_object(inner);
  client.Send(put);
  client.Commit(1);
  while (client.answers.empty()) ASSERT_TRUE(client.Read().has_value());
}

// Makes the commit of LongCommit in a call of its own. Destroy it after the daemon has exited.
class LongCall {
 public:
  explicit LongCall(v1::SceneService::Stub& scene) : request_(LongCommit()) {
    grpc::ClientContext small;  // a first call over TCP must not be large
    SetDeadline(small);
    v1::ListEntitiesResponse nothing;
    EXPECT_TRUE(scene.ListEntities(&small, {}, &nothing).ok());
    SetDeadline(context_);
    scene.async()->ApplyUpdate(&context_, &request_, &response_, [this](grpc::Status status) {
      updated_.set_value(std::move(status));
    });
  }

  grpc::Status Wait() { return updated_.get_future().get(); }

 private:
  grpc::ClientContext context_;
  const v1::ApplyUpdateRequest request_;
  v1::ApplyUpdateResponse response_;
  std::promise<grpc::Status> updated_;
};

void ExpectEndsWell(Daemon& daemon) {
  const auto begin = std::chrono::steady_clock::now();
  daemon.process().Signal(SIGTERM);
  const std::optional<int> code = daemon.process().Wait();
  EXPECT_LT(std::chrono::steady_clock::now() - begin, kPromised);
  EXPECT_EQ(code, 0) << daemon.process().output();
}

TEST(Stop, WithALongCommitUnderWayEndsInTimeAndWell) {
  Daemon daemon;
  const auto scene = v1::SceneService::NewStub(Channel(daemon.tcp_target()));
  LongCall call(*scene);
  // Other clients are answered in the meantime.
  const auto until = std::chrono::steady_clock::now() + std::chrono::seconds(2);
  while (std::chrono::steady_clock::now() < until) {
    grpc::ClientContext list;
    SetDeadline(list);
    v1::ListEntitiesResponse entities;
    ASSERT_TRUE(scene->ListEntities(&list, {}, &entities).ok());
    ASSERT_EQ(entities.total(), 0u) << "it is not visible at all";
  }
  ExpectEndsWell(daemon);
  EXPECT_EQ(call.Wait().error_code(), grpc::StatusCode::UNAVAILABLE);
}

TEST(Stop, WithAHeavySceneBeingDrawnEndsInTimeAndWell) {
  Daemon daemon;
  const auto scene = v1::SceneService::NewStub(Channel(daemon.unix_target()));
  Client client(*scene);
  client.Open();
  PutHeavyScene(client);
  ExpectEndsWell(daemon);
}

// VOXELD_STOPS: how often it is stopped under each load.
class StopUnderLoad : public ::testing::TestWithParam<std::string> {};

TEST_P(StopUnderLoad, EndsInTimeAndWell) {
  const char* wanted = std::getenv("VOXELD_STOPS");
  const int stops = wanted == nullptr ? 17 : std::atoi(wanted);
  for (int i = 0; i < stops && !HasFailure(); ++i) {
    Daemon daemon;
    const auto scene = v1::SceneService::NewStub(Channel(daemon.unix_target()));
    std::atomic<bool> ended = false;
    std::atomic<uint64_t> work = 0;  // counts the work done by the load
    std::atomic<uint64_t> opened = 0;
    uint64_t streams = 0;
    std::vector<std::thread> load;
    std::unique_ptr<LongCall> call;
    Client client(*scene);
    const auto commit_on = [&] {
      Client busy(*scene);
      busy.Open();
      ++opened;
      for (uint64_t frame = 1; !ended; ++frame) {
        if (!busy.Send(SphereIn("layer", absl::StrCat(frame % 1000))) || !busy.Commit(frame)) break;
        ++work;
      }
    };
    if (GetParam() == "Streams") {
      streams = 3;
    } else if (GetParam() == "LongCommit") {
      call = std::make_unique<LongCall>(*scene);
      work = 1;
    } else if (GetParam() == "HeavyScene") {
      client.Open();
      PutHeavyScene(client);
      work = 1;
    } else if (GetParam() == "Watches") {
      streams = 1;
      load.emplace_back([&] {
        grpc::ClientContext context;
        SetDeadline(context);
        const auto watch = scene->WatchScene(&context, {});
        v1::WatchSceneResponse change;
        while (watch->Read(&change)) ++work;
      });
      load.emplace_back([&] {
        const auto displays = v1::DisplayService::NewStub(Channel(daemon.unix_target()));
        grpc::ClientContext context;
        SetDeadline(context);
        const auto watch = displays->WatchVolume(&context, {});
        v1::VolumeChunk volume;
        while (watch->Read(&volume)) ++work;
      });
    } else if (GetParam() == "Http") {
      load.emplace_back([&] {
        // After it has exited, it gives no answer.
        while (!ended && HttpGetIfThere(daemon.http(), "/metrics").starts_with("HTTP/1.1 200 "))
          ++work;
      });
    }
    for (uint64_t k = 0; k < streams; ++k) load.emplace_back(commit_on);
    // The signal must not arrive while a stream is being opened.
    while (opened < streams) std::this_thread::yield();
    // At a different moment of the load each time.
    while (!load.empty() && work < 20 + 37 * static_cast<uint64_t>(i)) std::this_thread::yield();
    ExpectEndsWell(daemon);
    ended = true;
    for (std::thread& thread : load) thread.join();
    // A call of which a part has not been received is cancelled.
    if (call != nullptr) EXPECT_FALSE(call->Wait().ok());
  }
}

INSTANTIATE_TEST_SUITE_P(Load, StopUnderLoad,
                         ::testing::Values("Nothing", "Streams", "LongCommit", "HeavyScene",
                                           "Watches", "Http"),
                         [](const auto& info) { return std::string(info.param); });

TEST(Stop, AndStartAgainOnTheSameSocketEvenAfterAKill) {
  const Folder folder;
  const std::string target = absl::StrCat("unix:", folder.path(), "/voxeld.sock");
  for (const int signal : {SIGKILL, SIGTERM}) {
    Process process(Voxeld({"--listen", target, "--http", "off", "--log-format", "json"}),
                    CleanEnvironment(folder));
    ASSERT_TRUE(process.ReadLineWith("\"ready\"").has_value()) << process.output();
    process.Signal(signal);
    EXPECT_EQ(process.Wait(), signal == SIGKILL ? -SIGKILL : 0);
  }
}

TEST(Logs, AreOneObjectALineWhateverClientsCallThemselves) {
  Daemon daemon;
  const auto scene = v1::SceneService::NewStub(Channel(daemon.unix_target()));
  {
    Client client(*scene);
    v1::Open open;
    open.set_client_name("x\n{\"event\":\"fake\"}\x1b[31m");
    client.Open(open);
    client.HalfClose();
    EXPECT_TRUE(client.Finish().ok());
  }
  daemon.process().Signal(SIGTERM);
  ASSERT_EQ(daemon.process().Wait(), 0);
  std::istringstream lines(daemon.process().output());
  std::string line;
  bool opened = false;
  while (std::getline(lines, line)) {
    const auto object = nlohmann::json::parse(line, nullptr, false);
    ASSERT_TRUE(object.is_object()) << line;
    EXPECT_NE(object["event"], "fake");
    opened = opened || object["event"] == "session opened";
  }
  EXPECT_TRUE(opened);
}

}  // namespace
}  // namespace voxeld::e2e
