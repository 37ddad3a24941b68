// A transport that records its traffic, for Wireshark and for ReplayTransport, and otherwise
// behaves as the one that it wraps.
//
// The file contains every submission with its OUT bytes; every completion, at the time it was
// drained, with its IN bytes; refused submissions; ClearHalt and Reset as the requests that they
// are. Each Open is a device address of its own, as it would be on a bus, and its first packet has
// the device's identity as a comment. Transfers that Close ended are recorded as cancelled, with a
// comment.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "display/sync/clock.h"
#include "display/usb/packet_recorder.h"
#include "display/usb/usb_transport.h"

namespace voxeld::display {

class RecordingTransport final : public UsbTransport {
 public:
  struct Options {
    // Added to the clock's time. If it is the time of day minus the clock's time at some moment,
    // times in the file are times of day.
    int64_t wall_offset_ns = 0;
    uint16_t bus = 1;  // as written to the file
  };

  RecordingTransport(std::unique_ptr<UsbTransport> inner, std::unique_ptr<PacketRecorder> recorder,
                     sync::Clock& clock, Options options);
  // Starts the recording when a device is opened for the first time; an error of `make` is then
  // returned by Open.
  using MakeRecorder = std::function<absl::StatusOr<std::unique_ptr<PacketRecorder>>()>;
  RecordingTransport(std::unique_ptr<UsbTransport> inner, MakeRecorder make, sync::Clock& clock,
                     Options options);
  // Finishes the recording, which waits for the disk.
  ~RecordingTransport() override;

  // Returns the recorder, once recording has started, for its status and counts. It is thread-safe.
  const PacketRecorder& recorder() const { return *recorder_; }

  absl::Status Open() override;
  void Close() override;
  bool is_open() const override { return inner_->is_open(); }
  UsbIdentity identity() const override { return inner_->identity(); }
  absl::StatusOr<TransferId> Submit(Transfer&& transfer) override;
  void Cancel(TransferId id) override { inner_->Cancel(id); }
  absl::StatusOr<TransferId> ClearHalt(uint8_t endpoint) override;
  absl::StatusOr<TransferId> Reset() override;
  TransferBytes TakeBuffer(size_t capacity) override { return inner_->TakeBuffer(capacity); }
  size_t Drain(std::vector<TransferCompletion>& out) override;
  size_t bytes_in_flight() const override { return inner_->bytes_in_flight(); }
  size_t max_bytes_in_flight() const override { return inner_->max_bytes_in_flight(); }
  void SetWake(std::function<void()> wake) override { inner_->SetWake(std::move(wake)); }
  bool TakeArrival() override { return inner_->TakeArrival(); }

 private:
  // The common fields of a transfer's packets, kept while it is in flight.
  struct Recorded {
    uint64_t id = 0;  // in the file
    uint8_t xfer_type = 0;
    uint8_t epnum = 0;
  };

  UsbPacket PacketOf(const Recorded& recorded, UsbmonHeader::Type type) const;
  Recorded RecordSubmission(const Transfer& transfer, std::string comment);
  // Notes that the inner transport accepted it, or records that it refused.
  absl::StatusOr<TransferId> Answered(const Recorded& recorded, absl::StatusOr<TransferId> id);
  void RecordCompletion(const TransferCompletion& completion);

  const std::unique_ptr<UsbTransport> inner_;
  MakeRecorder make_recorder_;  // empty once the recorder exists
  std::unique_ptr<PacketRecorder> recorder_;
  sync::Clock& clock_;
  const Options options_;

  uint8_t address_ = 0;
  std::string opened_;  // comment for the next packet
  uint64_t next_id_ = 1;
  std::map<TransferId, Recorded> in_flight_;
};

struct RecordingFileOptions {
  std::string application = "voxeld";
  std::string name;                // of the display, used as Wireshark's interface
  PacketRecorder::Options limits;  // `info` is made from the two above
  RecordingTransport::Options transport;
};

// Wraps `inner` so that it is recorded into the file `path`, which is overwritten when a device is
// opened for the first time. Errors, then and now (a folder that is missing or not writable), name
// the path.
absl::StatusOr<std::unique_ptr<RecordingTransport>> RecordToFile(
    const std::string& path, std::unique_ptr<UsbTransport> inner, sync::Clock& clock,
    RecordingFileOptions options = {});

}  // namespace voxeld::display
