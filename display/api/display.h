// The interface between the frame pipeline and any display.
//
// Threads: an object is bound to one thread (its pipeline's), which makes every call; only the wake
// function that it was given may be called from other threads. No call blocks. Completions of the
// transport are queued, a wake makes the owner call Tick, and Tick does all the work.
//
// The base class implements what every driver must get right: the state machine, the newest-frame
// mailbox (one volume in flight, one waiting), exactly one outcome per volume, and the tap for
// captures. A driver implements the protected Do… functions.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "display/api/geometry.h"
#include "display/api/outcome.h"
#include "display/api/slice_frame.h"
#include "display/sync/backoff.h"
#include "display/sync/clock.h"
#include "display/sync/sweep_clock.h"

namespace voxeld::display {

// Fixed for the lifetime of a Display. Geometry and format come from its options or its profile.
struct DisplayInfo {
  std::string name;    // unique in the daemon
  std::string driver;  // "simulated", "voxlink", …
  Geometry geometry;
  FrameLayout layout;
  Tone tone;
  double volumes_per_second = 0;  // of the sweep
};

struct DisplayStats {
  uint64_t volumes_submitted = 0;
  uint64_t volumes_presented = 0;
  uint64_t volumes_replaced = 0;
  uint64_t volumes_lost = 0;
  uint64_t bytes_out = 0;
  uint64_t slices_sent = 0;
  uint64_t slices_resent = 0;
  // Sweeps for which the device had to repeat a volume while a newer one was being sent.
  uint64_t underruns = 0;
  // Volumes whose transfer began before a sweep that they then missed, and that were shown later.
  uint64_t volumes_late = 0;
  uint64_t attaches = 0;
  uint64_t transfers_failed = 0;  // recovered by the driver, or fatal to the device
};

// A volume rebuilt from wire bytes: what an eye would see. Cheap to copy; the slice images are
// shared.
struct DecodedVolume {
  enum class Source : uint8_t { kDecodedFromSent, kReportedByDevice };
  uint64_t volume = 0;
  FrameLayout layout;
  std::vector<Picture> pictures;  // layout.pictures(), none of them null
  Source source = Source::kDecodedFromSent;

  // Returns the light of slices [first, first + count), sub-frames averaged: count · height · width
  // · 3 bytes of 8-bit RGB, row-major (see SliceToRgb).
  std::vector<uint8_t> Rgb(int32_t first, int32_t count) const;
  std::vector<uint8_t> Rgb() const { return Rgb(0, layout.slices); }
};

// Rebuilds volumes from a driver's outgoing wire bytes. Single-threaded.
class WireDecoder {
 public:
  virtual ~WireDecoder() = default;
  // Takes outgoing bytes. `endpoint` is as on the wire; `device` is the index of the device in a
  // display that has several, else 0. An error means that the bytes violate the protocol.
  virtual absl::Status OnBytes(uint8_t endpoint, std::span<const std::byte> bytes,
                               size_t device) = 0;
  // Returns the newest complete volume once; nothing if none was completed since the last call.
  virtual std::optional<DecodedVolume> TakeVolume() = 0;
};

// Identifies a capture to its caller; 0: no identifier.
using CaptureId = uint64_t;

class Display {
 public:
  // Called inside Start, Submit, Tick, Stop and SetBlank on the owner's thread; must not call back.
  struct Listener {
    virtual ~Listener() = default;
    virtual void OnOutcome(const VolumeOutcome& outcome) = 0;
    virtual void OnState(DisplayState state, const std::string& reason) = 0;
    // Called when the device is set up. Return true if there is a newer volume to show than the
    // display's last one. Then nothing is shown before a Submit or ShowCurrent, so that no stale
    // volume appears.
    virtual bool HasNewer() const { return false; }
    // For a holding display: the device has the whole volume, and waits for the order to show it.
    virtual void OnHeld(uint64_t /*volume*/) {}
    // The result of an order: if `taken`, the volume will be shown at `at` unless another order
    // comes in time.
    virtual void OnOrdered(uint64_t /*volume*/, sync::TimeNs /*at*/, bool /*taken*/) {}
    // A volume that was dropped after it had been ordered shown was shown nevertheless.
    virtual void OnStray() {}
  };
  // Both are called at the same points as the listener's functions, and must not call back.
  using CaptureDone = std::function<void(absl::StatusOr<DecodedVolume>)>;
  using Watcher = std::function<void(absl::StatusOr<DecodedVolume>)>;

  virtual ~Display() = default;  // a driver's destructor calls Stop
  Display(const Display&) = delete;
  Display& operator=(const Display&) = delete;

  const DisplayInfo& info() const { return info_; }
  DisplayState state() const { return state_; }
  const std::string& state_reason() const { return state_reason_; }
  const DisplayStats& stats() const { return stats_; }

  // Requires state kStopped; FailedPrecondition otherwise. `listener` must outlive the display's
  // stop; `wake` is thread-safe, cheap, and requests a Tick soon. Volumes are counted from the
  // start again.
  absl::Status Start(Listener* listener, std::function<void()> wake);

