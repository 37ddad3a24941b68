// Faults of the GPU while a client streams: the real voxeld, with an engine program that faults
// when it finds a file. Every volume is what a daemon without faults shows, no commit is lost, and
// the engine returns each time. Prints how long the CPU took to take over, and the GPU to return.
//
//   VOXELD_DRILL_FAULTS   how many; default 6
//   VOXELD_DRILL_ENGINE   the program, beside this one; default faulty_engine, which needs no GPU
//   VOXELD_DRILL_KINDS    how, in turn; default crash,dataloss,exit,hang
#include <gmock/gmock.h>
#include <grpcpp/grpcpp.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <functional>
#include <future>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "tests/daemon/services/daemon_fixture.h"
#include "tests/e2e/voxeld_process.h"
#include "tests/programs.h"

namespace voxeld::e2e {
namespace {

using daemon::services::AllShowing;
using daemon::services::AwaitStats;
using daemon::services::Client;
using daemon::services::SetDeadline;
using daemon::services::SphereIn;

constexpr const char* kDisplays[] = {"stack", "rotor"};
// The commits between two faults; an engine that has drawn that many frames counts as healthy
// again.
constexpr int kCommitsBetween = 60;
constexpr int kCompared = 10;  // of those; while an engine is lost, all are

std::string FromEnvironment(const char* name, const char* otherwise) {
  const char* value = std::getenv(name);
  return value == nullptr ? otherwise : value;
}

// Sends commit i, which is the same for every client.
void SendScene(Client& client, int i) {
  const double t = 0.07 * i;
  client.Send(SphereIn("a", "ball", 0.3 + 0.2 * std::sin(t)));
  v1::StreamRequest box = SphereIn("a", "box");
  v1::Entity& entity = *box.mutable_upsert()->mutable_entity();
  entity.mutable_primitive()->mutable_box()->mutable_size()->set_x(0.5);
  entity.mutable_primitive()->mutable_box()->mutable_size()->set_y(0.4);
  entity.mutable_primitive()->mutable_box()->mutable_size()->set_z(0.3);
  entity.mutable_primitive()->mutable_color()->set_rgb(0x4080FF);
  for (const double m : {std::cos(t), -std::sin(t), 0.0, 0.4 * std::cos(t), std::sin(t),
                         std::cos(t), 0.0, 0.4 * std::sin(t), 0.0, 0.0, 1.0, 0.2}) {
    entity.mutable_transform()->add_m(m);
  }
  client.Send(box);
  if (i % 5 != 0) return;
  v1::StreamRequest lines = SphereIn("b", "lines");
  v1::Primitive& primitive = *lines.mutable_upsert()->mutable_entity()->mutable_primitive();
  v1::Vertices& vertices = *primitive.mutable_segments()->mutable_vertices();
  primitive.mutable_color()->set_rgb(0x20FF20);
  constexpr uint32_t kVertices = 400;
  std::vector<float> positions;
  uint32_t random = 12345 + static_cast<uint32_t>(i);
  for (uint32_t v = 0; v < 3 * kVertices; ++v) {
    random = random * 1664525 + 1013904223;
    positions.push_back(static_cast<float>(random >> 8) / 8388608.0f - 1.0f);
  }
  vertices.set_count(kVertices);
  vertices.set_position_type(v1::ELEMENT_TYPE_F32);
  vertices.set_positions(positions.data(), positions.size() * sizeof(float));
  client.Send(lines);
}

class Drilled {
 public:
  // `engine`: the program; empty: the CPU in the daemon's own process. `fault_color`: the colour of
  // geometries that fault. `more`: further options of every display.
  explicit Drilled(const std::string& engine, const std::string& fault_color = "",
                   const std::string& more = "") {
    std::string config = "[engine]\n";
    if (engine.empty()) {
      config += "kind = \"cpu\"\n";
    } else {
      config += absl::StrCat("kind = \"cuda\"\nworker = \"", engine,
                             "\"\nworker_deadline_ns = 1_000_000_000\n");
    }
    target_ = absl::StrCat("unix:", folder_.path(), "/voxeld.sock");
    fault_file_ = absl::StrCat(folder_.path(), "/fault");
    std::map<std::string, std::string> environment = CleanEnvironment(folder_);
    environment["VOXELD_FAULT_FILE"] = fault_file_;
    environment["VOXELD_FAULT_COLOR"] = fault_color;
    process_ = std::make_unique<Process>(
        std::vector<std::string>{
            VoxeldBinary(), "--config", folder_.File("voxeld.toml", config), "--listen", target_,
            "--http", "off", "--log-format", "json", "--display",
            absl::StrCat("stack=simulated,size=48x48x24,rate=240", more), "--display",
            absl::StrCat("rotor=simulated,geometry=rotor,slices=60,"
                         "size=48x32,rate=240",
                         more)},
        environment);
    const std::optional<std::string> ready = process_->ReadLineWith("\"event\":\"ready\"");
    if (!ready.has_value()) throw std::runtime_error("voxeld: " + process_->output());
    channel_ = grpc::CreateChannel(target_, grpc::InsecureChannelCredentials());
    scene_ = v1::SceneService::NewStub(channel_);
    displays_ = v1::DisplayService::NewStub(channel_);
    if (!AwaitStats(*displays_, AllShowing)) throw std::runtime_error("no displays");
    client_ = std::make_unique<Client>(*scene_, std::chrono::hours(1));
    client_->Open();
  }

