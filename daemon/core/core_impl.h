// The inside of Core. Everything here runs on the core's thread (in a simulation: in Step) unless
// it says otherwise.
#pragma once

#include <atomic>
#include <deque>
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
#include "daemon/core/token.h"
#include "daemon/pipeline/frame_pipeline.h"
#include "daemon/pipeline/loop.h"
#include "daemon/pipeline/sliding_window.h"
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
  // Drops a reference on the thread of retired_.
  void Retire(std::shared_ptr<const void> what);
  SceneWatch& scene_watch() { return scene_watch_; }
  const std::shared_ptr<Budget>& budget() const { return budget_; }
  CaptureId NewCapture() { return next_capture_++; }  // watches count along
  absl::Status AddDisplay(std::unique_ptr<display::Display> display,
                          const gpu::EngineOptions& engine, const DisplaySetup& setup);
  // `self` keeps this alive while the core's thread runs.
  absl::Status Start(std::shared_ptr<Impl> self);
  absl::Status Stop(sync::TimeNs limit);
  sync::TimeNs Step();
  sync::TimeNs ThreadTurn(size_t thread);
  bool Ready(size_t thread) const;

  // ---- sessions (sessions.cc)
  absl::StatusOr<SessionInfo> OpenSession(OpenOptions options, uint64_t open_bytes,
                                          std::shared_ptr<SessionSink> sink);
  void CloseSession(SessionId id, uint64_t incarnation, bool gone, std::function<void()> done);
  void CountOverrun() { ++streams_overrun_; }
  void CountAsleep() { ++volume_watches_asleep_; }

  // ---- outcomes (outcomes.cc)
  void GiveBack(SessionId id, const Receipt& receipt);

  // ---- owners (owners.cc)
  // ---- what outlives the daemon (kept.cc)
  std::vector<Issue> Restore(RestoredScene scene);
  void OnDurable(uint64_t snapshot);

  void ClearLayer(uint64_t owner, const std::string& layer, bool keep_state,
                  const std::optional<std::string>& principal, const Reply<Cleared>& reply);
  std::vector<OwnerInfo> ListOwners() const;
  absl::StatusOr<OwnerInfo> ControlOwner(const OwnerControl& control);

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
  void GetShownScene(const std::string& name, Reply<ShownScene> reply);
  void Watch(const std::string& name, WatchId id, const display::Display::Watcher& watcher);
  void Unwatch(const std::string& name, WatchId id);

 private:
  // What an outcome weighs that is to come, or is kept.
  static constexpr uint64_t kOwedBytes = 256;

  // A commit with must_show holds back the session's later ones.
  struct Hold {
    uint64_t sequence = 0;
    std::set<std::string> displays;  // without an outcome yet
    sync::TimeNs deadline = 0;
  };

  struct Session {
    SessionId id = 0;
    uint64_t incarnation = 0;  // counts who took it up
    uint64_t owner = 0;
    OpenOptions options;
    WriterPtr writer;
    std::shared_ptr<SessionSink> sink;  // null: its client is gone
    std::shared_ptr<Intake> intake;
    std::string resume_token;
    std::deque<WaitingCommit> due;  // timed ones whose time has come
    std::optional<Hold> hold;
    uint64_t owed_outcomes = 0;
    uint64_t timed = 0;  // commits in timed_
    // The server's clock less the client's, by the fastest of its messages.
    std::optional<int64_t> clock_offset_ns;
    sync::TimeNs clock_offset_at = 0;
    std::optional<uint64_t> last_frame_id, last_sequence;  // applied
    bool applied_any = false;                              // by this incarnation
    bool turn_posted = false;
    bool closing = false;
    std::deque<Receipt> undelivered;  // outcomes for whom its client is gone; charged to kOwed
    std::vector<std::function<void()>> when_closed;
  };

  // A session without a stream, that can be taken up.
  struct Dormant {
    uint64_t incarnation = 0, owner = 0;
    std::string resume_token;
    std::optional<uint64_t> last_frame_id, last_sequence;
    std::deque<Receipt> outcomes;  // charged to kOwed
    uint64_t owed_outcomes = 0;
    sync::TimeNs outcomes_until = 0;
    sync::TimeNs until = 0;
  };

  struct Owner {
    std::string token;
    std::string principal;  // empty: nobody in particular
    bool hidden = false;
    uint64_t max_bytes = UINT64_MAX, max_entities = UINT64_MAX;  // as an operator set them
    std::deque<SessionId> ready;  // sessions that wait for a turn, in order
  };

  // The commit of an owner that is being applied, a slice in each turn. The owner's other sessions wait until it is done.
  struct UnderWay {
    SessionId session = 0;
    WaitingCommit commit;
    Stages stages;
    std::unique_ptr<SceneStore::PendingCommit> pending;
    std::set<SessionId> waiting;  // sessions whose turn came meanwhile
  };

  // A commit whose client waits for it to be on the disk.
  struct Undurable {
    SessionId session = 0;
    uint64_t incarnation = 0, frame_id = 0, sequence = 0;
  };

  struct Timed {
    SessionId session = 0;
    WaitingCommit commit;
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
    std::string genlock;
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

  // The group of that name, for a display that can be its member.
  absl::StatusOr<std::shared_ptr<Genlock>> JoinGenlock(const display::Display& display,
                                                       const std::string& name);

  // ---- threads (threads.cc)
  void Launch(std::string name, std::function<void()> body);
  // Waits until none of `names` runs; answers those that still do at `deadline`.
  std::set<std::string> AwaitEnd(const std::set<std::string>& names, sync::TimeNs deadline);
  absl::Status StartPipelines();
  // One turn of the core's thread, of a display's: answers until when to wait.
  sync::TimeNs CoreTurn();
  static sync::TimeNs PipelineTurn(Host& host);
  void RunCore();
  void EndSessions();  // the core ends; whoever waits for an answer is told
  static void RunPipeline(Host& host);

  // ---- sessions
  absl::StatusOr<Session> NewSession(const OpenOptions& options);
  // The session that `options.resume_token` names, without what its stream left.
  absl::StatusOr<Session> TakeUp(const OpenOptions& options, std::deque<Receipt>* outcomes);
  void FinishClose(SessionId id);
  void KeepDormant(Session& session, sync::TimeNs layers_until);
  void EndDormant(SessionId id);
  void RemoveLayersOf(SessionId session, uint64_t owner);
  // Drops the objects of an owner who has neither session nor layers, and the owner when nothing is left at all.
  void ForgetOwner(uint64_t owner);
  bool OwnerIsOpen(uint64_t owner) const;
  std::string PrincipalOf(SessionId id) const;  // of a session's owner
  void PurgeLingering();
  bool HasLayers(SessionId session) const;  // that it last wrote
  absl::Status TooManySessions() const;

  // ---- commits (commits.cc)
  // Owners take turns, and each owner's sessions among themselves, so that many sessions do not get more than one.
  void PostTurn(SessionId id);
  void OwnerTurn(uint64_t owner);
  // Applies one commit of the session's, if it may have one, or a slice of it, and asks for the next turn.
  void Turn(SessionId id);
  // Takes turns until the session has closed, which it has been asked to.
  void FinishTurns(SessionId id);
  bool MustWait(const Session& session) const;
  // A timed commit that is not due yet is told Scheduled and waits; one that cannot wait is refused. False: neither,
  // apply it now.
  bool PutAside(Session& session, WaitingCommit& commit);
  sync::TimeNs DueTime(sync::TimeNs present_at) const;
  // Returns: by how much the scene may grow in this commit.
  MemoryRoom RoomFor(const WaitingCommit& commit) const;
  void Apply(Session& session, WaitingCommit commit);
  void ApplySlice(Session& session, UnderWay& under_way);
  void Conclude(Session& session, WaitingCommit commit, Stages stages, CommitResult result);
  void RefuseCommit(Session& session, const WaitingCommit& commit, uint64_t refused,
                    std::string message);
  void Ride(Session& session, const WaitingCommit& commit, const Stages& stages, bool hidden);
  Stages StagesOf(Session& session, const WaitingCommit& commit);
  void DropTimed(Session& session);
  void ReleaseHold(Session& session);
  sync::TimeNs RunTimed(sync::TimeNs now);

  // ---- what outlives the daemon (kept.cc)
  void OfferState(bool at_once);
  // Whether the commit will be told Durable; tells what stands against it.
  bool WillBeDurable(const Session& session, const WaitingCommit& commit);

  // ---- owners
  void Evict(uint64_t owner);

  // ---- outcomes
  void DeliverOutcome(const Rider& rider, const CommitOutcome& outcome);
  void Deliver(SessionId id, const Receipt& receipt);

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
  // The thread of this loop frees replaced scenes and spent operations. For a large scene that takes up to a second, which no other
  // thread can spare. Without threads it is loop_.
  const std::shared_ptr<Loop> retired_;
  // The thread of this loop prepares large changes for displays, in order. Without threads it is not used.
  const std::shared_ptr<Loop> aside_;
  SceneStore store_;
  SnapshotPtr published_;

  // Grows before Start only; a slot's scene_to_voxel is the core thread's.
  std::vector<std::unique_ptr<DisplaySlot>> displays_;
  std::map<std::string, std::shared_ptr<Genlock>> genlocks_;  // by name

  const std::shared_ptr<Budget> budget_;
  const std::shared_ptr<std::atomic<bool>> abandoned_ = std::make_shared<std::atomic<bool>>(false);
  SceneWatch scene_watch_;
  std::map<SessionId, Session> sessions_;
  std::map<uint64_t, UnderWay> under_way_;  // by owner
  std::map<SessionId, Dormant> dormant_;
  std::map<std::string, SessionId> resume_tokens_;  // of sessions and dormant ones
  std::map<uint64_t, Owner> owners_;
  std::map<std::string, uint64_t> owner_tokens_;
  std::map<std::string, uint64_t> owners_by_principal_;
  std::shared_ptr<const OwnerRecords> owner_records_;  // none: they have changed since
  std::multimap<uint64_t, Undurable> undurable_;       // by the snapshot that they made
  std::multimap<sync::TimeNs, Timed> timed_;           // by the time at which they are due
  std::set<SessionId> holding_;
  std::multimap<sync::TimeNs, Lingering> lingering_;
  static constexpr size_t kLeastLingering = 64;
  size_t purge_lingering_at_ = kLeastLingering;
  SessionId next_session_ = 1;
  uint64_t next_owner_ = 1;
  std::atomic<CaptureId> next_capture_ = 1;

  uint64_t commits_accepted_ = 0, commits_refused_ = 0;
  uint64_t operations_applied_ = 0, operations_refused_ = 0;
  const std::shared_ptr<std::atomic<uint64_t>> bytes_in_ =
      std::make_shared<std::atomic<uint64_t>>(0);
  uint64_t outcomes_undelivered_ = 0;
  uint64_t client_drops_ = 0, streams_overrun_ = 0, frames_dropped_ = 0;
  uint64_t volume_watches_asleep_ = 0;
  uint64_t timed_dropped_ = 0, must_show_timeouts_ = 0, sessions_resumed_ = 0;
  SlidingLatency sending_, decoding_, applying_;

  // Of the thread that owns Core.
  enum class Phase : uint8_t { kNew, kRunning, kStopped };
  Phase phase_ = Phase::kNew;
  std::vector<NamedThread> threads_;
  const std::shared_ptr<Running> running_ = std::make_shared<Running>();
};

}  // namespace voxeld::daemon
