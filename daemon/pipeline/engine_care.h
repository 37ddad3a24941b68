// What becomes of an engine in a process of its own that is lost: who draws meanwhile, and how it
// comes back.
//
// The pipeline draws on with a CPU engine of its own, which gives the same bytes. Meanwhile, with
// growing pauses, an engine like the one that was lost is tried, beside the pipeline and in a
// process that nobody else uses:
//
//   whole    it draws, whole, the scene that was drawn last. The bytes match: on to `shared`. They
//            do not, or it is late: it stays away, longer. It faults: the scene has faulted twice, on
//            to `search`.
//   search   by halves, with entities left out: the newest without which the scene does not fault
//            is to blame and, if the scene does fault with it, pinned: its voxels are covered on the
//            CPU from then on. Then `whole` again. If nothing at all faults too, the GPU is to blame: it
//            stays away.
//   shared   the same as `whole`, in the process that the GPU's engines share. Then it is ready, and
//            the pipeline takes it with what it holds.
//
// Thread: the pipeline's. Nothing here blocks.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "daemon/core/stats.h"
#include "daemon/pipeline/engine_event.h"
#include "daemon/pipeline/loop.h"
#include "daemon/scene/engine_delta.h"
#include "display/api/slice_frame.h"
#include "display/sync/clock.h"
#include "gpu/engine.h"

namespace voxeld::daemon {

class EngineCare {
 public:
  // An engine, and the number by which its loss is told.
  struct Made {
    std::unique_ptr<gpu::Engine> engine;
    uint64_t id = 0;
  };
  struct Options {
    std::function<absl::StatusOr<Made>(const gpu::EngineOptions&)> make_engine;
    gpu::EngineOptions engine;  // the kind that is wanted; never kAuto
    std::shared_ptr<Loop> work;
    sync::Clock* clock = nullptr;
    std::function<void()> breathe;                            // EngineScene's
    std::function<void(std::shared_ptr<const void>)> retire;  // takes what is large
    std::function<void(EngineEvent)> tell;
  };
  // A volume as it was drawn last: what it shows, and its bytes, whole.
  struct Drawn {
    SnapshotPtr scene;
    gpu::Target target;
    std::shared_ptr<const display::SliceFrame> frame;
  };
  struct Returned {
    Made made;
    std::unique_ptr<EngineScene> scene;  // what it holds
  };

  explicit EngineCare(Options options);
  ~EngineCare();

  // The wanted engine is lost (DataLoss), or has no memory for the scene, which is no fault; what
  // the pipeline was drawing, if anything, was begun at `since`.
  void OnLost(const absl::Status& why, sync::TimeNs since);
  // An engine is lost that may be the one that is ready.
  void OnEngineLost(uint64_t id, const absl::Status& why);
  // The display does not show: nobody waits for a volume.
  void OnHidden();
  bool away() const { return phase_ != Phase::kThere; }
  // The wanted engine has drawn a frame.
  void OnFrame();
  // The one in its place has, while away().
  void OnDrawn(Drawn drawn);
  // Does what is due; answers when more is.
  sync::TimeNs Step();
  bool ready() const { return phase_ == Phase::kReady; }
  // Once, when ready().
  Returned Take();

  // Pins of entities that have gone from the newest scene and from the pattern, if there is one, are
  // let go.
  void Prune(const Snapshot& newest, const Snapshot* pattern);
  // Whether any entity is drawn by the CPU.
  bool has_pins() const { return !pins_.empty(); }
  // Neither tried nor taken any more.
  void Stop();

  void AddTo(DisplayFigures& figures) const;

 private:
  enum class Phase : uint8_t { kThere, kWaiting, kTrying, kReady };
  enum class Test : uint8_t { kWhole, kSearch, kShared };
  struct Pin {
    uint64_t number = 0;
    std::optional<EntityPlace> place;
  };
  // Entities up to number `faults` left out, it faults; up to `well`, it does not.
  struct Search {
    Drawn drawn;
    bool nothing_is_well = false;  // without any entity it does not fault
    bool fault_seen = false;       // with `faults` it has faulted
    uint64_t faults = 0, well = 0;
  };
  // Numbers of the entities that are not pinned, as a plan came by them.
  struct Seen {
    uint64_t left_out = 0;        // up to this number they are
    uint64_t least = UINT64_MAX;  // of all
    uint64_t below = 0;           // the greatest that is left out
    uint64_t above = UINT64_MAX;  // the least that is not
  };
  struct Attempt {
    Test test = Test::kWhole;
    Drawn drawn;
    std::shared_ptr<Seen> seen;
    std::unique_ptr<EngineScene> scene;
    std::unique_ptr<std::byte[]> bytes;  // as many as the drawn frame's
    std::vector<uint64_t> changed_in;
    bool there = false;   // a call has succeeded
    absl::Status status;  // of what went before the frame
    Made made;            // last: its end comes before that of what it writes into
  };

  void Try(Test test, Drawn drawn, uint64_t left_out);
  absl::Status Begin(Attempt& attempt);
  template <typename Result>
  std::function<void(Result)> Completion(void (EngineCare::*method)(const Result&));
  void OnCall(const absl::Status& status);
  void OnResult(const absl::StatusOr<gpu::FrameResult>& result);
  void OnFault(const Attempt& attempt, const absl::Status& why);
  void SearchOn();
  void StayAway(const std::string& why);
  EngineScene::Choose Chooser(std::shared_ptr<Seen> seen);
  void Keep(std::optional<Drawn> drawn);
  void Retire(std::shared_ptr<const void> what) const;
  bool SameBytes(const Attempt& attempt) const;
  void Tell(EngineEvent::What what, std::string text, sync::TimeNs took = 0) const;

  const Options options_;
  sync::Clock& clock_;
  Phase phase_ = Phase::kThere;
  std::string why_;           // it was lost
  std::string away_because_;  // it has not come back
  sync::TimeNs lost_at_ = 0, next_try_ = 0, pause_;
  uint64_t frames_since_return_ = 0;
  std::optional<sync::TimeNs> holding_since_;  // nobody has drawn since the loss
  bool holding_told_ = false;
  std::optional<Drawn> drawn_;
  std::optional<Search> search_;
  bool whole_passed_ = false;
  std::shared_ptr<Attempt> attempt_;
  std::shared_ptr<bool> alive_;  // of the attempt
  std::vector<Pin> pins_;

  uint64_t faults_ = 0, mismatches_ = 0, returns_ = 0;
  uint64_t out_of_memory_ = 0;
  int64_t redraw_last_ns_ = 0, redraw_max_ns_ = 0;
  int64_t takeover_last_ns_ = 0, takeover_max_ns_ = 0, return_last_ns_ = 0, return_max_ns_ = 0;
};

}  // namespace voxeld::daemon
