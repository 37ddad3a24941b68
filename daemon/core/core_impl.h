// The inside of Core. Everything here runs on the core's thread (in a simulation: in Step) unless
// it says otherwise.
#pragma once

#include <atomic>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "daemon/core/core.h"
#include "daemon/core/scene_watch.h"
#include "daemon/pipeline/frame_pipeline.h"
#include "daemon/pipeline/loop.h"
#include "daemon/scene/scene_store.h"
#include "display/sync/clock.h"
#include "display/sync/mutex.h"

namespace voxeld::daemon {

class Core::Impl {
 public:
  Impl(CoreOptions options, sync::Clock& clock);

  // ---- any thread
  const CoreOptions& options() const { return options_; }
  Loop& loop() { return *loop_; }
  SceneWatch& scene_watch() { return scene_watch_; }
  CaptureId NewCapture() { return next_capture_++; }
  absl::Status AddDisplay(std::unique_ptr<display::Display> display,
                          const gpu::EngineOptions& engine, const ViewOptions& view);
  // `self` keeps this alive while the core's thread runs.
  absl::Status Start(std::shared_ptr<Impl> self);
  absl::Status Stop(sync::TimeNs limit);
  sync::TimeNs Step();

  // ---- sessions (sessions.cc)
  void OpenSession(OpenOptions options, std::shared_ptr<SessionSink> sink,
                   const Reply<SessionInfo>& reply);
  void Handle(SessionId id, std::vector<Operation> operations, const Refusals& refused,
              uint64_t bytes);
  void CloseSession(SessionId id);
  void CountOverrun() { ++streams_overrun_; }
  void ClearLayer(uint64_t owner, const std::string& layer, bool keep_state,
                  const Reply<Cleared>& reply);

  // ---- queries (queries.cc)
  void ListEntities(const EntityQuery& query, const Reply<EntityPage>& reply) const;
  void GetEntity(const EntityKey& key, const Reply<EntityInfo>& reply) const;

  // ---- displays (displays.cc)
  void GetStats(Reply<Stats> reply);
  void ListDisplays(Reply<std::vector<DisplayDescription>> reply);
  void GetDisplay(const std::string& name, Reply<DisplayDescription> reply);
  void UpdateDisplay(const std::string& name, DisplayUpdate update,
                     Reply<DisplayDescription> reply);
  void Capture(const std::string& name, CaptureId id, sync::TimeNs timeout,
               uint64_t at_least_snapshot, Reply<display::DecodedVolume> reply);
  void CancelCapture(const std::string& name, CaptureId id);

 private:
  struct Session {
    SessionId id = 0;
    uint64_t owner = 0;
    OpenOptions options;
    WriterPtr writer;
    std::shared_ptr<SessionSink> sink;
    // Since the last commit.
    std::vector<Operation> staged;
    uint64_t staged_bytes = 0;
    uint64_t refused = 0;
    std::string first_refusal;
    uint64_t issues_told = 0, issues_left_out = 0;
  };

  struct Lingering {
    SessionId session = 0;
    uint64_t owner = 0;
  };

  // A display's pipeline and the queue of its thread. Shared with the thread,
  // which may outlive Stop's limit.
  struct Host {
    std::shared_ptr<Loop> work;
    std::unique_ptr<FramePipeline> pipeline;
  };
  struct DisplaySlot {
    display::DisplayInfo info;
    gpu::Affine scene_to_voxel;
    std::vector<gpu::Affine> coming;  // views on their way to the pipeline, in that order
    std::shared_ptr<Host> host;
  };

  // The threads that run, by name. Shared with them.
  struct Running {
    sync::Mutex mutex;
    sync::CondVar changed;
    std::set<std::string> names VOXELD_GUARDED_BY(mutex);
  };
  struct NamedThread {
    std::string name;
    std::thread thread;
  };

  // ---- threads (threads.cc)
  void Launch(std::string name, std::function<void()> body);
  // Waits until none of `names` runs; answers those that still do at `deadline`.
  std::set<std::string> AwaitEnd(const std::set<std::string>& names, sync::TimeNs deadline);
  absl::Status StartPipelines();
  void RunCore();
  static void RunPipeline(Host& host);

  // ---- sessions
  void Stage(Session& session, Operation operation);
  void Refuse(Session& session, const Issue& issue);
  // Tells the session's client, unless it has been told max_issues_per_commit since the last commit.
  void Tell(Session& session, const Issue& issue);
  // Says how many Issues were left out, if any were, and counts anew.
  void TellOfThoseLeftOut(Session& session, uint64_t sequence);
  void EndCommit(Session& session, const Operation& operation);
  void DeliverOutcome(const Rider& rider, const CommitOutcome& outcome);
  void RemoveLayersOf(SessionId session, uint64_t owner);
  bool OwnerIsOpen(uint64_t owner) const;
  // Expiries and lingering layers that are due; answers when more are.
  sync::TimeNs RunDue();
  // Hands the newest snapshot to every display, unless they have it.
  void Publish();

  // ---- displays
  absl::StatusOr<DisplaySlot*> FindDisplay(const std::string& name);
  // What coordinates must fit: every display's view, and those to come.
  void UpdateViews();
  // Notes a view to come, unless the scene does not fit it.
  absl::Status ExpectView(DisplaySlot& slot, const ViewOptions& view);
  // Asks every pipeline and calls `done` with all answers;
  // `absent` stands in for one that has ended.
  template <typename T>
  void Collect(std::function<T(const FramePipeline&)> ask,
               std::function<T(const DisplaySlot&)> absent,
               std::function<void(std::vector<T>)> done);

  const CoreOptions options_;
  sync::Clock& clock_;
  const sync::TimeNs started_ns_;
  const std::shared_ptr<Loop> loop_;
  SceneStore store_;
  SnapshotPtr published_;
  SceneWatch scene_watch_;

  // Grows before Start only; a slot's scene_to_voxel is the core thread's.
  std::vector<std::unique_ptr<DisplaySlot>> displays_;

  std::map<SessionId, Session> sessions_;
  std::multimap<sync::TimeNs, Lingering> lingering_;
  SessionId next_session_ = 1;
  uint64_t next_owner_ = 1;
  std::atomic<CaptureId> next_capture_ = 1;
  uint64_t staged_bytes_ = 0;  // of all sessions

  uint64_t commits_accepted_ = 0, commits_refused_ = 0;
  uint64_t operations_applied_ = 0, operations_refused_ = 0;
  uint64_t bytes_in_ = 0, outcomes_undelivered_ = 0;
  uint64_t client_drops_ = 0, streams_overrun_ = 0;

  // Of the thread that owns Core.
  enum class Phase : uint8_t { kNew, kRunning, kStopped };
  Phase phase_ = Phase::kNew;
  std::vector<NamedThread> threads_;
  const std::shared_ptr<Running> running_ = std::make_shared<Running>();
};

}  // namespace voxeld::daemon
