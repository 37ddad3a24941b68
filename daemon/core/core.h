// The daemon below gRPC: sessions, the scene store, one frame pipeline a display.
// Knows no protobuf.
//
//   Core core(options, clock);
//   core.AddDisplay(std::move(display), engine_options);
//   core.Start();                                   // or, in a simulation, Step() by hand
//   SessionId id = *core.OpenSession(open, sink);
//   info.intake->Take({operations, refused, bytes});  // from here on
//   core.CloseSession(info);
//   core.Stop(deadline);
//
// Threads: the public functions are thread-safe and only post to the core's thread (queries post
// and answer by callback on the core's thread, or on the display's pipeline thread; callbacks must
// only post). One more thread a display runs its pipeline. With CoreOptions::threads = false there
// are none: Step() does everything that is due, in the caller's thread, so that a whole daemon can
// be simulated under a FakeClock; Turn() does what one of the threads would do next.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "daemon/core/budget.h"
#include "daemon/core/intake.h"
#include "daemon/core/receipt.h"
#include "daemon/core/session_sink.h"
#include "daemon/core/state_sink.h"
#include "daemon/core/stats.h"
#include "daemon/pipeline/display_settings.h"
#include "daemon/pipeline/engine_event.h"
#include "daemon/pipeline/shown_scene.h"
#include "daemon/scene/operation.h"
#include "display/api/display.h"
#include "display/sync/clock.h"
#include "gpu/bulk/bulk_pool.h"
#include "gpu/engine.h"

namespace voxeld::daemon {

class SceneWatch;
using SessionId = uint64_t;
using display::CaptureId;
using WatchId = uint64_t;  // from 1

struct CoreOptions {
  Limits limits;
  // Where clients' large arrays are decoded to, and engines read them. Empty: a pool of its own, with
  // room for what the limits allow.
  std::shared_ptr<gpu::BulkPool> bulk;
  std::string version;
  bool threads = true;
  // Makes every engine; empty: gpu::CreateEngine. Called from AddDisplay, and on a display's thread
  // when its engine was lost.
  std::function<absl::StatusOr<std::unique_ptr<gpu::Engine>>(const gpu::EngineOptions&)>
      make_engine;
  // The size (ChangesByOwner) from which displays prepare an owner's change with a second engine.
  uint64_t large_change = kLargeChange;
  // With threads = false: runs the work that takes long (FramePipeline::Options). Empty: inside the call.
  std::function<void(std::function<void()>)> run_aside;
  // What becomes of engines in processes of their own; on the core's thread. May be empty.
  std::function<void(const EngineEvent&)> engine_event;
  // A display's state, whenever it or its reason changes; on the core's thread. May be empty.
  std::function<void(const std::string& display, display::DisplayState state,
                     const std::string& reason)>
      state_event;
  // Transfers to a display's device that failed, not oftener than LinkWatch says; on the core's thread. May be empty.
  std::function<void(const std::string& display, uint64_t failed)> transfers_event;
  // Keeps what outlives the daemon, and lives longer than the core; none: nothing does.
  StateSink* state = nullptr;
  std::function<StateFigures()> state_figures;      // for Stats; from any thread. May be empty
  std::function<AssetFigures()> asset_figures;      // the same
  std::function<ProcessFigures()> process_figures;  // the same
  // The listener's figures, for Stats; from any thread. May be empty.
  std::function<ListenFigures()> connections;
};

struct SessionInfo {
  SessionId session = 0;
  uint64_t owner = 0;
  std::vector<std::string> displays;
  std::shared_ptr<Intake> intake;  // takes its messages
  uint64_t incarnation = 0;        // of the session: a resume makes the next
  std::string resume_token, owner_token;
  uint64_t credit_bytes = 0;  // the first
  // After a resume: of the last commit applied, if there was one.
  std::optional<uint64_t> last_frame_id, last_sequence;
};

struct OwnerInfo {
  uint64_t owner = 0;
  std::string principal;  // empty: nobody in particular
  std::vector<std::string> client_names;
  uint64_t sessions = 0, layers = 0, orphaned_layers = 0, entities = 0, objects = 0, bytes = 0;
  bool hidden = false;
  uint64_t max_bytes = 0, max_entities = 0;
};

// What an operator asks of an owner; absent: as it was. A quota of 0 is back to Limits'.
struct OwnerControl {
  uint64_t owner = 0;
  std::optional<bool> hidden;
  std::optional<uint64_t> max_bytes, max_entities;
  bool evict = false;
};

struct EntityKey {
  uint64_t owner = 0;
  std::string layer, id;
  auto operator<=>(const EntityKey&) const = default;
};

struct EntityInfo {
  EntityKey key;
  std::string kind;
  uint64_t vertices = 0, bytes = 0;
  uint32_t priority = 0;
  bool erase = false;
  gpu::Affine transform;
  uint64_t sequence = 0;
  sync::TimeNs expires_ns = 0;
  std::string label;
  uint32_t color = 0;  // 0x00RRGGBB
};

struct LayerInfo {
  uint64_t owner = 0;
  std::string layer;
  uint64_t number = 0;
  bool visible = true;
  uint32_t opacity = 255;
  int32_t order = 0;
  gpu::BlendMode blend = gpu::BlendMode::kOver;
  gpu::Affine transform;
  Clip clip;
  std::optional<gpu::Region> region;
  std::string mask;  // empty: none
  uint64_t entities = 0, bytes = 0;
  bool orphaned = false;
  std::string client_name;
};

struct EntityQuery {
  uint64_t owner = 0;  // 0: all
  std::string layer, id_prefix;
  uint32_t page_size = 1000;
  std::string page_token;
};

struct EntityPage {
  std::vector<EntityInfo> entities;
  std::vector<LayerInfo> layers;
  std::string next_page_token;
  uint64_t total = 0;
};

struct Cleared {
  uint64_t entities = 0, layers = 0;
};

class Core {
 public:
  template <typename T>
  using Reply = std::function<void(absl::StatusOr<T>)>;