  bool Send(const v1::StreamRequest& request) { return client_->Send(request); }

  // Sends commit i, and waits until every display has shown it.
  void Commit(int i) {
    SendScene(*client_, i);
    EXPECT_TRUE(client_->Commit(static_cast<uint64_t>(i)));
    const size_t outcomes = client_->outcomes.size();
    client_->ReadOutcomes(outcomes + std::size(kDisplays));
    for (size_t o = outcomes; o < client_->outcomes.size(); ++o) {
      EXPECT_TRUE(client_->outcomes[o].outcome().has_presented())
          << client_->outcomes[o].DebugString();
    }
  }

  // Returns what the displays show after the commit.
  std::vector<std::string> CommitAndLook(int i) {
    Commit(i);
    std::vector<std::future<std::string>> captures;
    for (const char* display : kDisplays) {
      captures.push_back(
          std::async(std::launch::async, [this, display] { return Volume(display); }));
    }
    std::vector<std::string> volumes;
    for (std::future<std::string>& capture : captures) volumes.push_back(capture.get());
    return volumes;
  }

  v1::Stats Stats() {
    grpc::ClientContext context;
    SetDeadline(context);
    v1::WatchStatsRequest request;
    request.set_once(true);
    const auto call = displays_->WatchStats(&context, request);
    v1::Stats stats;
    if (!call->Read(&stats)) ADD_FAILURE() << "no statistics: " << call->Finish().error_message();
    return stats;
  }

  void Fault(const std::string& kind) {
    const std::string next = fault_file_ + ".next";
    std::ofstream(next) << kind;
    std::filesystem::rename(next, fault_file_);
  }
  bool faulted() const { return !std::filesystem::exists(fault_file_); }
  const Client& client() const { return *client_; }
  // Returns its exit code.
  std::optional<int> End() {
    client_->Cancel();
    process_->Signal(SIGTERM);
    return process_->Wait();
  }
  std::string output() { return process_->output(); }

 private:
  std::string Volume(const std::string& display) {
    grpc::ClientContext context;
    SetDeadline(context);
    v1::CaptureVolumeRequest request;
    request.set_name(display);
    request.set_at_least_snapshot(client_->answers.back().accepted().snapshot());
    const auto call = displays_->CaptureVolume(&context, request);
    v1::VolumeChunk chunk;
    std::string rgb;
    while (call->Read(&chunk)) rgb += chunk.slices().rgb();
    EXPECT_TRUE(call->Finish().ok());
    EXPECT_FALSE(rgb.empty());
    return rgb;
  }

