// The one interface between the frame pipeline and any display.
//
// Threads: an object is bound to one thread (its pipeline's), which makes every call; only the wake
// function that it was given may be called from elsewhere. No call blocks. Completions of the
// transport arrive in a queue, a wake makes the owner call Tick, and Tick does all the work.
//
// The base class holds what no driver may get wrong: the state machine, the newest-frame mailbox
// (one volume in flight, one waiting), exactly one outcome a volume, and the tap for captures. A
// driver implements the protected Do… functions.
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

// Fixed for the lifetime of a Display. Geometry and format are data,
// from its options or its profile.
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
  // Sweeps for which the device had to repeat a volume while a newer was on its way.
  uint64_t underruns = 0;
  // Volumes whose sending began before a sweep that they then missed: shown at a later one.
  uint64_t volumes_late = 0;
  uint64_t attaches = 0;
  uint64_t transfers_failed = 0;  // that the driver overcame, and those that lost the device
};

// A volume rebuilt from wire bytes: what an eye would see. Cheap to copy; the pictures are shared.
struct DecodedVolume {
  enum class Source : uint8_t { kDecodedFromSent, kReportedByDevice };
  uint64_t volume = 0;
  FrameLayout layout;
  std::vector<Picture> pictures;  // layout.pictures(), none of them null
  Source source = Source::kDecodedFromSent;

  // The light of slices [first, first + count), sub-frames averaged: count · height · width · 3
  // bytes of 8-bit RGB, row-major (see SliceToRgb).
  std::vector<uint8_t> Rgb(int32_t first, int32_t count) const;
  std::vector<uint8_t> Rgb() const { return Rgb(0, layout.slices); }
};

// Rebuilds volumes from a driver's outgoing wire bytes. Single-threaded.
class WireDecoder {
 public:
  virtual ~WireDecoder() = default;
  // `endpoint` as on the wire; `device` counts those of a display that has several, else 0. An error
  // means that the bytes break the protocol.
  virtual absl::Status OnBytes(uint8_t endpoint, std::span<const std::byte> bytes,
                               size_t device) = 0;
  // The newest complete volume, once; nothing if none was completed since the last call.
  virtual std::optional<DecodedVolume> TakeVolume() = 0;
};

// Names a capture to whoever asked for it; 0: it has no name.
using CaptureId = uint64_t;

class Display {
 public:
  // Called inside Start, Submit, Tick, Stop, SetBlank on the owner's thread; must not call back.
  struct Listener {
    virtual ~Listener() = default;
    virtual void OnOutcome(const VolumeOutcome& outcome) = 0;
    virtual void OnState(DisplayState state, const std::string& reason) = 0;
    // Asked when the device is set up: true if the volume that the display had last is not the newest
    // that there is to show. Then nothing is shown before a Submit, or ShowCurrent: no stale picture.
    virtual bool HasNewer() const { return false; }
    // Of a display that holds: the device has the volume whole, and waits for the order to show it.
    virtual void OnHeld(uint64_t /*volume*/) {}
    // What came of an order: `taken`, the volume will be shown then unless another order comes in time.
    virtual void OnOrdered(uint64_t /*volume*/, sync::TimeNs /*at*/, bool /*taken*/) {}
    // A volume that was dropped, after it had been ordered shown, was shown all the same.
    virtual void OnStray() {}
  };
  // Both called where a listener's functions are; must not call back.
  using CaptureDone = std::function<void(absl::StatusOr<DecodedVolume>)>;
  using Watcher = std::function<void(absl::StatusOr<DecodedVolume>)>;

  virtual ~Display() = default;  // a driver's destructor calls Stop
  Display(const Display&) = delete;
  Display& operator=(const Display&) = delete;

  const DisplayInfo& info() const { return info_; }
  DisplayState state() const { return state_; }
  const std::string& state_reason() const { return state_reason_; }
  const DisplayStats& stats() const { return stats_; }

  // From kStopped; FailedPrecondition otherwise. `listener` outlives the display's stop; `wake` is
  // thread-safe, cheap, and asks for a Tick soon. Volumes are counted anew.
  absl::Status Start(Listener* listener, std::function<void()> wake);

  // Ends what is in flight (each volume still owed gets kLost) and goes to kStopped.
  // Safe at any time.
  void Stop();