  // Ends what is in flight (each volume without an outcome gets kLost) and goes to kStopped. Safe
  // at any time.
  void Stop();

  // Takes a volume, in any state between Start and Stop (outside nobody listens, and the
  // volume is dropped). While one is in flight it waits; a volume that was waiting gets
  // kReplaced. A volume submitted while not kShowing waits for the device, unless the display is
  // blanked: then it is kLost at once. `frame->volume` must ascend and `frame->layout` must be
  // info().layout: a volume that violates that is kLost at once.
  void Submit(SliceFramePtr frame);

  // Call after HasNewer returned true, if the newer volume turned out to be the same or
  // unavailable.
  void ShowCurrent();

  // Returns true if no volume waits: a pipeline that draws only then never has a volume replaced.
  bool mailbox_free() const { return waiting_ == nullptr; }

  // Does what is due and drains completions; returns the latest time for the next call. Any other
  // call may move that time forward: call Tick after it.
  sync::TimeNs Tick();

  // Sets the device's global brightness, 0 to 1, or blanks and unblanks it. Errors: InvalidArgument
  // for a value out of range; a setting that the device refuses stays unchanged. Both are kept
  // without a device, and are part of its set-up; a device that has no brightness resets it
  // to 1. Volumes that wait or are in flight when the display is blanked get kLost; unblanking
  // shows the former volume again.
  absl::Status SetBrightness(double brightness);
  absl::Status SetBlank(bool blank);
  // Sets the most power that the device may draw, in watts; 0 for no limit. The value is kept here,
  // also for a device that comes later. Unimplemented if the present device, or every device of the
  // driver, cannot enforce a limit.
  absl::Status SetPowerLimit(double watts);
  double brightness() const { return brightness_; }
  double power_limit_w() const { return power_limit_w_; }
  // Whether the present device enforces the power limit.
  bool keeps_power_limit() const { return keeps_power_limit_; }
  bool blanked() const { return blanked_; }

  // Captures the next volume shown, rebuilt from the bytes that go out. If no new one comes, the
  // display sends the current one again in full, or a black one (number 0) if it never had any;
  // such a volume has no outcome. `done` gets DeadlineExceeded after `timeout`, and Unavailable
  // when the display stops, is blanked or is lost (at once, if it is already).
  void Capture(sync::TimeNs timeout, CaptureDone done, CaptureId id = 0);
  // Ends the captures with that id, inside the call, with Cancelled.
  void CancelCapture(CaptureId id);

  // Reports every volume as it is shown, rebuilt from the bytes that go out, until Unwatch. The
  // first is the current one, which is sent again in full if nothing newer comes, or else a
  // black one. Slice images that did not change are the same objects in consecutive volumes, if
  // the driver leaves them out. While nothing is shown (blanked, lost) nothing is reported. An
  // error ends the watch: the bytes violate the protocol. Another Watch replaces the first one.
  void Watch(Watcher watcher);
  void Unwatch();

  // Returns predicted starts of coming sweeps (owner's clock), nearest first; empty if unknown.
  virtual std::vector<sync::TimeNs> ComingSweeps(int /*count*/) const { return {}; }
  // Returns how well these are known; nothing: the display has no sweeps, or does not report them.
  virtual std::optional<sync::SweepLock> Sweeps() const { return std::nullopt; }

  // ---- Genlock: the device holds volumes until they are ordered shown.
  virtual bool can_hold() const { return false; }
  // Call before Start, if can_hold(). From then on no submitted volume is shown without an order,
  // and volumes that were lost or left from before are not sent again automatically.
  void SetHolding() { holding_ = true; }
  bool holding() const { return holding_; }
  // Orders the held volume to be shown at the sweep that begins nearest to `at`; does nothing for
  // any other volume. Another order replaces the first one. The device accepts it only while that
  // sweep is at least `ahead` sweeps after the last one begun.
  void OrderShown(uint64_t volume, sync::TimeNs at, uint32_t ahead);
  // The volume, held or being sent, must not be shown: it is kLost.
  void DropHeld(uint64_t volume, const std::string& reason);

 protected:
  Display(DisplayInfo info, sync::Clock& clock);

  // Begins to attach; continues in DoTick; reports by Attached or DeviceLost.
  virtual absl::Status DoStart() = 0;
  // Ends all transfers and closes the device; Wake is not called after it returns. Must not wait
  // for the device.
  virtual void DoStop() = 0;
  // Begins to send `frame` (only when attached and nothing is in flight). With `full`, no slice may
  // be left out; otherwise only those that changed since the last volume that the device completed
  // need be sent. Ends in FrameDone or FrameLost, from here or from DoTick.
  virtual void DoSend(const SliceFramePtr& frame, bool full) = 0;
  virtual sync::TimeNs DoTick(sync::TimeNs now) = 0;
  // Called only while attached; set-up applies brightness() and blanked() by itself.
  virtual absl::Status DoSetBrightness(double brightness) = 0;
  virtual absl::Status DoSetBlank(bool blank) = 0;
  // For drivers whose devices may enforce a power limit: whether they may, and setting it on a
  // device that does. Set-up calls KeepsPowerLimit, and applies power_limit_w().
  virtual bool may_keep_power_limit() const { return false; }
  virtual void DoSetPowerLimit(double /*watts*/) {}
  virtual std::unique_ptr<WireDecoder> DoMakeDecoder() const = 0;
  // For drivers that can hold. The volume in flight is held, or must not be: FrameLost follows.
  virtual void DoOrderShown(sync::TimeNs /*at*/, uint32_t /*ahead*/) {}
  virtual void DoDropHeld(const std::string& /*reason*/) {}