  Folder folder_;
  std::string target_, fault_file_;
  std::unique_ptr<Process> process_;
  std::shared_ptr<grpc::Channel> channel_;
  std::unique_ptr<v1::SceneService::Stub> scene_;
  std::unique_ptr<v1::DisplayService::Stub> displays_;
  std::unique_ptr<Client> client_;
};

// Two daemons that get the same commits; what they show is compared.
class Pair {
 public:
  explicit Pair(const std::string& fault_color = "", const std::string& more = "")
      : faulted(ProgramBeside(FromEnvironment("VOXELD_DRILL_ENGINE", "faulty_engine")), fault_color,
                more),
        unfaulted("") {}

  void Commit() {
    ++commits;
    std::future<std::vector<std::string>> without =
        std::async(std::launch::async, [this] { return unfaulted.CommitAndLook(commits); });
    const std::vector<std::string> got = faulted.CommitAndLook(commits);
    const std::vector<std::string> want = without.get();
    for (size_t d = 0; d < want.size(); ++d) {
      EXPECT_TRUE(got[d] == want[d]) << kDisplays[d] << " differs at commit " << commits;
    }
  }
  // The same without a comparison.
  void CommitQuickly() {
    ++commits;
    std::future<void> without =
        std::async(std::launch::async, [this] { unfaulted.Commit(commits); });
    faulted.Commit(commits);
    without.get();
  }
  // Makes enough commits for an engine that returned to count as healthy again.
  void CommitMany() {
    for (int i = 0; i < kCompared; ++i) Commit();
    for (int i = kCompared; i < kCommitsBetween; ++i) CommitQuickly();
  }
  // Sends it with the next commit.
  void Send(const v1::StreamRequest& request) {
    faulted.Send(request);
    unfaulted.Send(request);
  }
  // Commits until the statistics of all displays satisfy `so`.
  void CommitUntil(const std::function<bool(const v1::DisplayStats&)>& so) {
    const auto all = [&] {
      const v1::Stats stats = faulted.Stats();
      return stats.displays_size() > 0 &&
             std::all_of(stats.displays().begin(), stats.displays().end(), so);
    };
    for (int waited = 0; waited < 3000 && !::testing::Test::HasFailure() && !all(); ++waited)
      Commit();
    ASSERT_TRUE(all()) << faulted.Stats().DebugString();
  }
  static bool OnCuda(const v1::DisplayStats& d) { return d.engine() == "cuda"; }

