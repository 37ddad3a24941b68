// The driver's end of the cable: requests one at a time, events, and bulk bytes within the device's
// credit (docs/protocols/voxlink.md §7) and the transport's limit. It recovers from a failed
// transfer: nothing more is sent until everything in flight has ended, the halt is cleared, and the
// device has reported how many bytes it received.
//
// Bound to the display's thread; never blocks.
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "display/drivers/voxlink/protocol.h"
#include "display/sync/clock.h"
#include "display/usb/usb_transport.h"

namespace voxeld::display::voxlink {

// The largest bulk transfer that is submitted.
inline constexpr size_t kTransferBytes = size_t{256} << 10;

class VoxlinkLink {
 public:
  // Called from Poll only. Each of them may call the link, including Close.
  struct Client {
    virtual ~Client() = default;
    virtual void OnEvent(const EventHeader& header, std::span<const std::byte> body) = 0;
    // Delivers the answer to Read and Write; if one is refused or fails, OnLinkFailed is called.
    virtual void OnReply(Request request, std::span<const std::byte> data) = 0;
    virtual void OnConfiguration(std::span<const std::byte> descriptor) = 0;
    // Delivers the answer to AskStatus and Recover. `settled`: everything sent has been received
    // and consumed.
    virtual void OnStatus(const Status& status, bool settled) = 0;
    // The device is gone, or misbehaves. The link must be closed.
    virtual void OnLinkFailed(const std::string& reason) = 0;
  };

  struct Options {
    // Limit of bulk transfers; the transport's limit also applies.
    size_t max_bytes_in_flight = size_t{4} << 20;
    sync::TimeNs control_timeout = sync::kSecond;
    sync::TimeNs bulk_timeout = 2 * sync::kSecond;
    int max_recoveries = 6;  // without progress in between
  };

  VoxlinkLink(std::unique_ptr<UsbTransport> transport, sync::Clock& clock, Client* client,
              Options options);

  UsbTransport& transport() { return *transport_; }

  absl::Status Open();
  void Close();
  bool is_open() const { return transport_->is_open(); }

  // Requests are queued and sent one after another.
  void ResetDevice();
  void ReadConfiguration();
  void Read(Request request, uint16_t value, uint16_t length);
  void Write(Request request, uint16_t value, std::span<const std::byte> data = {});

  // Starts to listen for events of a new session; credit, counts and numbers restart.
  void BeginSession(uint32_t receive_buffer);
  void AskStatus();
  void Recover();

  // Returns when Poll must retry something; kNever if nothing.
  sync::TimeNs NextTry() const;

  // Returns how many bytes may be handed over now: 0 while recovering or without a session.
  size_t Room() const;
  // Returns an empty buffer with memory for a transfer.
  TransferBytes TakeBuffer();
  // Sends whole packets, at most Room() bytes. If the transport has no room, because other devices
  // took it, the buffer waits here.
  void Send(TransferBytes buffer);
  bool recovering() const { return recovery_ != Recovery::kNone; }
  size_t bulk_in_flight() const { return bulk_bytes_; }
  // Returns the most bytes that may ever be in flight.
  size_t bulk_limit() const;
  uint64_t sent() const { return sent_; }  // bytes of this session
  // Returns the bytes that the device is known to have consumed.
  uint64_t consumed() const {
    return credit_limit_ > receive_buffer_ ? credit_limit_ - receive_buffer_ : 0;
  }
  sync::TimeNs last_sent() const { return last_sent_; }          // when bytes were last handed over
  sync::TimeNs last_progress() const { return last_progress_; }  // when the device last gave credit
  bool failed() const { return failed_; }                        // the next Poll reports it
  // Returns how many transfers failed since the last call, for any reason of the device or the
  // cable.
  uint64_t TakeFailures() { return std::exchange(failures_, 0); }
  // The device did what was requested: resets the count of failures.
  void NoteProgress();

  // Drains completions into the client's functions.
  void Poll();

 private:
  enum class Recovery : uint8_t { kNone, kDraining, kAsking };
  enum class Kind : uint8_t {
    kConfiguration,
    kRequest,
    kStatus,
    kRecoveryStatus,
    kClearHalt,
    kReset
  };
  struct ControlRequest {
    Kind kind = Kind::kRequest;
    UsbSetup setup;
    TransferBytes data;
    uint8_t endpoint = 0;  // kClearHalt
  };

  void Enqueue(ControlRequest request);
  void SendControl();
  void NoRoom(const absl::Status& status);
  void PostEventReads();
  void OnControlDone(TransferCompletion& completion);
  void OnBulkDone(TransferCompletion& completion);
  void OnEventDone(TransferCompletion& completion);
  void EnqueueStatus(Kind kind);
  void OnStatusReply(Kind kind, std::span<const std::byte> data);
  void StepRecovery();
  void SubmitBulk(TransferBytes buffer);
  void Fail(const std::string& reason);

  const std::unique_ptr<UsbTransport> transport_;
  sync::Clock& clock_;
  Client* const client_;
  const Options options_;

  uint64_t generation_ = 0;  // counts Open: completions from before a Close are stale
  bool failed_ = false;
  std::string failure_;  // to be reported by Poll
  std::deque<ControlRequest> controls_;
  TransferId control_id_ = 0;  // 0: none in flight
  std::vector<TransferCompletion> drained_;

  bool session_ = false;
  uint32_t receive_buffer_ = 0;
  uint32_t next_event_ = 0;
  int event_reads_ = 0;
  bool events_held_ = false;  // there was no room for a read
  // when a request or a read first lacked room; 0: none does
  sync::TimeNs refused_since_ = 0;
  int event_failures_ = 0;
  bool status_asked_ = false;

  std::optional<TransferBytes> held_;  // counted in sent_, not yet submitted
  size_t bulk_bytes_ = 0;
  std::map<TransferId, size_t> bulk_;
  uint64_t sent_ = 0, credit_limit_ = 0;  // bytes since START
  uint64_t failures_ = 0;
  sync::TimeNs last_sent_ = 0, last_progress_ = 0;
  Recovery recovery_ = Recovery::kNone;
  bool halted_ = false;
  int recoveries_ = 0;
};

}  // namespace voxeld::display::voxlink
