// One board on its cable. Configure, SetLut, Blacken, Load and Show say what it should hold; Pump
// sends what is missing, one transfer at a time. A failed transfer is sent again, a frame always in
// full.
//
// Bound to its owner's thread; only Close blocks, as the transport's does.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "display/drivers/fadecandy/protocol.h"
#include "display/sync/clock.h"
#include "display/usb/usb_transport.h"

namespace voxeld::display::fadecandy {

class Board {
 public:
  // Called with all bytes just before they are handed to the transport; `video`: they are from Load
  // or Show.
  using OnBytes =
      std::function<void(const Board& board, std::span<const std::byte> bytes, bool video)>;

  // `serial`: the number that `transport` looks for; empty: any.
  Board(std::unique_ptr<UsbTransport> transport, std::string serial, sync::Clock& clock,
        OnBytes on_bytes);

  UsbTransport& transport() { return *transport_; }
  // Returns the requested serial number, or the one that the opened board reports.
  std::string Serial() const { return serial_.empty() ? transport_->identity().serial : serial_; }
  bool any_serial() const { return serial_.empty(); }
  // The board's index in the display, from 0.
  size_t slice() const { return slice_; }
  void set_slice(size_t slice) { slice_ = slice; }
  // Returns "board 2 (serial ENICCULV)"; safe to print.
  std::string Name() const;

  // Opens the board, whose state is then undefined. The port of a board that went silent is reset
  // first.
  absl::Status Open();
  void Close();

  void Configure(uint8_t flags);
  void SetLut(std::shared_ptr<const Lut> lut);
  // Sends a black frame twice, so that no former frame remains in fades.
  void Blacken();
  // Sends a frame except its last packet; `rgb` must stay valid until the board shows it or is
  // closed. `twice`: sends the whole frame before it, so that the fade to it does not last as long
  // as the pause before it.
  void Load(std::span<const std::byte> rgb, bool twice);
  // Sends the last packet of a loaded frame.
  void Show();

  // Whether it holds what Configure, SetLut and Blacken requested.
  bool set_up() const { return !due_.any() && !in_flight_.any(); }
  bool loaded() const { return video_ == Video::kLoaded; }
  bool shown() const { return video_ == Video::kShown; }
  // Returns when Show last succeeded since Open; 0: never.
  sync::TimeNs shown_ns() const { return shown_ns_; }
  // Returns how often a frame had to be sent again since the last call.
  uint64_t TakeReloads() { return std::exchange(reloads_, 0); }
  // Returns the failed transfers since then, except those that ended because the board was
  // unplugged.
  uint64_t TakeFailures() { return std::exchange(failed_transfers_, 0); }

  // Drains completions.
  void Poll();
  // Sends what is due; returns the latest time for the next call.
  sync::TimeNs Pump();
  // Sends a table of darkness after whatever is in flight, ignoring the result.
  void Darken();

  // Empty, or why the board must be closed.
  const std::string& failure() const { return failure_; }

 private:
  enum class Video : uint8_t { kNone, kLoad, kLoaded, kShow, kShown };
  enum class Request : uint8_t { kNone, kReset, kClearHalt, kCounter };
  struct SetUp {
    bool config = false, lut = false, black = false;
    bool any() const { return config || lut || black; }
  };

  void Compose();
  void SubmitBulk();
  void SubmitRequest(sync::TimeNs now);
  void OnBulkDone(TransferCompletion& completion);
  void OnRequestDone(const TransferCompletion& completion);
  void Delivered();
  // The transfer in flight has to be sent again.
  void Again(TransferStatus status);
  void CountFailure(TransferStatus status);
  // Handles Submit's error.
  void Refused(const absl::Status& status);
  void Fail(std::string reason);

  const std::unique_ptr<UsbTransport> transport_;
  const std::string serial_;
  size_t slice_ = 0;
  sync::Clock& clock_;
  const OnBytes on_bytes_;
  std::string failure_;

  SetUp due_;
  uint8_t flags_ = 0;
  std::shared_ptr<const Lut> lut_;
  Video video_ = Video::kNone;
  std::span<const std::byte> rgb_;
  bool twice_ = false;
  sync::TimeNs shown_ns_ = 0;
  uint64_t reloads_ = 0, failed_transfers_ = 0;

  // The transfer that is in flight, or waits for room.
  TransferId bulk_ = 0;
  TransferBytes buffer_;
  SetUp in_flight_;
  bool video_in_flight_ = false;
  bool set_up_last_ = false;

  Request request_ = Request::kNone;
  TransferId request_id_ = 0;
  bool reset_due_ = false, halted_ = false;
  sync::TimeNs ask_at_ = 0;
  int failures_ = 0;  // consecutive
  std::vector<TransferCompletion> drained_;
};

}  // namespace voxeld::display::fadecandy