  // Takes a volume, in any state between Start and Stop (outside there is no listener to tell:
  // it is dropped). While one is in flight it waits; one that waited gets kReplaced.
  // A volume submitted while not kShowing waits for the device to come, unless blanked:
  // then kLost at once. `frame->volume` must ascend and `frame->layout` must be info().layout:
  // what breaks that is kLost at once.
  void Submit(SliceFramePtr frame);

  // After the listener said that it has a newer one: it turned out to be the same, or cannot be had.
  void ShowCurrent();

  // True if no volume waits:
  // a pipeline that only draws when this holds never has a volume replaced.
  bool mailbox_free() const { return waiting_ == nullptr; }

  // Does what is due, drains completions; returns when it wants to be called again at the latest.
  // Any other call may bring that time forward: call Tick after it.
  sync::TimeNs Tick();

  // The device's global brightness, 0 to 1; dark and light again. InvalidArgument for a value
  // outside; what the device refuses is as it was. Both are kept while there is no device, and are
  // part of its set-up; a device that comes and has no brightness sets it back to 1. What waits or
  // is in flight when the display is blanked gets kLost; light again brings back the volume before.
  absl::Status SetBrightness(double brightness);
  absl::Status SetBlank(bool blank);
  // The most that the device may draw, in watts, 0 for no limit: kept here, also for a device that comes later. Unimplemented if
  // the device that is there, or any of the driver's, keeps none.
  absl::Status SetPowerLimit(double watts);
  double brightness() const { return brightness_; }
  double power_limit_w() const { return power_limit_w_; }
  // Of the device that is there.
  bool keeps_power_limit() const { return keeps_power_limit_; }
  bool blanked() const { return blanked_; }

  // The next volume shown, rebuilt from the bytes that go out; if no new one comes, the display
  // re-sends the current one whole for it, or a black one (number 0) if it never had any; such a
  // volume has no outcome. `done` gets DeadlineExceeded after `timeout`, Unavailable when the
  // display stops, is blanked or is lost (at once, if it is already).
  void Capture(sync::TimeNs timeout, CaptureDone done, CaptureId id = 0);
  // Ends the captures of that name, inside the call, with Cancelled.
  void CancelCapture(CaptureId id);

  // Every volume as it is shown, rebuilt from the bytes that go out, until Unwatch: first the current
  // one, which is sent again whole for it if nothing newer comes, or a black one if there was none.
  // Pictures that did not change are the same objects from one volume to the next where the driver leaves
  // them out. Of what is not shown (blanked, lost) nothing is told; of what comes after that, all.
  // An error is the last word: bytes that break the protocol. Another Watch takes the first one's place.
  void Watch(Watcher watcher);
  void Unwatch();

  // Predicted starts of coming sweeps (owner's clock), nearest first; empty if not known.
  virtual std::vector<sync::TimeNs> ComingSweeps(int /*count*/) const { return {}; }
  // How well these are known; nothing: the display has no sweeps, or says nothing of them.
  virtual std::optional<sync::SweepLock> Sweeps() const { return std::nullopt; }

  // ---- Genlock: volumes are held until they are ordered shown.
  virtual bool can_hold() const { return false; }
  // Before Start, of one that can. From then on nothing submitted is shown without an order, and nothing
  // lost or left from before is sent again by itself.
  void SetHolding() { holding_ = true; }
  bool holding() const { return holding_; }
  // Of the volume held, else nothing happens: to be shown at the sweep that begins nearest to `at`. Another order
  // takes the first one's place. The device takes it only while that sweep is `ahead` or more after the last one begun.
  void OrderShown(uint64_t volume, sync::TimeNs at, uint32_t ahead);
  // The volume, held or on its way there, is not to be shown: it is kLost.
  void DropHeld(uint64_t volume, const std::string& reason);

 protected:
  Display(DisplayInfo info, sync::Clock& clock);

