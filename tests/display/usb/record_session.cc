// record_session FILE: records a voxlink session in which everything occurs into FILE, for the test
// of the dissector: an attach of the driver and three volumes, then packets by hand that are split
// by transfers, damaged, held, shown, dropped and given up.

#include <cstdio>
#include <string>
#include <utility>
#include <vector>

#include "display/drivers/voxlink/packet.h"
#include "display/drivers/voxlink/protocol.h"
#include "display/usb/recording_transport.h"
#include "tests/display/usb/transport_rig.h"

namespace voxeld::display {
namespace {

using sync::kMillisecond;
using sync::kSecond;
using voxlink::PacketType;

constexpr int64_t kWallOffset = 1'750'000'000 * kSecond;

void Say(const char* what) { std::fprintf(stderr, "record_session: %s\n", what); }

// The host's end, driven by hand: every answer is awaited, and every event read.
class Hand {
 public:
  Hand(UsbTransport& usb, InProcessTransport& cable, sync::FakeClock& clock)
      : usb_(usb), cable_(cable), clock_(clock) {}

  bool failed() const { return failed_; }
  void Request(UsbSetup setup, std::vector<std::byte> data = {}) {
    Transfer transfer;
    transfer.type = TransferType::kControl;
    transfer.setup = setup;
    transfer.data.Append(data);
    if ((setup.request_type & 0x80) != 0) transfer.length = setup.length;
    Give(std::move(transfer));
  }
  void Listen() {
    Transfer transfer;
    transfer.type = TransferType::kInterrupt;
    transfer.endpoint = voxlink::kInterruptIn;
    transfer.length = voxlink::kEventSize;
    Give(std::move(transfer));
  }
  void Send(std::span<const std::byte> bytes) {
    Transfer transfer;
    transfer.endpoint = voxlink::kBulkOut;
    transfer.data.Append(bytes);
    Give(std::move(transfer));
  }
  void RunFor(sync::TimeNs duration) {
    const sync::TimeNs end = clock_.Now() + duration;
    while (clock_.Now() < end) {
      clock_.Advance(5 * kMillisecond);
      Settle();
    }
  }

 private:
  void Give(Transfer transfer) {
    failed_ |= !usb_.Submit(std::move(transfer)).ok();
    clock_.Advance(100'000);
    Settle();
  }
  void Settle() {
    cable_.Pump();
    std::vector<TransferCompletion> out;
    usb_.Drain(out);
    for (const TransferCompletion& completion : out) {
      if (completion.type == TransferType::kInterrupt) Listen();
    }
  }

  UsbTransport& usb_;
  InProcessTransport& cable_;
  sync::FakeClock& clock_;
  bool failed_ = false;
};

void ByHand(Hand& hand) {
  using voxlink::Request;
  const auto out = [](Request request, uint16_t value = 0, uint16_t length = 0) {
    return UsbSetup{.request_type = voxlink::kRequestOut,
                    .request = static_cast<uint8_t>(request),
                    .value = value,
                    .length = length};
  };
  const auto in = [](Request request, uint16_t length) {
    return UsbSetup{.request_type = voxlink::kRequestIn,
                    .request = static_cast<uint8_t>(request),
                    .length = length};
  };
  hand.Request({.request_type = 0x80, .request = 6, .value = 0x0200, .length = 1024});
  hand.Request(out(Request::kSetPowerLimit, 0, 4), voxlink::BytesOf(uint32_t{45'000}));
  hand.Request(out(Request::kSetBrightness, 32'768));
  hand.Request(out(Request::kSetBlank, 0));
  hand.Request(in(Request::kGetMode, sizeof(voxlink::Mode)));
  hand.Request(out(Request::kStart));
  for (int i = 0; i < 4; ++i) hand.Listen();

  // Volumes of 6 pictures of 192 bytes. The second packet is damaged, so its picture will be
  // missing.
  constexpr uint32_t kPictures = 6;
  const std::vector<std::byte> picture(192, std::byte{0x55});
  voxlink::PacketWriter writer;
  TransferBytes bytes;
  const auto volume = [&](uint64_t number, bool show) {
    writer.Begin(bytes, number, 0, kPictures, {});
    for (uint32_t slice = 0; slice < kPictures; ++slice) {
      writer.Slice(bytes, number, slice, 0, 0, picture);
    }
    writer.End(bytes, number, show);
  };
  volume(1, false);
  bytes[56 + 40] ^= std::byte{1};
  hand.Send(bytes);
  bytes.clear();
  writer.Slice(bytes, 1, 0, 0, 0, picture);
  writer.End(bytes, 1, false);
  // Transfers that end in a header and in a payload.
  const std::span<const std::byte> all(bytes);
  hand.Send(all.first(20));
  hand.Send(all.subspan(20, 100));
  hand.Send(all.subspan(120));
  bytes.clear();
  writer.Show(bytes, 1, 77);
  hand.Send(bytes);
  bytes.clear();
  writer.Plain(bytes, PacketType::kDrop, 1);
  writer.Begin(bytes, 2, 0, kPictures, {});
  writer.Plain(bytes, PacketType::kAbort, 2);
  writer.Begin(bytes, 3, 99, kPictures, std::vector{std::byte{0x12}});
  bytes.push_back(std::byte{0xEE});  // noise
  writer.Plain(bytes, PacketType::kKeepalive, 0);
  hand.Send(bytes);
  hand.Request(in(Request::kGetStatus, sizeof(voxlink::Status)));
  hand.RunFor(1200 * kMillisecond);  // no messages: it goes dark
  hand.Request(out(Request::kStop));
}

int Main(const std::string& path) {
  sync::FakeClock clock;
  EmulatedCable cable(clock);
  RecordingFileOptions options;
  options.name = "record_session";
  options.transport.wall_offset_ns = kWallOffset;
  auto recording = RecordToFile(path, std::move(cable.transport), clock, options);
  if (!recording.ok()) {
    Say(std::string(recording.status().message()).c_str());
    return 1;
  }
  RecordingTransport& usb = **recording;
  TransportRig rig(*std::move(recording), clock, {[&] { return cable.pump->Pump(); }});
  rig.Start();
  FrameSource source(rig.display().info().layout, 1);
  for (int i = 0; i < 3; ++i) {
    const SliceFramePtr frame = source.Next(i == 0 ? 1 : 0.3);
    rig.display().Submit(frame);
    if (!rig.RunUntil([&] { return rig.recorder().Of(frame->volume) != nullptr; })) {
      Say("a volume has no outcome");
      return 1;
    }
  }
  rig.RunFor(200 * kMillisecond);
  rig.display().Stop();

  if (!usb.Open().ok()) {
    Say("the device cannot be opened again");
    return 1;
  }
  Hand hand(usb, *cable.pump, clock);
  ByHand(hand);
  usb.Close();
  if (hand.failed() || !usb.recorder().status().ok()) {
    Say("the session was not recorded");
    return 1;
  }
  return 0;
}

}  // namespace
}  // namespace voxeld::display

int main(int argc, char** argv) {
  if (argc != 2) {
    std::fprintf(stderr, "usage: record_session FILE\n");
    return 2;
  }
  return voxeld::display::Main(argv[1]);
}
