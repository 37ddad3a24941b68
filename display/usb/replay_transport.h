// A transport that replays a device's recording (recording_transport.h): a driver that does what
// the recorded one did gets the same answers.
//
// Transfers are compared with those recorded, in order on each endpoint. A completion comes after
// everything that was submitted or completed before it in the recording, and not sooner after its
// submission than recorded. If the driver deviates, Submit returns the difference, and the device
// is gone for good. At the end of each recorded session the device is unplugged; the next Open
// plays the next session, whose device arrives after the same pause as in the recording.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "display/sync/clock.h"
#include "display/sync/mutex.h"
#include "display/usb/recorded_session.h"
#include "display/usb/usb_transport.h"

namespace voxeld::display {

class ReplayTransport final : public UsbTransport {
 public:
  struct Options {
    bool own_thread = true;  // false: the owner calls Pump
    // Completions and sessions do not wait for their recorded time. Actions that a driver times by
    // its clock must then come at the same point of the recording.
    bool at_once = false;
    size_t max_bytes_in_flight = size_t{16} << 20;
    UsbIdentity identity{.path = "recording"};
  };

  // Errors: InvalidArgument with what is wrong with the recording.
  static absl::StatusOr<std::unique_ptr<ReplayTransport>> Make(std::vector<std::byte> recording,
                                                               sync::Clock& clock, Options options);
  // The same from a file; the error names it. Refuses files of more than `max_bytes`, because a
  // recording is held in memory.
  static absl::StatusOr<std::unique_ptr<ReplayTransport>> FromFile(const std::string& path,
                                                                   sync::Clock& clock,
                                                                   Options options,
                                                                   uint64_t max_bytes = uint64_t{4}
                                                                                        << 30);
  ~ReplayTransport() override;

  // Thread-safe: returns how the driver deviated from the recording; OK if it did not.
  absl::Status status() const;
  // Thread-safe: returns whether every recorded transfer was submitted, and every session ended.
  bool finished() const;

  absl::Status Open() override;
  void Close() override;
  bool is_open() const override;
  UsbIdentity identity() const override { return options_.identity; }
  absl::StatusOr<TransferId> Submit(Transfer&& transfer) override;
  void Cancel(TransferId id) override;
  absl::StatusOr<TransferId> ClearHalt(uint8_t endpoint) override;
  absl::StatusOr<TransferId> Reset() override;
  TransferBytes TakeBuffer(size_t capacity) override;
  size_t Drain(std::vector<TransferCompletion>& out) override;
  size_t bytes_in_flight() const override;
  size_t max_bytes_in_flight() const override { return options_.max_bytes_in_flight; }
  void SetWake(std::function<void()> wake) override;
  bool TakeArrival() override;

  // Completes what is due, and returns when to call it again. Any thread.
  sync::TimeNs Pump();

 private:
  struct Played {  // state of a recorded transfer
    bool submitted = false, ended = false;
    TransferId id = 0;
    sync::TimeNs submitted_at = 0;
  };
  struct Pending {
    static constexpr size_t kNotRecorded = SIZE_MAX;
    size_t recorded = kNotRecorded;  // its index
    Transfer transfer;
    size_t size = 0;
    sync::TimeNs deadline = sync::kNever;
  };

  ReplayTransport(std::vector<std::byte> recording, std::vector<RecordedSession> sessions,
                  sync::Clock& clock, Options options);

  void Run();
  absl::Status Compare(const RecordedTransfer& recorded, const Transfer& transfer) const;
  // Returns the error for a transfer that the recording does not have.
  absl::Status Unrecorded(const Transfer& transfer) VOXELD_REQUIRES(mutex_);
  void Complete(TransferId id, TransferStatus status, uint32_t actual,
                std::span<const std::byte> in) VOXELD_REQUIRES(mutex_);
  void Unplug() VOXELD_REQUIRES(mutex_);
  // Plays what is due of the session, and returns when the next step is due.
  sync::TimeNs Play(sync::TimeNs now) VOXELD_REQUIRES(mutex_);
  void ExpireTimeouts(sync::TimeNs now) VOXELD_REQUIRES(mutex_);
  const RecordedSession& session() const VOXELD_REQUIRES(mutex_) { return sessions_[session_]; }

  const std::vector<std::byte> recording_;
  const std::vector<RecordedSession> sessions_;  // views of recording_
  sync::Clock& clock_;
  const Options options_;

  mutable sync::Mutex mutex_;
  sync::CondVar work_;
  bool stop_ VOXELD_GUARDED_BY(mutex_) = false;
  bool poked_ VOXELD_GUARDED_BY(mutex_) = false;
  bool open_ VOXELD_GUARDED_BY(mutex_) = false;
  bool gone_ VOXELD_GUARDED_BY(mutex_) = false;
  bool arrived_ VOXELD_GUARDED_BY(mutex_) = false;  // not reported yet
  bool told_ VOXELD_GUARDED_BY(mutex_) = false;     // this session's device was reported
  // a session was closed before everything was submitted
  bool skipped_ VOXELD_GUARDED_BY(mutex_) = false;
  absl::Status status_ VOXELD_GUARDED_BY(mutex_);
  size_t session_ VOXELD_GUARDED_BY(mutex_) = 0;           // open, or the next to open
  sync::TimeNs there_from_ VOXELD_GUARDED_BY(mutex_) = 0;  // when it can be opened

  // State of the open session:
  size_t step_ VOXELD_GUARDED_BY(mutex_) = 0;  // the next to play
  std::vector<Played> played_ VOXELD_GUARDED_BY(mutex_);
  std::map<uint8_t, size_t> next_ VOXELD_GUARDED_BY(mutex_);  // index in by_endpoint
  std::map<TransferId, Pending> pending_ VOXELD_GUARDED_BY(mutex_);
  std::vector<TransferCompletion> completions_ VOXELD_GUARDED_BY(mutex_);
  size_t bytes_in_flight_ VOXELD_GUARDED_BY(mutex_) = 0;
  TransferId next_id_ VOXELD_GUARDED_BY(mutex_) = 1;

  sync::Mutex wake_mutex_;  // never held together with another lock
  std::function<void()> wake_ VOXELD_GUARDED_BY(wake_mutex_);
  std::thread thread_;
};

}  // namespace voxeld::display