  Drilled faulted, unfaulted;
  int commits = 0;
};

void Print(const char* what, std::vector<double> ms) {
  ASSERT_FALSE(ms.empty());
  std::sort(ms.begin(), ms.end());
  std::printf("%s: p50 %.1f ms, max %.1f ms, of %zu\n", what, ms[(ms.size() - 1) / 2], ms.back(),
              ms.size());
}

TEST(FaultDrill, EveryVolumeIsAsWithoutFaultsAndTheEngineComesBackEachTime) {
  int faults = 0;
  ASSERT_TRUE(absl::SimpleAtoi(FromEnvironment("VOXELD_DRILL_FAULTS", "6"), &faults));
  const std::vector<std::string> kinds =
      absl::StrSplit(FromEnvironment("VOXELD_DRILL_KINDS", "crash,dataloss,exit,hang"), ',');
  for (const std::string& kind : kinds) {
    ASSERT_THAT(kind, ::testing::AnyOf("crash", "dataloss", "exit", "hang", "illegal"))
        << "of VOXELD_DRILL_KINDS";
  }
  Pair pair;
  std::map<std::string, std::vector<double>> takeovers;  // in ms
  std::vector<double> redraws, returns;
  pair.CommitMany();
  pair.CommitUntil(Pair::OnCuda);
  for (int fault = 0; fault < faults && !::testing::Test::HasFailure(); ++fault) {
    const std::string kind = kinds[static_cast<size_t>(fault) % kinds.size()];
    pair.faulted.Fault(kind);
    pair.Commit();
    ASSERT_TRUE(pair.faulted.faulted());
    // All displays share the process, so all lose their engine.
    pair.CommitUntil([&](const v1::DisplayStats& d) {
      return d.engine_faults() > static_cast<uint64_t>(fault);
    });
    const v1::Stats lost = pair.faulted.Stats();
    for (const v1::DisplayStats& d : lost.displays()) {
      takeovers[kind].push_back(static_cast<double>(d.takeover_last_ns()) / 1e6);
      redraws.push_back(static_cast<double>(d.redraw_last_ns()) / 1e6);
    }
    pair.CommitUntil(Pair::OnCuda);
    const v1::Stats back = pair.faulted.Stats();
    for (const v1::DisplayStats& d : back.displays()) {
      returns.push_back(static_cast<double>(d.return_last_ns()) / 1e6);
    }
    pair.CommitMany();
    if ((fault + 1) % 10 == 0) {
      std::printf("%d faults, %d commits, return %.0f ms\n", fault + 1, pair.commits,
                  returns.back());
      std::fflush(stdout);
    }
  }

  const v1::Stats stats = pair.faulted.Stats();
  for (const v1::DisplayStats& d : stats.displays()) {
    EXPECT_EQ(d.volumes_lost(), 0u) << d.name();
    EXPECT_EQ(d.commits_lost(), 0u) << d.name();
    EXPECT_EQ(d.commits_presented(), static_cast<uint64_t>(pair.commits)) << d.name();
    EXPECT_EQ(d.engine_faults(), static_cast<uint64_t>(faults)) << d.name();
    EXPECT_EQ(d.engine_returns(), static_cast<uint64_t>(faults)) << d.name();
    EXPECT_EQ(d.engine_mismatches(), 0u) << d.name();
    EXPECT_EQ(d.pinned_entities_size(), 0) << d.name();
  }
  EXPECT_EQ(stats.sessions(), 1u);
  EXPECT_TRUE(pair.faulted.client().issues.empty());
  std::printf("%d faults, %d commits on %zu displays, every volume as without\n", faults,
              pair.commits, std::size(kDisplays));
  for (const auto& [kind, ms] : takeovers) Print(absl::StrCat("takeover, ", kind).c_str(), ms);
  Print("of which the CPU's drawing, once the loss was known", redraws);
  Print("return", returns);
}

// Each display uses two GPUs: whichever of the four ranks faults, its display's other rank is lost
// too, the other display is not affected, and they return together.
TEST(FaultDrill, ALostRankTakesItsDisplaysOthersAlongAndTheyComeBack) {
  int faults = 0;
  ASSERT_TRUE(absl::SimpleAtoi(FromEnvironment("VOXELD_DRILL_FAULTS", "6"), &faults));
  const std::vector<std::string> kinds =
      absl::StrSplit(FromEnvironment("VOXELD_DRILL_KINDS", "crash,dataloss,exit,hang"), ',');
  Pair pair("", ",gpus=0;1");
  const auto sum = [&](auto figure) {
    uint64_t all = 0;
    const v1::Stats stats = pair.faulted.Stats();
    for (const v1::DisplayStats& d : stats.displays()) all += figure(d);
    return all;
  };
  pair.CommitMany();
  pair.CommitUntil(Pair::OnCuda);
  std::vector<double> takeovers, returns;
  for (int fault = 1; fault <= faults && !::testing::Test::HasFailure(); ++fault) {
    pair.faulted.Fault(kinds[static_cast<size_t>(fault) % kinds.size()]);
    for (int waited = 0; waited < 3000 && sum([](const auto& d) { return d.engine_faults(); }) <
                                              static_cast<uint64_t>(fault);
         ++waited) {
      pair.Commit();
    }
    EXPECT_TRUE(pair.faulted.faulted());
    pair.CommitUntil(Pair::OnCuda);
    pair.CommitMany();
    EXPECT_EQ(sum([](const auto& d) { return d.engine_faults(); }), static_cast<uint64_t>(fault));
    EXPECT_EQ(sum([](const auto& d) { return d.engine_returns(); }), static_cast<uint64_t>(fault));
    const v1::Stats stats = pair.faulted.Stats();
    for (const v1::DisplayStats& d : stats.displays()) {
      if (d.engine_returns() == 0) continue;
      takeovers.push_back(static_cast<double>(d.takeover_last_ns()) / 1e6);
      returns.push_back(static_cast<double>(d.return_last_ns()) / 1e6);
    }
  }
  const v1::Stats stats = pair.faulted.Stats();
  for (const v1::DisplayStats& d : stats.displays()) {
    EXPECT_EQ(d.volumes_lost() + d.commits_lost(), 0u) << d.name();
    EXPECT_EQ(d.commits_presented(), static_cast<uint64_t>(pair.commits)) << d.name();
    EXPECT_EQ(d.engine_mismatches(), 0u) << d.name();
    EXPECT_THAT(d.engine_device(), ::testing::StartsWith("GPU 0: ")) << d.name();
  }
  Print("takeover", takeovers);
  Print("return", returns);
}

// At any stage: the engine ends before the memory into which it writes.
TEST(FaultDrill, TheDaemonEndsWellWhileTheEngineComesBack) {
  for (int tenth = 0; tenth < 10; ++tenth) {
    Drilled drilled(ProgramBeside(FromEnvironment("VOXELD_DRILL_ENGINE", "faulty_engine")));
    drilled.Commit(1);
    drilled.Fault("crash");
    drilled.Commit(2);
    // It does not wait for anything: it spreads the ends over the time in which the engine returns.
    std::this_thread::sleep_for(std::chrono::milliseconds(230 + 5 * tenth));
    EXPECT_EQ(drilled.End(), 0) << drilled.output();
  }
}

TEST(FaultDrill, AnEntityThatFaultsIsDrawnByTheCpuUntilItGoes) {
  Pair pair("BADBAD");
  pair.CommitMany();
  pair.CommitUntil(Pair::OnCuda);
  v1::StreamRequest bad = SphereIn("a", "the bad one", 0.7);
  bad.mutable_upsert()->mutable_entity()->mutable_primitive()->mutable_color()->set_rgb(0xBADBAD);
  pair.Send(bad);
  pair.CommitUntil([](const v1::DisplayStats& d) {
    return d.engine() == "cuda" && d.pinned_entities_size() == 1;
  });
  const v1::Stats pinned = pair.faulted.Stats();
  for (const v1::DisplayStats& d : pinned.displays()) {
    EXPECT_THAT(d.pinned_entities(0), ::testing::HasSubstr("\"the bad one\" of layer \"a\""));
    EXPECT_THAT(d.engine_degraded(), ::testing::Not(::testing::IsEmpty()));
    EXPECT_EQ(d.volumes_lost() + d.commits_lost(), 0u);
    std::printf("%s: found after %.0f ms, %d faults\n", d.name().c_str(),
                static_cast<double>(d.return_last_ns()) / 1e6, static_cast<int>(d.engine_faults()));
  }
  pair.CommitMany();
  v1::StreamRequest gone;
  gone.mutable_delete_()->set_layer("a");
  gone.mutable_delete_()->set_id("the bad one");
  pair.Send(gone);
  pair.CommitUntil([](const v1::DisplayStats& d) {
    return d.engine() == "cuda" && d.pinned_entities_size() == 0 && d.engine_degraded().empty();
  });
}

}  // namespace
}  // namespace voxeld::e2e