  // For drivers to call, on the owner's thread.
  void Attached();  // the device is set up: the current frame is sent first
  void HasNoBrightness() { brightness_ = 1; }  // found while attaching
  void KeepsPowerLimit(bool keeps) { keeps_power_limit_ = keeps; }
  // Reports what the driver is looking for, while it finds none.
  void NoDevice(const std::string& reason);
  // The volume in flight (`bytes` of it sent) is lost; DoTick attaches again.
  void DeviceLost(const std::string& reason, uint64_t bytes = 0);
  void FrameDone(sync::TimeNs shown_ns, Evidence evidence, sync::TimeNs last_byte_ns,
                 uint64_t bytes);
  void FrameLost(const std::string& reason, uint64_t bytes);
  // Whether the volume in flight must be held when complete; then call FrameHeld instead of showing
  // it.
  bool holds_in_flight() const { return holding_ && owed_; }
  void FrameHeld();
  void FrameOrdered(sync::TimeNs at, bool taken);
  void FrameStray();
  // Call with every outgoing byte of a volume.
  void TapOut(uint8_t endpoint, std::span<const std::byte> bytes, size_t device = 0);
  bool tapped() const { return decoder_ != nullptr; }
  // Callable from any thread.
  void Wake() const {
    if (wake_) wake_();
  }
  DisplayStats& mutable_stats() { return stats_; }
  sync::Clock& clock() const { return clock_; }
  const SliceFramePtr& in_flight() const { return in_flight_; }
  bool attached() const {
    return state_ == DisplayState::kShowing || state_ == DisplayState::kBlanked;
  }

 private:
  struct PendingCapture {
    sync::TimeNs deadline;
    CaptureDone done;
    CaptureId id;
  };

  void SetState(DisplayState state, const std::string& reason);
  void Report(VolumeOutcome outcome);
  void ReportLost(uint64_t volume, const std::string& reason, uint64_t bytes);
  // Ends in_flight_, or the waiting volume, without showing it; reports an outcome if one is owed.
  void LoseInFlight(const std::string& reason, uint64_t bytes);
  void LoseWaiting(const std::string& reason);
  void SendNext();
  // Finishes captures with the volume in `decoder_`, or with an error; ends the tap if nobody
  // watches.
  void FinishCaptures(const absl::StatusOr<DecodedVolume>& result);
  void ExpireCaptures(sync::TimeNs now);
  // Returns the decoder's content after that volume was shown. Requires: decoder_ is set.
  absl::StatusOr<DecodedVolume> Decoded(uint64_t volume);
  void TellWatcher(const absl::StatusOr<DecodedVolume>& volume);
  // Removes the captures for which `goes` returns true; if none are left and nobody watches, ends
  // the tap.
  template <typename Goes>
  std::vector<PendingCapture> TakeCaptures(Goes goes);

  const DisplayInfo info_;
  sync::Clock& clock_;
  Listener* listener_ = nullptr;
  std::function<void()> wake_;
  DisplayState state_ = DisplayState::kStopped;
  std::string state_reason_;
  DisplayStats stats_;
  double brightness_ = 1;
  double power_limit_w_ = 0;
  bool keeps_power_limit_ = false;
  bool blanked_ = false;

  SliceFramePtr in_flight_, waiting_;
  SliceFramePtr presented_;  // the newest shown; what captures of a holding display show again
  SliceFramePtr newest_;     // the newest volume given to DoSend: what belongs on the display
  bool owed_ = false;        // in_flight_ has no outcome yet (false: a re-send of our own)
  bool held_ = false;        // since the attach, until the newest volume comes
  bool full_next_ = true;    // the next volume must be complete
  bool sending_ = false;     // inside SendNext
  bool holding_ = false;
  bool in_flight_held_ = false;
  sync::TimeNs due_ = 0, due_period_ = 0;  // the sweep that in_flight_ is for; 0: not known
  uint64_t last_volume_ = 0;               // newest number submitted
  sync::TimeNs resend_at_ = sync::kNever;  // newest_ is sent again then, unless a newer volume was
  sync::Backoff resend_{100 * sync::kMillisecond, 5 * sync::kSecond};

  std::unique_ptr<WireDecoder> decoder_;
  absl::Status decoder_status_;
  std::vector<PendingCapture> captures_;
  Watcher watcher_;         // empty: nobody watches
  bool watch_due_ = false;  // the watcher has had no volume yet
};

}  // namespace voxeld::display
