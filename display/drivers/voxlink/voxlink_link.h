// The driver's end of the cable: requests one at a time, events, and bulk bytes within the device's
// credit (docs/protocols/voxlink.md §7) and the transport's limit. It finds its feet again after a
// failed transfer: nothing more goes out until all that was in flight has ended, the halt is
// cleared, and the device has said how many bytes it has.
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
  // Called from Poll only. Any of them may call the link, Close included.
  struct Client {
    virtual ~Client() = default;
    virtual void OnEvent(const EventHeader& header, std::span<const std::byte> body) = 0;
    // The answer to Read and Write; a refused or failed one goes to OnLinkFailed.
    virtual void OnReply(Request request, std::span<const std::byte> data) = 0;
    virtual void OnConfiguration(std::span<const std::byte> descriptor) = 0;
    // The answer to AskStatus and Recover.
    // `settled`: all that was sent has been received and consumed.
    virtual void OnStatus(const Status& status, bool settled) = 0;
    // The device is gone, or does not behave. The link must be closed.
    virtual void OnLinkFailed(const std::string& reason) = 0;
  };

  struct Options {
    // Of bulk transfers; the transport's limit holds too.
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

  // Begins to listen for events of a new session: credit, counts and numbers start anew.
  void BeginSession(uint32_t receive_buffer);
  void AskStatus();
  void Recover();

  // When Poll has something to try again; kNever if nothing.
  sync::TimeNs NextTry() const;

  // Bytes that may be handed over now: 0 while recovering or without a session.
  size_t Room() const;
  // An empty buffer with memory for a transfer.
  TransferBytes TakeBuffer();
  // Whole packets; at most Room(). What the transport has no room for, because other devices took
  // it, waits here.
  void Send(TransferBytes buffer);
  bool recovering() const { return recovery_ != Recovery::kNone; }
  size_t bulk_in_flight() const { return bulk_bytes_; }
  // The most bytes that may ever be in flight.
  size_t bulk_limit() const;
  uint64_t sent() const { return sent_; }  // bytes of this session
  // Bytes that the device is known to have consumed.
  uint64_t consumed() const {
    return credit_limit_ > receive_buffer_ ? credit_limit_ - receive_buffer_ : 0;
  }
  sync::TimeNs last_sent() const { return last_sent_; }          // when bytes were last handed over
  sync::TimeNs last_progress() const { return last_progress_; }  // when the device last gave credit
  bool failed() const { return failed_; }                        // the next Poll tells
  // Transfers that ended otherwise than they should, by whatever the device or the cable did, since the last call.
  uint64_t TakeFailures() { return std::exchange(failures_, 0); }
  // The device did what it was asked to: failures are counted anew.
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

  uint64_t generation_ = 0;  // of Open: what comes from before a Close is stale
  bool failed_ = false;
  std::string failure_;  // to be told by Poll
  std::deque<ControlRequest> controls_;
  TransferId control_id_ = 0;  // 0: none in flight
  std::vector<TransferCompletion> drained_;

  bool session_ = false;
  uint32_t receive_buffer_ = 0;
  uint32_t next_event_ = 0;
  int event_reads_ = 0;
  bool events_held_ = false;        // there was no room for a read
  sync::TimeNs refused_since_ = 0;  // there is no room for a request or a read; 0: there is
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
