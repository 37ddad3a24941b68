// From snapshots to one display: takes the newest snapshot when the display's mailbox
// is free and something has changed, has the engine draw it, hands the volume over,
// and tells every commit what became of it.
//
//   auto pipeline = FramePipeline::Create({…});
//   (*pipeline)->Start();
//   loop: work.RunPosted(); next = (*pipeline)->Step(); work.Wait(next);
//   (*pipeline)->Stop();
//
// Thread: bound to one, which runs `work`; nothing here blocks (the engine's calls are
// asynchronous, and the display is ticked in between while a large delta is written).
//
// Which volumes are drawn
// - The first shows whatever the scene is, if only darkness. From then on a volume is drawn only if
//   the scene, the view or the test pattern has changed, and handed over only if its bytes differ
//   from the one before.
// - Where the display tells of its coming sweeps, a plain commit is drawn as late as it still comes to the next
//   one: what is shown is then as new as it can be. What has a time, a setting or a capture is drawn at once.
// - While the display is absent or blanked nothing is drawn; when it shows again
//   it gets the newest scene.
// - If the volume handed over last was lost, the next drawn is handed over even if it
//   looks the same.
// - While a test pattern is shown, commits are NOT_SHOWN(hidden).
// - A member of a genlock draws what its group's rounds say, under their numbers, whether or not its own picture
//   changes (genlock.h); then every round ends PRESENTED or LOST.
// - Volumes are numbered as the engine's frames are: ascending, with gaps where one
//   came out the same.
// - A large change of one owner does not hold up other owners: a second engine applies it while the first draws on with
//   what that owner had before. Then the second takes over (frame_pipeline_aside.cc). Until then the owner's commits
//   wait, in order.
// - An engine that is lost (DataLoss) is replaced by the CPU's in this process, which gets the whole
//   scene; riders stay aboard the first time. One that had a process of its own comes back by
//   EngineCare. The first volume of another engine is handed over even if it looks the same. Any
//   other failure is LOST to its riders; the engine gets the whole scene next time.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "daemon/core/budget.h"
#include "daemon/core/stats.h"
#include "daemon/pipeline/display_settings.h"
#include "daemon/pipeline/engine_care.h"
#include "daemon/pipeline/engine_event.h"
#include "daemon/pipeline/frame_pool.h"
#include "daemon/pipeline/genlock.h"
#include "daemon/pipeline/link_watch.h"
#include "daemon/pipeline/loop.h"
#include "daemon/pipeline/power_limiter.h"
#include "daemon/pipeline/rider_book.h"
#include "daemon/pipeline/shown_scene.h"
#include "daemon/pipeline/sliding_window.h"
#include "daemon/pipeline/sweep_outlook.h"
#include "daemon/scene/engine_delta.h"
#include "daemon/scene/snapshot.h"
#include "display/api/display.h"
#include "display/sync/clock.h"
#include "gpu/engine.h"

namespace voxeld::daemon {

class FramePipeline final : private display::Display::Listener {
 public:
  using MakeEngine =
      std::function<absl::StatusOr<std::unique_ptr<gpu::Engine>>(const gpu::EngineOptions&)>;

  struct Options {
    std::unique_ptr<display::Display> display;
    MakeEngine make_engine;
    gpu::EngineOptions engine;
    DisplaySetup setup;
    // Where wakes and the engine's completions go: the queue of the thread
    // that this pipeline is bound to.
    std::shared_ptr<Loop> work;
    sync::Clock* clock = nullptr;    // outlives the pipeline
    std::shared_ptr<Budget> budget;  // charged with what the engine holds; may be none
    // An outcome, inside any call to the pipeline.
    RiderBook::Tell tell;
    // Takes what the pipeline has done with: freeing a large scene takes longer than its thread may
    // be busy. Empty: it is freed on the spot.
    std::function<void(std::shared_ptr<const void>)> retire;
    // Runs work that takes long on another thread, in order. Empty: it runs inside the call.
    std::function<void(std::function<void()>)> run_aside;
    // The size (ChangesByOwner) from which an owner's change is prepared by a second engine.
    uint64_t large_change = kLargeChange;
    std::function<void(EngineEvent)> tell_engine;  // what becomes of the engine; may be empty
    // The display's state, whenever it or its reason changes; may be empty.
    std::function<void(display::DisplayState, const std::string&)> tell_state;
    // Transfers to its device that failed since the last call, or that this was last told of; may be empty.
    std::function<void(uint64_t)> tell_transfers;
    // Whose member the display is, which can hold volumes; null: it goes by itself.
    std::shared_ptr<Genlock> genlock;
  };

