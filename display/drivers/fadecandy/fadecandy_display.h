// The driver of displays made of 1 to 64 Fadecandy boards, each over a USB transport of its own.
// README.md describes its behaviour; the protocol is in docs/protocols/fadecandy.md.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "display/api/display.h"
#include "display/drivers/fadecandy/board.h"
#include "display/drivers/fadecandy/lut.h"
#include "display/sync/backoff.h"
#include "display/usb/usb_transport.h"

namespace voxeld::display::fadecandy {

class FadecandyDisplay final : public Display {
 public:
  struct Settings {
    ColorCurve curve;
    double full_brightness = 1;        // share of the light at brightness 1; in (0, 1]
    uint8_t flags = kNoInterpolation;  // ConfigFlag
  };
  struct Wire {
    std::unique_ptr<UsbTransport> transport;
    std::string serial;  // requested; empty: any
  };

  // Slice n of `info.layout` is board n: kPixels pixels of RGB888 in one image, with a wire each.
  FadecandyDisplay(DisplayInfo info, Settings settings, std::vector<Wire> wires,
                   sync::Clock& clock);
  ~FadecandyDisplay() override;

 private:
  enum class Phase : uint8_t { kDetached, kSettingUp, kReady };

  // The volume being sent.
  struct Sending {
    SliceFramePtr frame;         // null: none
    std::vector<size_t> boards;  // boards that get a new frame
    uint64_t bytes = 0;
    sync::TimeNs last_byte_ns = 0;
  };

  absl::Status DoStart() override;
  void DoStop() override;
  void DoSend(const SliceFramePtr& frame, bool full) override;
  sync::TimeNs DoTick(sync::TimeNs now) override;
  absl::Status DoSetBrightness(double brightness) override;
  absl::Status DoSetBlank(bool blank) override;
  std::unique_ptr<WireDecoder> DoMakeDecoder() const override;

  void OnBytes(const Board& board, std::span<const std::byte> bytes, bool video);
  void TryAttach(sync::TimeNs now);
  // Orders boards without a requested serial number by ascending serial number, in whatever order
  // the bus returned them.
  void Sort();
  void Detach(sync::TimeNs now, const std::string& reason);
  // A failed board detaches the whole display.
  void CheckBoards(sync::TimeNs now);
  void Advance();
  void Done();
  sync::TimeNs Pump();
  // Sends the table of `brightness`, or of darkness, to all boards.
  void SetLuts(double brightness);

  const Settings settings_;
  std::vector<std::unique_ptr<Board>> boards_;  // one per slice
  Phase phase_ = Phase::kDetached;
  sync::TimeNs attach_at_ = 0;
  sync::TimeNs failed_at_ = 0;
  sync::Backoff retry_{100 * sync::kMillisecond, 5 * sync::kSecond};

  Sending sending_;
  uint64_t complete_frame_ = 0;  // the volume that all boards hold; 0: none
  bool had_frame_ = false;       // a volume was started since Start
  // All boards hold parts of one image: a volume of this session, or black.
  bool whole_ = false;
  bool dark_ = false;          // the boards' table is that of darkness
  double lut_brightness_ = 1;  // the brightness of their table
};

}  // namespace voxeld::display::fadecandy
