// One board on its cable. What it is to hold is said by Configure, SetLut, Blacken, Load and Show;
// Pump sends what is missing, one transfer at a time. A transfer that failed goes out again, a
// frame always whole.
//
// Bound to its owner's thread; nothing blocks but Close, as the transport's.
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
  // Every byte that is handed to the transport, just before it is; `video`: of Load and Show.
  using OnBytes =
      std::function<void(const Board& board, std::span<const std::byte> bytes, bool video)>;

  // `serial`: the number that `transport` looks for; empty: any.
  Board(std::unique_ptr<UsbTransport> transport, std::string serial, sync::Clock& clock,
        OnBytes on_bytes);

  UsbTransport& transport() { return *transport_; }
  // As asked for, or as the board that was opened says it.
  std::string Serial() const { return serial_.empty() ? transport_->identity().serial : serial_; }
  bool any_serial() const { return serial_.empty(); }
  // Its place among the display's boards, from 0.
  size_t slice() const { return slice_; }
  void set_slice(size_t slice) { slice_ = slice; }
  // "board 2 (serial ENICCULV)"; safe to print.
  std::string Name() const;

  // Nothing is said yet that it is to hold. A board that went silent has its port reset first.
  absl::Status Open();
  void Close();

  void Configure(uint8_t flags);
  void SetLut(std::shared_ptr<const Lut> lut);
  // A black frame, twice, so that nothing of the frames before is left in fades.
  void Blacken();
  // A frame but for its last packet; `rgb` stays until the board shows it or is closed. `twice`: the
  // whole frame goes before it, so that the fade to it does not last as long as the pause before it.
  void Load(std::span<const std::byte> rgb, bool twice);
  // The last packet of a loaded frame.
  void Show();

  // It holds what Configure, SetLut and Blacken said.
  bool set_up() const { return !due_.any() && !in_flight_.any(); }
  bool loaded() const { return video_ == Video::kLoaded; }
  bool shown() const { return video_ == Video::kShown; }
  // When Show last succeeded since Open; 0: never.
  sync::TimeNs shown_ns() const { return shown_ns_; }
  // How often a frame had to be sent again since the last call.
  uint64_t TakeReloads() { return std::exchange(reloads_, 0); }
  // Transfers that failed since then, but for those that a board that went took with it.
  uint64_t TakeFailures() { return std::exchange(failed_transfers_, 0); }

  // Drains completions.
  void Poll();
  // Sends what there is to send; when it wants to be called again at the latest.
  sync::TimeNs Pump();
  // Sends a table of darkness behind whatever is in flight, whatever becomes of it.
  void Darken();

  // Empty, or why the board is to be closed.
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
  // What was in flight has to be sent again.
  void Again(TransferStatus status);
  void CountFailure(TransferStatus status);
  // Submit's error.
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

  // The transfer that is in flight, or held back for want of room.
  TransferId bulk_ = 0;
  TransferBytes buffer_;
  SetUp in_flight_;
  bool video_in_flight_ = false;
  bool set_up_last_ = false;

  Request request_ = Request::kNone;
  TransferId request_id_ = 0;
  bool reset_due_ = false, halted_ = false;
  sync::TimeNs ask_at_ = 0;
  int failures_ = 0;  // in a row
  std::vector<TransferCompletion> drained_;
};

}  // namespace voxeld::display::fadecandy