  // Makes the engine. Its failure, or a view that cannot be, is the answer.
  static absl::StatusOr<std::unique_ptr<FramePipeline>> Create(Options options);
  ~FramePipeline() override;  // stops

  const display::DisplayInfo& info() const { return display_->info(); }

  absl::Status Start();
  // Every commit still pending is LOST, captures are Unavailable, the engine ends.
  void Stop();
  // Does what is due; answers when more is.
  sync::TimeNs Step();

  // A newer snapshot, of a commit or of something internal. Drawn by a later Step.
  void Show(SnapshotPtr snapshot);
  // `hidden`: all the commit's operations were in hidden layers.
  // `urgent`: it must not wait for the volume in the mailbox to begin, but take its place.
  void Show(SnapshotPtr snapshot, const Rider& rider, bool hidden, bool urgent = false);

  // When the display's coming sweeps begin, as of the last Step.
  std::shared_ptr<const SweepOutlook> sweeps() const { return sweeps_; }

  // Checks every field first, and changes nothing if one is refused.
  absl::Status Update(const DisplayUpdate& update);
  DisplayDescription Describe() const;
  DisplayFigures Figures() const;

  // The next volume shown that contains at least this snapshot. DeadlineExceeded, or Unavailable
  // while the display does not show.
  void Capture(sync::TimeNs timeout, uint64_t at_least_snapshot, display::Display::CaptureDone done,
               display::CaptureId id = 0);
  // Ends the captures of that name with Cancelled.
  void CancelCapture(display::CaptureId id);
  // Display::Watch for many, until Unwatch or an error: each begins with the newest volume. Watchers are
  // called inside any call to the pipeline, and must only post. After the last has gone the display stays watched for
  // kWatchLinger: who comes and goes must not have it send volumes again and again.
  static constexpr sync::TimeNs kWatchLinger = 5 * sync::kSecond;
  void Watch(uint64_t id, display::Display::Watcher watcher);
  void Unwatch(uint64_t id);
  // The newest volume that watchers were told, and what it was drawn from. FailedPrecondition: nobody watches;
  // Unavailable: what that volume was drawn from has gone, and will be known of the next. Who asks has scenes kept for
  // kScenesLinger: a scene that was replaced lives on while a volume of it is still on its way.
  static constexpr sync::TimeNs kScenesLinger = 5 * sync::kSecond;
  absl::StatusOr<ShownScene> Shown();

 private:
  // What a volume shows: a snapshot, through the view or pattern that was set last but `settings`
  // changes from the beginning.
  struct Contents {
    uint64_t snapshot = 0;
    uint64_t settings = 0;
  };
  struct Drawing {
    uint64_t volume = 0;
    sync::TimeNs began = 0;
    Contents contents;
    Stages stages;  // from drawing_ns to sliced_ns
    FramePool::Lease lease;
    absl::Status status;  // of what went before SubmitFrame
  };
  struct PendingCapture {
    sync::TimeNs deadline = 0;
    Contents at_least;
    display::Display::CaptureDone done;
    display::CaptureId id = 0;
  };

  // A second engine, and what it holds (frame_pipeline_aside.cc).
  struct Aside {
    enum class Phase : uint8_t { kSpare, kUnderWay, kReady };
    Phase phase = Phase::kUnderWay;
    sync::TimeNs until = sync::kNever;  // kSpare: when it is released
    std::set<uint64_t> owners;          // who are held back while it applies their changes
    uint64_t number = 0;                // of the snapshot with those changes
    int rounds = 0;
    uint64_t targets = 0;  // targets_ when its target was set
    // Input and output of a round.
    SnapshotPtr goal;
    std::optional<gpu::Target> target;  // if it has to be set
    uint64_t frame = 0;
    std::vector<std::byte> bytes;
    std::vector<uint64_t> changed_in;
    gpu::Engine::Done called;
    gpu::Engine::FrameDone drawn;
    absl::Status status;  // of the calls so far
    std::unique_ptr<EngineScene> scene;
    EngineCare::Made made;  // last: it is destroyed before the buffers that it writes into
  };

  explicit FramePipeline(Options options);

  absl::Status Open(std::function<void(EngineEvent)> tell);

  void OnOutcome(const display::VolumeOutcome& outcome) override;
  void OnState(display::DisplayState state, const std::string& reason) override;
  bool HasNewer() const override;
  void OnHeld(uint64_t volume) override;
  void OnOrdered(uint64_t volume, sync::TimeNs at, bool taken) override;
  void OnStray() override;