  // Begin to attach; go on in DoTick; report by Attached or DeviceLost.
  virtual absl::Status DoStart() = 0;
  // Ends all transfers and closes the device; from its return on Wake is not called any more. Must
  // not wait for the device.
  virtual void DoStop() = 0;
  // Begins to send `frame` (only when attached and nothing is in flight). With `full` no slice may
  // be left out; otherwise those that changed since the last volume the device completed. Ends in
  // FrameDone or FrameLost, from here or from DoTick.
  virtual void DoSend(const SliceFramePtr& frame, bool full) = 0;
  virtual sync::TimeNs DoTick(sync::TimeNs now) = 0;
  // Only while attached; set-up applies brightness() and blanked() by itself.
  virtual absl::Status DoSetBrightness(double brightness) = 0;
  virtual absl::Status DoSetBlank(bool blank) = 0;
  // Of drivers whose devices may keep one: whether they may, and to set it, of one that does; set-up says
  // KeepsPowerLimit, and applies power_limit_w().
  virtual bool may_keep_power_limit() const { return false; }
  virtual void DoSetPowerLimit(double /*watts*/) {}
  virtual std::unique_ptr<WireDecoder> DoMakeDecoder() const = 0;
  // Of drivers that can hold. What is in flight is held, or is not to be: FrameLost follows.
  virtual void DoOrderShown(sync::TimeNs /*at*/, uint32_t /*ahead*/) {}
  virtual void DoDropHeld(const std::string& /*reason*/) {}

  // For drivers, on the owner's thread.
  void Attached();  // the device is set up: the current frame goes out first
  void HasNoBrightness() { brightness_ = 1; }  // found while attaching
  void KeepsPowerLimit(bool keeps) { keeps_power_limit_ = keeps; }
  // What it is that is looked for, while there is none.
  void NoDevice(const std::string& reason);
  // Whatever is in flight (`bytes` of it sent) is lost; DoTick attaches again.
  void DeviceLost(const std::string& reason, uint64_t bytes = 0);
  void FrameDone(sync::TimeNs shown_ns, Evidence evidence, sync::TimeNs last_byte_ns,
                 uint64_t bytes);
  void FrameLost(const std::string& reason, uint64_t bytes);
  // Whether what is in flight is to be held when it is whole; then FrameHeld instead of showing it.
  bool holds_in_flight() const { return holding_ && owed_; }
  void FrameHeld();
  void FrameOrdered(sync::TimeNs at, bool taken);
  void FrameStray();
  // Every outgoing byte of a volume.
  void TapOut(uint8_t endpoint, std::span<const std::byte> bytes, size_t device = 0);
  bool tapped() const { return decoder_ != nullptr; }
  // Any thread.
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
  // Ends in_flight_, or what waits, without a show; told if owed.
  void LoseInFlight(const std::string& reason, uint64_t bytes);
  void LoseWaiting(const std::string& reason);
  void SendNext();
  // The capture's volume is in `decoder_`, or an error is to be told; ends the tap, if nobody watches.
  void FinishCaptures(const absl::StatusOr<DecodedVolume>& result);
  void ExpireCaptures(sync::TimeNs now);
  // What the decoder has, after the volume of that number was shown. There is a decoder.
  absl::StatusOr<DecodedVolume> Decoded(uint64_t volume);
  void TellWatcher(const absl::StatusOr<DecodedVolume>& volume);
  // Takes out those for which `goes` holds; without any left, and nobody watching, the tap ends.
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
  SliceFramePtr presented_;  // the newest shown: of a display that holds, what captures show again
  SliceFramePtr newest_;     // the newest volume given to DoSend: what belongs on the display
  bool owed_ = false;        // in_flight_ still owes its outcome (false: a re-send of our own)
  bool held_ = false;        // since the attach, until there is the newest volume
  bool full_next_ = true;    // the next volume may leave out nothing
  bool sending_ = false;     // inside SendNext
  bool holding_ = false;
  bool in_flight_held_ = false;
  sync::TimeNs due_ = 0, due_period_ = 0;  // the sweep that in_flight_ is for; 0: not known
  uint64_t last_volume_ = 0;               // newest number submitted
  sync::TimeNs resend_at_ = sync::kNever;  // newest_ goes out again, if nothing newer did before
  sync::Backoff resend_{100 * sync::kMillisecond, 5 * sync::kSecond};

  std::unique_ptr<WireDecoder> decoder_;
  absl::Status decoder_status_;
  std::vector<PendingCapture> captures_;
  Watcher watcher_;         // empty: nobody watches
  bool watch_due_ = false;  // it has had no volume yet
};

}  // namespace voxeld::display