  Core(CoreOptions options, sync::Clock& clock);
  ~Core();  // stops, if it still runs
  Core(const Core&) = delete;
  Core& operator=(const Core&) = delete;

  const Limits& limits() const;
  gpu::BulkPool& bulk() const;  // thread-safe

  // Before Start. The name must be new. The engine is made here; its failure is the answer.
  absl::Status AddDisplay(std::unique_ptr<display::Display> display,
                          const gpu::EngineOptions& engine, const DisplaySetup& setup = {});
  // Before Start, after AddDisplay: what was kept. What cannot be had any more, by limits that are lower
  // now say, is left out, and an Issue says why.
  std::vector<Issue> Restore(RestoredScene scene);
  absl::Status Start();

  // Ends displays and threads; what is owed by then counts as lost or undelivered, and a commit
  // under way is refused. Returns after at most `limit`, with an error that names what had not
  // ended.
  absl::Status Stop(sync::TimeNs limit);

  // threads = false only: does all that is due and returns when more is.
  sync::TimeNs Step();
  // threads = false only, for a simulation that chooses who comes next: one turn of one of the threads that there
  // would be, as it has one whenever its wait ends; answers when the wait after it ends at the latest. Thread 0 is the
  // core's, thread n that of the n-th display.
  sync::TimeNs Turn(size_t thread);
  // Whether its wait ends now, whatever the time.
  bool Ready(size_t thread) const;

  // What is held for clients. Lives as long as anybody has it.
  const std::shared_ptr<Budget>& budget() const;

  // ---- sessions. `sink` is kept until after the answer to CloseSession, or OnEnded.
  // `open_bytes`: of the Open, which counts against the credit. ResourceExhausted past max_sessions; NotFound for a
  // token that names nothing any more. A resume ends the stream that the session had.
  void OpenSession(OpenOptions options, uint64_t open_bytes, std::shared_ptr<SessionSink> sink,
                   Reply<SessionInfo> reply);
  // Applies what its intake still holds, carries out the DisconnectPolicy, and keeps the session for a resume.
  // `gone`: its client hears nothing any more; outcomes from now on are kept for the resume. Ignored, but for
  // `done`, for a session that there is not, or that was taken up by a later incarnation.
  void CloseSession(SessionId session, uint64_t incarnation, bool gone, std::function<void()> done);
  // Outcomes that the session's sink was given and could not deliver: for a resume, else counted as undelivered.
  void GiveBack(SessionId session, std::vector<Receipt> receipts);
  // From the state's thread: that snapshot is on the disk, with what is kept of those before.
  void OnDurable(uint64_t snapshot);
  // A session's stream was ended because its client did not read: for the figures.
  void CountOverrun();
  // A watcher of volumes does not take them, and is sent no more until it does: for the figures. Any thread.
  void CountAsleep();

  // ---- queries
  // The newest snapshot, and word of the next; at once, in any thread, whatever the core is busy
  // with. A commit is in it before its Accepted is told. As long as the core.
  SceneWatch& scene_watch();
  void ListEntities(EntityQuery query, Reply<EntityPage> reply);
  void GetEntity(EntityKey key, Reply<EntityInfo> reply);
  // `principal`: of its owner's layers alone, and of none if it has none; empty text: of nobody's in particular, so
  // PermissionDenied.
  // Nothing: of everybody's.
  void ClearLayer(uint64_t owner, std::string layer, bool keep_state,
                  std::optional<std::string> principal, Reply<Cleared> reply);
  // Ascending.
  void ListOwners(Reply<std::vector<OwnerInfo>> reply);
  // NotFound, InvalidArgument for a quota above the limits'. After `evict` the answer is what was.
  void ControlOwner(OwnerControl control, Reply<OwnerInfo> reply);
  void GetStats(Reply<Stats> reply);
  void ListDisplays(Reply<std::vector<DisplayDescription>> reply);
  // An empty name is the first display; NotFound lists those there are.
  void GetDisplay(std::string name, Reply<DisplayDescription> reply);
  void UpdateDisplay(std::string name, DisplayUpdate update, Reply<DisplayDescription> reply);
  // The next volume shown that contains at least `at_least_snapshot`.
  CaptureId Capture(std::string name, sync::TimeNs timeout, uint64_t at_least_snapshot,
                    Reply<display::DecodedVolume> reply);
  // Nobody waits for it any more: its reply gets Cancelled, unless it has had its answer.
  void CancelCapture(std::string name, CaptureId id);
  // Every volume of the display as it is shown, rebuilt from the bytes that go out, from the newest on: `watcher` is
  // called on its pipeline's thread, must only post, and is let go after UnwatchVolumes or an error.
  // Watching costs the display's decoding; nothing is kept for a watcher but the newest volume.
  WatchId WatchVolumes(std::string name, display::Display::Watcher watcher);
  void UnwatchVolumes(std::string name, WatchId id);
  // The volume that watchers of the display were told last, and the scene that it was drawn from: FramePipeline::Shown.
  void GetShownScene(std::string name, Reply<ShownScene> reply);

 private:
  class Impl;
  std::shared_ptr<Impl> impl_;  // shared with its thread, which may outlive the limit of Stop
};

}  // namespace voxeld::daemon