  bool showing() const { return display_->state() == display::DisplayState::kShowing; }
  std::string WhyNotShowing() const;
  // When to begin drawing the newest: as late as it still comes to the next sweep, twice the time that frames take of
  // late and a quarter of a sweep before it, so that what is shown is as new as it can be. 0, which is at once,
  // where sweeps are not known, and for all that is not a plain commit.
  sync::TimeNs DrawFrom() const;
  bool MaybeDraw();
  // Genlock (frame_pipeline_genlock.cc), of a member: what its group has for it to do; answers when there may be more.
  sync::TimeNs StepGenlock();
  // The round to draw now, if there is one; `due`: this display has something new itself.
  std::optional<Genlock::Round> RoundToDraw(bool due);
  bool IsOfRound(uint64_t volume) const;  // and still to be drawn
  // The outcome of a volume of a round. True: its riders ride again.
  bool EndRound(const display::VolumeOutcome& outcome);
  // Light (frame_pipeline_light.cc), where the device has no brightness or power limit of its own.
  absl::Status SetBrightness(double brightness);
  absl::Status SetPowerLimit(double watts);
  bool LimitsPower() const;
  void FollowDevice();         // what of the wanted the device does by itself
  bool Admit(const Drawing&);  // whether the volume may be shown; else it is to be drawn darker
  int light_steps() const;
  void AddLight(DisplayFigures& figures) const;
  absl::StatusOr<EngineCare::Made> Make(gpu::EngineOptions options);
  bool HaveEngine();
  void TakeReturned();
  gpu::Target CurrentTarget() const;
  absl::Status ApplyDelta(size_t size);
  void OnCallDone(const absl::Status& status);
  // Charges what the engine holds. `derived`: the upper bound that was expected for the scene that it has drawn (OwnerTally::derived).
  void SetEngineBytes(uint64_t bytes, uint64_t derived);
  void OnFrame(const absl::StatusOr<gpu::FrameResult>& result);
  void OnEngineFailure(const absl::Status& status, sync::TimeNs since);
  void OnEngineLost(uint64_t id, const absl::Status& status);
  // Large changes (frame_pipeline_aside.cc). Returns the scene to draw for `newest`, which may have older parts of
  // owners whose change is being prepared.
  SnapshotPtr HoldBack(const SnapshotPtr& newest);
  bool MayHoldBack(const Snapshot& newest) const;
  bool BeginAside(const SnapshotPtr& newest);
  void BeginRound();
  bool IsAsideReady() const { return aside_ != nullptr && aside_->phase == Aside::Phase::kReady; }
  // Makes the prepared engine the one that draws. False if it first has to catch up with other owners.
  bool TakeAside();
  void OnAsideCall(const absl::Status& status);
  void OnAsideFrame(const absl::StatusOr<gpu::FrameResult>& result);
  template <typename Result>
  std::function<void(Result)> AsideCompletion(void (FramePipeline::*method)(const Result&));
  // Releases the second engine. The next volume is drawn from the newest snapshot.
  void GiveUpAside();
  void DropAside();
  void SetAsideBytes(uint64_t bytes);
  // Releases the spare engine when it is due. Returns the time when it will be.
  sync::TimeNs ReleaseSpare();
  std::set<uint64_t> HeldOwners() const;
  // Returns the number of the newest snapshot of which every change is in the volume drawn for snapshot `newest`.
  uint64_t WholeUpTo(uint64_t newest) const;
  void SubmitDrawn(Drawing drawing);
  void KeepUnchanged(const Contents& contents);
  void ShowAgain(sync::TimeNs delay);
  void DrawAgain();  // what was drawn comes to nothing: at once, with the same riders
  void ServeCaptures();
  void TellWatchers(const absl::StatusOr<display::DecodedVolume>& volume);
  sync::TimeNs LetGoOfWatch();  // when it is due; answers when
  // Scenes (frame_pipeline_requests.cc), while somebody compares: that a volume is drawn from.
  void KeepScene(uint64_t volume);
  sync::TimeNs LetGoOfScenes();
  void Breathe();
  void Tick();
  void Retire(std::shared_ptr<const void> what);
  void Told(const Rider& rider, const CommitOutcome& outcome);
  // `method` on this thread with what a call of the engine's ended in, unless the drawing that the
  // call was made for is over by then.
  template <typename Result>
  std::function<void(Result)> Completion(void (FramePipeline::*method)(const Result&));

