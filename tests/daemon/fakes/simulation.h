// A whole core in one thread, under a clock that stands still, with scripted displays and recording
// engines.
#pragma once

#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/strings/str_cat.h"
#include "daemon/core/core.h"
#include "display/sync/fake_clock.h"
#include "tests/daemon/fakes/operations.h"
#include "tests/daemon/fakes/recording_engine.h"
#include "tests/daemon/fakes/scripted_display.h"

namespace voxeld::daemon::testing {

struct RecordingSink final : SessionSink {
  void OnIssue(const Issue& issue) override { issues.push_back(issue); }
  void OnReceipt(const Receipt& receipt) override { receipts.push_back(receipt); }
  void OnCredit(uint64_t total_bytes) override { credits.push_back(total_bytes); }
  void OnRoom() override { ++rooms; }
  void OnEnded(const absl::Status& why) override { ended = why; }
  bool Crowded() const override { return crowded; }

  std::vector<Issue> issues;
  std::vector<Receipt> receipts;
  std::vector<uint64_t> credits;
  int rooms = 0;
  std::optional<absl::Status> ended;
  bool crowded = false;

  template <typename T>
  std::vector<std::pair<Receipt, T>> Of() const {
    std::vector<std::pair<Receipt, T>> found;
    for (const Receipt& receipt : receipts) {
      if (const T* what = std::get_if<T>(&receipt.what)) found.emplace_back(receipt, *what);
    }
    return found;
  }
  // Returns the outcomes of one commit, in the order of arrival.
  std::vector<CommitOutcome> OutcomesOf(uint64_t frame_id) const {
    std::vector<CommitOutcome> found;
    for (const auto& [receipt, outcome] : Of<CommitOutcome>()) {
      if (receipt.frame_id == frame_id) found.push_back(outcome);
    }
    return found;
  }
};

class Simulation {
 public:
  struct Client {
    SessionInfo info;
    std::shared_ptr<RecordingSink> sink = std::make_shared<RecordingSink>();
    uint64_t last_sequence = 0;
  };

  // If `make_engine` is empty, recording engines are used, each with its script.
  using MakeEngine =
      std::function<absl::StatusOr<std::unique_ptr<gpu::Engine>>(const gpu::EngineOptions&)>;

  explicit Simulation(Limits limits = {}, int displays = 1, MakeEngine make_engine = nullptr,
                      const gpu::EngineOptions& engine_options = {},
                      uint64_t large_change = kLargeChange) {
    CoreOptions options;
    options.limits = limits;
    options.version = "test";
    options.threads = false;
    options.large_change = large_change;
    options.run_aside = [this](std::function<void()> work) {
      if (!hold_aside) return work();
      aside.push_back(std::move(work));
    };
    options.engine_event = [this](const EngineEvent& event) { engine_events.push_back(event); };
    options.transfers_event = [this](const std::string& display, uint64_t failed) {
      transfers_failed[display].push_back(failed);
    };
    options.make_engine =
        [this, make_engine](
            const gpu::EngineOptions& wanted) -> absl::StatusOr<std::unique_ptr<gpu::Engine>> {
      if (!make_engine_fails.ok()) return make_engine_fails;
      if (make_engine) return make_engine(wanted);
      return std::make_unique<RecordingEngine>(engine_script(engines_made_++));
    };
    core.emplace(std::move(options), clock);
    for (int i = 0; i < displays; ++i) {
      auto display = std::make_unique<ScriptedDisplay>(
          SmallDisplay(i == 0 ? "main" : absl::StrCat("display", i)), clock);
      display_.push_back(display.get());
      const absl::Status status = core->AddDisplay(std::move(display), engine_options);
      if (!status.ok()) std::abort();
    }
    displays_ = displays;
  }

  // Starts the core, and shows the first (dark) volume unless a display does not attach.
  void Start() {
    if (!core->Start().ok()) std::abort();
    core->Step();
    for (ScriptedDisplay* d : display_) d->Show();
    core->Step();
  }

  Client Open(OpenOptions options = {}) {
    Client client;
    core->OpenSession(std::move(options), 0, client.sink,
                      [&](absl::StatusOr<SessionInfo> info) { client.info = *info; });
    core->Step();
    return client;
  }

  // Numbers the operations and passes them to the core, with a commit at the end if `frame_id` is
  // not 0.
  template <typename... Ops>
  void Send(Client& client, uint64_t frame_id, Ops... ops) {
    std::vector<Operation> all = Sequence(client.last_sequence, std::move(ops)...);
    client.last_sequence += all.size();
    if (frame_id != 0) {
      all.push_back(EndCommit(frame_id));
      all.back().sequence = ++client.last_sequence;
    }
    client.info.intake->Take({std::move(all), {}, 100});
    core->Step();
  }

  void Close(const Client& client) {
    core->CloseSession(client.info.session, client.info.incarnation, true, nullptr);
    core->Step();
  }

  void Advance(sync::TimeNs delta) {
    clock.Advance(delta);
    core->Step();
  }

  // Lets the device show the volume in flight.
  bool Show(int display = 0) {
    const bool shown = display_[display]->Show();
    core->Step();
    return shown;
  }

  EntityPage List(EntityQuery query = {}) {
    EntityPage page;
    core->ListEntities(std::move(query), [&](absl::StatusOr<EntityPage> p) { page = *p; });
    core->Step();
    return page;
  }

  Stats GetStats() {
    Stats stats;
    core->GetStats([&](absl::StatusOr<Stats> s) { stats = *s; });
    core->Step();
    return stats;
  }

  absl::StatusOr<DisplayDescription> Update(DisplayUpdate update, std::string name = "") {
    absl::StatusOr<DisplayDescription> result = absl::UnknownError("no answer");
    core->UpdateDisplay(std::move(name), std::move(update), [&](auto r) { result = std::move(r); });
    core->Step();
    return result;
  }

  ScriptedDisplay& display(int i = 0) { return *display_[i]; }
  EngineScript& engine(int i = 0) { return *engine_script(i); }

  // Does what hold_aside has kept waiting. False if there was nothing.
  bool RunAside() {
    if (aside.empty()) return false;
    const std::function<void()> work = std::move(aside.front());
    aside.pop_front();
    work();
    core->Step();
    return true;
  }

  sync::FakeClock clock;
  bool hold_aside = false;  // the thread that makes large changes ready is busy
  std::deque<std::function<void()>> aside;
  absl::Status make_engine_fails;
  std::vector<EngineEvent> engine_events;
  std::map<std::string, std::vector<uint64_t>> transfers_failed;  // as reported, by display
  std::optional<Core> core;

 private:
  // Engines are made in the order of displays; those that replace a lost one belong to the first.
  std::shared_ptr<EngineScript> engine_script(int made) {
    const size_t i = made < displays_ || displays_ == 0 ? made : 0;
    while (scripts_.size() <= i) scripts_.push_back(std::make_shared<EngineScript>());
    return scripts_[i];
  }

  int engines_made_ = 0;
  int displays_ = 0;
  std::vector<std::shared_ptr<EngineScript>> scripts_;
  std::vector<ScriptedDisplay*> display_;
};

}  // namespace voxeld::daemon::testing
