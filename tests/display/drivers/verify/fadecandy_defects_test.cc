// Tests the Fadecandy suite: boards that have one defect each, and the cases that must find it.
#include <string>

#include "display/drivers/fadecandy/verify/suite.h"
#include "display/emulator/fadecandy_device.h"
#include "gtest/gtest.h"
#include "tests/display/drivers/verify/planted.h"
#include "tests/display/drivers/verify/pump_waiter.h"

namespace voxeld::display::conformance {
namespace {

std::vector<Planted> FadecandyDefects() {
  return {
      {"AnotherProduct",
       {"usb.device"},
       Descriptor(1, [](TransferStatus&, Bytes& data) { Store(data, 10, uint16_t{1}); }),
       {}},
      {"SmallerPackets",
       {"usb.configuration"},
       Descriptor(2, [](TransferStatus&, Bytes& data) { Store(data, 22, uint16_t{32}); }),
       {}},
      {"NoSerialNumber",
       {"usb.strings"},
       {.answer =
            [](const UsbSetup& setup, TransferStatus& status, Bytes& data) {
              if (setup.value != 0x0303 || setup.request != 6) return;
              status = TransferStatus::kStall;
              data.clear();
            }},
       {}},
      {"UnknownRequestsAnswered",
       {"requests.unknown"},
       Accepting([](const UsbSetup& s) { return s.request == 0xFF; }),
       {}},
      {"RefreshesNotCounted",
       {"requests.counters", "flow.refresh"},
       {.answer =
            [](const UsbSetup& setup, TransferStatus&, Bytes& data) {
              if (setup.request_type == 0xC0 && setup.request == 1 && setup.index == 0)
                Store(data, 0, uint32_t{7});
            }},
       {}},
      {"FramesCountedTwice",
       {"video.frame", "flow.refresh"},
       {.answer =
            [](const UsbSetup& setup, TransferStatus&, Bytes& data) {
              if (setup.request_type == 0xC0 && setup.request == 1 && setup.index == 1) {
                Store(data, 0, At<uint32_t>(data, 0) * 2);
              }
            }},
       {}},
      {"FinalOnEveryPacket",
       {"video.final"},
       {.bulk =
            [](Bytes& bytes) {
              for (size_t at = 0; at + 64 <= bytes.size(); at += 64) {
                if (bytes[at] < std::byte{0x19}) bytes[at] |= std::byte{0x20};
              }
            }},
       {}},
      {"NothingIsVideo",
       {"packets.ignored"},
       {.bulk =
            [](Bytes& bytes) {
              for (size_t at = 0; at + 64 <= bytes.size(); at += 64) bytes[at] &= std::byte{0x3F};
            }},
       {}},
      {"ShortPacketsStall",
       {"packets.short"},
       {.bulk_end =
            [](size_t size, TransferStatus& status) {
              if (size % 64 != 0) status = TransferStatus::kStall;
            }},
       {}},
      {"HaltIsNotCleared",
       {"usb.halt"},
       {.swallow =
            [](const UsbSetup& setup) { return setup.request_type == 0x02 && setup.request == 1; }},
       {}},
      {"NoMicrosoftId",
       {"requests.microsoft"},
       {.answer =
            [](const UsbSetup& setup, TransferStatus& status, Bytes& data) {
              if (setup.request != 0x7E) return;
              status = TransferStatus::kStall;
              data.clear();
            }},
       {}},
      {"TablesWait",
       {"flow.tables"},
       // Treats each table like a frame that waits for a refresh.
       {.bulk =
            [](Bytes& bytes) {
              for (size_t at = 0; at + 64 <= bytes.size(); at += 64) {
                if (bytes[at] == std::byte{0x78}) bytes[at] = std::byte{0x38};
              }
            }},
       {}},
  };
}

class FadecandyDefect : public testing::TestWithParam<Planted> {};

TEST_P(FadecandyDefect, IsFound) {
  sync::FakeClock clock;
  Rig rig(std::make_unique<DefectiveDevice>(
              std::make_unique<emulator::FadecandyDevice>(emulator::FadecandyDeviceConfig{}, clock),
              GetParam().defect),
          clock, fadecandy::MakeSuite());
  const absl::StatusOr<RunResult> run = rig.Run();
  ASSERT_TRUE(run.ok()) << run.status();
  const std::set<std::string> failed = FailedIds(*run);
  for (const std::string& id : GetParam().found_by) {
    EXPECT_TRUE(failed.contains(id)) << id << " does not find it; those that do:" << Failures(*run);
  }
}

INSTANTIATE_TEST_SUITE_P(Verify, FadecandyDefect, testing::ValuesIn(FadecandyDefects()),
                         [](const auto& info) { return info.param.name; });

}  // namespace
}  // namespace voxeld::display::conformance