  sync::Clock& clock_;
  const std::shared_ptr<Loop> work_;
  const std::unique_ptr<display::Display> display_;
  const MakeEngine make_engine_;
  const gpu::EngineOptions engine_options_;
  std::string takeover_;  // why the engine is not the one that was asked for
  const RiderBook::Tell tell_;
  const std::function<void(std::shared_ptr<const void>)> retire_;
  const std::function<void(std::function<void()>)> run_aside_;
  const uint64_t large_change_;
  const std::function<void(display::DisplayState, const std::string&)> tell_state_;
  const std::function<void(uint64_t)> tell_transfers_;

  uint64_t engines_made_ = 0;
  EngineCare::Made made_;
  std::unique_ptr<EngineCare> care_;  // of an engine in a process of its own
  std::string reason_;                // why that kind, while it is there
  uint64_t first_volume_ = 0;         // of one that came back
  bool engine_is_new_ = false;        // it came back, and has drawn nothing yet
  gpu::EngineInfo engine_info_;       // of the engine, or why there is none
  std::shared_ptr<bool> alive_ = std::make_shared<bool>(true);
  std::shared_ptr<Aside> aside_;
  std::shared_ptr<bool> aside_alive_;  // while a round is under way
  uint64_t aside_bytes_ = 0;           // charged for it
  sync::TimeNs no_aside_until_ = 0;    // after a failure
  // By owner whose older part is drawn: the number of the snapshot that this part is from.
  std::map<uint64_t, uint64_t> held_back_;
  SnapshotPtr drawn_scene_;    // planned last; null: unknown, or a pattern
  uint64_t drawn_number_ = 0;  // of the snapshot that its other owners' parts are from
  bool started_ = false;
  const std::shared_ptr<Genlock> genlock_;
  Genlock::Member member_ = 0;
  uint64_t dropping_ = 0;  // the volume that the genlock had dropped last

  const DisplaySetup setup_;
  double wanted_brightness_ = 1, wanted_limit_w_ = 0;
  LightMeter meter_;
  PowerLimiter limiter_;
  int target_steps_ = kLightSteps;  // that the engine draws with
  ViewOptions view_;
  gpu::Affine scene_to_voxel_;
  TestPattern pattern_ = TestPattern::kNone;
  SnapshotPtr pattern_scene_;

  SnapshotPtr newest_;
  std::unique_ptr<EngineScene> scene_;  // that the engine holds
  FramePool pool_;
  std::optional<Drawing> drawing_;
  bool urgent_ = false;                     // draw, though a volume waits in the mailbox
  std::optional<uint64_t> drawn_snapshot_;  // the newest that a draw was begun for
  gpu::Target target_;                      // that the engine was told last
  uint64_t targets_ = 0;                    // how often it was set
  bool target_stale_ = true;       // the engine has not been told the target that there is now
  bool settings_changed_ = false;  // view or pattern, since a draw was last begun
  uint64_t settings_ = 0;          // changes of them, counted
  bool lost_engine_ = false;       // and no frame has come out since
  std::string refused_;            // why the engine did not draw last time; empty: it did

  uint64_t last_volume_ = 0;     // numbered
  uint64_t last_submitted_ = 0;  // handed over
  bool show_again_ = false;      // the display may not have what was drawn last
  sync::TimeNs show_again_at_ = 0;
  std::map<uint64_t, Contents> in_display_;  // by volume handed over, without outcome
  std::optional<Contents> shown_;
  std::vector<PendingCapture> captures_;
  std::map<uint64_t, display::Display::Watcher> watchers_;  // by id
  std::optional<display::DecodedVolume> watched_;           // what they were told last
  bool watching_ = false;                                   // the display
  sync::TimeNs let_go_at_ = sync::kNever;
  std::map<uint64_t, DrawnFrom> scenes_;  // by volume, from the one told last on
  sync::TimeNs keep_scenes_until_ = 0;
  sync::TimeNs next_tick_ = 0;
  LinkWatch link_;

  RiderBook riders_;
  uint64_t lit_voxels_ = 0, singular_drawables_ = 0;
  sync::TimeNs draw_from_ = 0, draw_ns_ = 0;  // what a frame takes: the most of late
  const std::shared_ptr<Budget> budget_;
  uint64_t engine_bytes_ = 0;   // charged
  uint64_t derived_bytes_ = 0;  // told to the budget
  uint64_t volumes_drawn_ = 0, volumes_unchanged_ = 0;
  SlidingLatency commit_to_last_byte_, commit_to_presented_, assemble_, slice_, copy_;
  bool packed_as_drawn_ = false;  // the last volume
  SlidingLatency waiting_, transferring_, showing_;
  const std::shared_ptr<SweepOutlook> sweeps_ = std::make_shared<SweepOutlook>();
  SlidingRate presented_rate_;
};

}  // namespace voxeld::daemon
