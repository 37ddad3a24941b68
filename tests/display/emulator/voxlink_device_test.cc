// Tests the device model, packet by packet.

#include "display/emulator/voxlink_device.h"

#include <vector>

#include "gtest/gtest.h"
#include "tests/display/emulator/voxlink_fixture.h"

namespace voxeld::display::emulator {
namespace {

using sync::kMillisecond;
using sync::kSecond;
using voxlink::ErrorCode;
using voxlink::EventType;
using voxlink::Reason;
using voxlink::Request;

TEST_F(Device, ShowsAWholeVolumeAtTheNextSweep) {
  bench_.Pass(30 * kMillisecond);
  bench_.SendWhole(1, 7);
  EXPECT_EQ(Types(bench_.Events()), std::vector<EventType>{EventType::kComplete});
  EXPECT_EQ(bench_.Seen(0), -1);
  bench_.Pass(70 * kMillisecond - 1);
  EXPECT_EQ(bench_.Seen(0), -1);
  bench_.Pass(1);  // sweep 1 begins 100 ms after START
  EXPECT_EQ(bench_.Seen(0), 7);
  const auto events = bench_.Events(true);
  ASSERT_EQ(Types(events), (std::vector<EventType>{EventType::kShown, EventType::kSweep}));
  EXPECT_EQ(events[0].As<voxlink::ShownEvent>().volume, 1u);
  EXPECT_EQ(events[0].As<voxlink::ShownEvent>().sweep, 1u);
  EXPECT_EQ(events[0].As<voxlink::ShownEvent>().start_ns, 100u * kMillisecond);
  EXPECT_EQ(events[1].As<voxlink::SweepEvent>().period_ns, 100u * kMillisecond);
  EXPECT_EQ(events[1].As<voxlink::SweepEvent>().shown, 1u);
}

TEST_F(Device, TheWatchdogDarkensAt250AndNotAt249) {
  bench_.SendWhole(1, 7);
  const sync::TimeNs heard = bench_.clock().Now();
  bench_.Pass(249 * kMillisecond);
  EXPECT_EQ(bench_.Seen(0), 7);
  bench_.Events();
  bench_.Pass(kMillisecond);
  EXPECT_EQ(bench_.clock().Now(), heard + 250 * kMillisecond);
  EXPECT_EQ(bench_.Seen(0), -1);
  auto events = bench_.Events();
  ASSERT_EQ(Types(events), std::vector<EventType>{EventType::kLight});
  EXPECT_EQ(events[0].As<voxlink::LightEvent>().lit, 0u);
  EXPECT_EQ(events[0].As<voxlink::LightEvent>().reason, 1u);
  Keep();
  EXPECT_EQ(bench_.Seen(0), 7);
  events = bench_.Events();
  ASSERT_EQ(Types(events), std::vector<EventType>{EventType::kLight});
  EXPECT_EQ(events[0].As<voxlink::LightEvent>().lit, 1u);
}

TEST_F(Device, NoiseDoesNotFeedTheWatchdog) {
  bench_.SendWhole(1, 7);
  bench_.Pass(200 * kMillisecond);
  bench_.Bulk(std::vector<std::byte>(100));
  bench_.Pass(50 * kMillisecond);
  EXPECT_EQ(bench_.Seen(0), -1);
}

TEST(DeviceWithoutWatchdog, SaysSoAndStaysLit) {
  VoxlinkDeviceConfig config = Bench::SmallConfig();
  config.watchdog = false;
  Bench bench(config);
  const auto reply = bench.In(Request::kGetCapabilities, 0, 4096);
  const auto fixed = voxlink::Load<voxlink::Capabilities>(reply->in);
  EXPECT_EQ(fixed.features & voxlink::kFeatureWatchdog, 0u);
  EXPECT_EQ(fixed.watchdog_ms, 0);
  bench.StartSession();
  bench.SendWhole(1, 7);
  bench.Pass(10 * kSecond);
  EXPECT_EQ(bench.Seen(3), 7);
}

TEST_F(Device, ADeltaTakesTheRestFromItsBase) {
  bench_.SendWhole(1, 7);
  bench_.Bulk(bench_.Begin(2, 1, 0b0100));
  bench_.Bulk(bench_.Slice(2, 2, 9));
  bench_.Bulk(bench_.End(2));
  PassAlive(100 * kMillisecond);
  EXPECT_EQ(bench_.Seen(0), 7);
  EXPECT_EQ(bench_.Seen(1), 7);
  EXPECT_EQ(bench_.Seen(2), 9);
  EXPECT_EQ(bench_.Seen(3), 7);
  bench_.Bulk(bench_.Begin(3, 2, 0));  // nothing changed
  bench_.Bulk(bench_.End(3));
  PassAlive(100 * kMillisecond);
  EXPECT_EQ(bench_.device().Seen()->volume, 3u);
  EXPECT_EQ(bench_.Seen(2), 9);
}

TEST_F(Device, TheBaseIsTheLastCompleteVolumeAndNoOther) {
  bench_.SendWhole(1, 7);
  bench_.SendWhole(2, 8);
  bench_.Events();
  bench_.Bulk(bench_.Begin(3, 1, 0b0001));
  auto events = bench_.Events();
  ASSERT_EQ(events.size(), 1u);
  ExpectVolumeEvent(events[0], EventType::kAborted, 3, Reason::kBadBase);
  bench_.Bulk(bench_.Slice(3, 0, 9));  // ignored
  EXPECT_TRUE(bench_.Events().empty());
  bench_.Bulk(bench_.End(3));
  events = bench_.Events();
  ASSERT_EQ(events.size(), 1u);
  ExpectVolumeEvent(events[0], EventType::kAborted, 3, Reason::kBadBase);
  PassAlive(100 * kMillisecond);
  EXPECT_EQ(bench_.Seen(0), 8);
}

TEST_F(Device, ListsWhatIsMissingAndTakesItAgain) {
  bench_.Bulk(bench_.Begin(1, 0));
  bench_.Slice(1, 0, 7);  // lost in transit
  bench_.Bulk(bench_.Slice(1, 1, 7));
  std::vector<std::byte> bad = bench_.Slice(1, 2, 7);
  bad.back() ^= std::byte{1};
  bench_.Bulk(bad);
  bench_.Slice(1, 3, 7);
  bench_.Bulk(bench_.End(1));
  auto events = bench_.Events();
  ASSERT_EQ(Types(events), (std::vector<EventType>{EventType::kError, EventType::kError,
                                                   EventType::kError, EventType::kMissing}));
  EXPECT_EQ(CodeOf(events[0]), ErrorCode::kSequence);
  EXPECT_EQ(CodeOf(events[1]), ErrorCode::kBadPayload);
  EXPECT_EQ(events[1].As<voxlink::ErrorEvent>().picture, 2u);
  EXPECT_EQ(CodeOf(events[2]), ErrorCode::kSequence);
  EXPECT_EQ(events[3].header.flags, voxlink::kMissingLast);
  auto missing = events[3].As<voxlink::MissingEvent>();
  EXPECT_EQ(missing.volume, 1u);
  ASSERT_EQ(missing.runs, 2u);
  EXPECT_EQ(missing.run[0], (voxlink::PictureRun{0, 1}));
  EXPECT_EQ(missing.run[1], (voxlink::PictureRun{2, 2}));
  PassAlive(200 * kMillisecond);
  EXPECT_EQ(bench_.Seen(0), -1);  // an incomplete volume is never shown
  bench_.Events();
  for (const uint32_t slice : {0u, 2u, 3u}) bench_.Bulk(bench_.Slice(1, slice, 7));
  bench_.Bulk(bench_.End(1));
  EXPECT_EQ(Types(bench_.Events()), std::vector<EventType>{EventType::kComplete});
  PassAlive(100 * kMillisecond);
  EXPECT_EQ(bench_.Seen(2), 7);
}

TEST_F(Device, AnAbortedVolumeIsNeverShown) {
  bench_.SendWhole(1, 7);
  PassAlive(100 * kMillisecond);
  bench_.Events();
  bench_.Bulk(bench_.Begin(2, 1, 0b1111));
  bench_.Bulk(bench_.Slice(2, 0, 9));
  std::vector<std::byte> abort;
  bench_.writer().Plain(abort, voxlink::PacketType::kAbort, 2);
  bench_.Bulk(abort);
  const auto events = bench_.Events();
  ASSERT_EQ(events.size(), 1u);
  ExpectVolumeEvent(events[0], EventType::kAborted, 2, Reason::kByHost);
  bench_.Bulk(bench_.Begin(3, 1, 0b0010));  // the base is still volume 1
  bench_.Bulk(bench_.Slice(3, 1, 8));
  bench_.Bulk(bench_.End(3));
  PassAlive(100 * kMillisecond);
  EXPECT_EQ(bench_.Seen(0), 7);
  EXPECT_EQ(bench_.Seen(1), 8);
}

TEST_F(Device, ABeginAbortsTheVolumeBeingFilled) {
  bench_.Bulk(bench_.Begin(1, 0));
  bench_.SendWhole(2, 8);
  const auto events = bench_.Events();
  ASSERT_EQ(events.size(), 2u);
  ExpectVolumeEvent(events[0], EventType::kAborted, 1, Reason::kSuperseded);
  EXPECT_EQ(events[1].type(), EventType::kComplete);
}

TEST_F(Device, ALaterCompleteVolumeTakesTheWaitingOnesPlace) {
  bench_.SendWhole(1, 7);
  bench_.SendWhole(2, 8);
  const auto events = bench_.Events();
  ASSERT_EQ(events.size(), 3u);
  ExpectVolumeEvent(events[1], EventType::kDropped, 1, Reason::kSuperseded);
  PassAlive(100 * kMillisecond);
  EXPECT_EQ(bench_.Seen(0), 8);
}

TEST_F(Device, HoldsShowsAndDrops) {
  bench_.SendWhole(1, 7, false);
  PassAlive(200 * kMillisecond);
  EXPECT_EQ(bench_.Seen(0), -1);
  std::vector<std::byte> show;
  bench_.writer().Show(show, 1, 4);
  bench_.Bulk(show);
  PassAlive(150 * kMillisecond);
  EXPECT_EQ(bench_.Seen(0), -1);
  PassAlive(50 * kMillisecond);  // sweep 4
  EXPECT_EQ(bench_.Seen(0), 7);
  bench_.Events();

  bench_.SendWhole(2, 8, false);
  std::vector<std::byte> drop;
  bench_.writer().Plain(drop, voxlink::PacketType::kDrop, 2);
  bench_.writer().Plain(drop, voxlink::PacketType::kDrop, 2);
  bench_.writer().Show(drop, 2, 0);
  bench_.Bulk(drop);
  bench_.Bulk(bench_.Begin(3, 2, 1));
  const auto events = bench_.Events();
  ASSERT_EQ(events.size(), 5u);
  ExpectVolumeEvent(events[1], EventType::kDropped, 2, Reason::kByHost);
  ExpectVolumeEvent(events[2], EventType::kDropped, 2, Reason::kUnknownVolume);
  ExpectVolumeEvent(events[3], EventType::kDropped, 2, Reason::kUnknownVolume);
  ExpectVolumeEvent(events[4], EventType::kAborted, 3, Reason::kBadBase);
  PassAlive(100 * kMillisecond);
  EXPECT_EQ(bench_.Seen(0), 7);
}

// §5.5: an order that must come in advance has no effect if it is late.
TEST_F(Device, AnOrderAheadIsTakenInTimeOnly) {
  const auto order = [&](uint64_t sweep, uint32_t ahead) {
    std::vector<std::byte> show;
    bench_.writer().ShowAhead(show, 1, sweep, ahead);
    bench_.Bulk(show);
    const auto events = bench_.Events();
    EXPECT_EQ(events.back().type(), EventType::kOrdered);
    EXPECT_EQ(events.back().As<voxlink::OrderedEvent>().volume, 1u);
    EXPECT_EQ(events.back().As<voxlink::OrderedEvent>().sweep, sweep);
    return (events.back().header.flags & voxlink::kOrderTaken) != 0;
  };
  bench_.SendWhole(1, 7, false);
  PassAlive(250 * kMillisecond);  // sweep 2 has begun
  EXPECT_FALSE(order(3, 2));
  EXPECT_FALSE(order(2, 0) && order(1, 0)) << "past ones, whatever they request";
  PassAlive(100 * kMillisecond);
  EXPECT_EQ(bench_.Seen(0), 7) << "0 ahead: the sweep that runs is not past";
}

TEST_F(Device, ALaterOrderTakesTheFirstOnesPlaceInTime) {
  const auto order = [&](uint64_t sweep) {
    std::vector<std::byte> show;
    bench_.writer().ShowAhead(show, 1, sweep, 2);
    bench_.Bulk(show);
    return (bench_.Events().back().header.flags & voxlink::kOrderTaken) != 0;
  };
  bench_.SendWhole(1, 7, false);
  EXPECT_TRUE(order(3));
  PassAlive(250 * kMillisecond);  // sweep 2 has begun
  EXPECT_TRUE(order(5));
  PassAlive(200 * kMillisecond);  // sweep 4
  EXPECT_FALSE(order(5)) << "too late, and it has no effect";
  EXPECT_EQ(bench_.Seen(0), -1);
  PassAlive(100 * kMillisecond);
  EXPECT_EQ(bench_.Seen(0), 7);
}

TEST_F(Device, EndAsksAgainAsOftenAsTheHostLikes) {
  bench_.SendWhole(1, 7);
  bench_.Bulk(bench_.End(1));
  bench_.Bulk(bench_.End(5));
  const auto events = bench_.Events();
  ASSERT_EQ(events.size(), 3u);
  EXPECT_EQ(events[1].type(), EventType::kComplete);
  ExpectVolumeEvent(events[2], EventType::kAborted, 5, Reason::kUnknownVolume);
}

TEST_F(Device, RefusesWhatDoesNotFit) {
  std::vector<std::byte> out;
  const std::vector<std::byte> pixels(18);
  bench_.writer().Begin(out, 1, 0, 5, {});         // pictures
  bench_.writer().Slice(out, 9, 0, 0, 0, pixels);  // it was never begun
  bench_.writer().Slice(out, 9, 1, 0, 0, pixels);  // reported once
  bench_.writer().Plain(out, static_cast<voxlink::PacketType>(42), 1);
  bench_.Bulk(out);
  auto events = bench_.Events();
  ASSERT_EQ(events.size(), 4u);
  EXPECT_EQ(CodeOf(events[0]), ErrorCode::kBadBegin);
  ExpectVolumeEvent(events[1], EventType::kAborted, 1, Reason::kMalformed);
  EXPECT_EQ(CodeOf(events[2]), ErrorCode::kNotFilling);
  EXPECT_EQ(CodeOf(events[3]), ErrorCode::kUnknownType);

  bench_.SendWhole(10, 7);
  bench_.Events();
  bench_.Bulk(bench_.Begin(10, 0));  // does not ascend
  events = bench_.Events();
  ASSERT_EQ(events.size(), 2u);
  EXPECT_EQ(CodeOf(events[0]), ErrorCode::kBadOrder);
  bench_.Bulk(bench_.Begin(11, 10, 0b0001));
  bench_.Bulk(bench_.Slice(11, 1, 3));
  events = bench_.Events();
  ASSERT_EQ(events.size(), 1u);
  EXPECT_EQ(CodeOf(events[0]), ErrorCode::kNotInBitmap);
}

TEST_F(Device, FindsItsFeetAfterNoise) {
  std::vector<std::byte> noise(33, std::byte{0x56});
  const auto begin = bench_.Begin(1, 0);
  noise.insert(noise.end(), begin.begin(), begin.end());
  bench_.Bulk(noise);
  for (uint32_t slice = 0; slice < 4; ++slice) bench_.Bulk(bench_.Slice(1, slice, 7));
  bench_.Bulk(bench_.End(1));
  const auto events = bench_.Events();
  ASSERT_EQ(events.size(), 2u);
  EXPECT_EQ(CodeOf(events[0]), ErrorCode::kBadHeader);
  EXPECT_EQ(events[0].As<voxlink::ErrorEvent>().detail, 33u);
  EXPECT_EQ(events[1].type(), EventType::kComplete);
}

TEST_F(Device, CountsUnderruns) {
  bench_.SendWhole(1, 7);
  PassAlive(100 * kMillisecond);
  EXPECT_EQ(bench_.device().screen().underruns(), 0u);
  bench_.Bulk(bench_.Begin(2, 0));
  PassAlive(200 * kMillisecond);
  EXPECT_EQ(bench_.device().screen().underruns(), 2u);
  for (uint32_t slice = 0; slice < 4; ++slice) bench_.Bulk(bench_.Slice(2, slice, 8));
  bench_.Bulk(bench_.End(2));
  PassAlive(200 * kMillisecond);
  EXPECT_EQ(bench_.device().screen().underruns(), 2u);
  EXPECT_EQ(bench_.Seen(0), 8);
}

TEST_F(Device, BlankIsDarkAtOnceAndKeepsTheVolume) {
  bench_.SendWhole(1, 7);
  PassAlive(100 * kMillisecond);
  EXPECT_EQ(bench_.Out(Request::kSetBlank, 1)->status, TransferStatus::kOk);
  EXPECT_EQ(bench_.Seen(0), -1);
  bench_.Events();
  bench_.SendWhole(2, 8);
  PassAlive(100 * kMillisecond);
  const auto events = bench_.Events();
  ASSERT_EQ(Types(events), (std::vector<EventType>{EventType::kComplete, EventType::kShown}));
  EXPECT_EQ(events[1].header.flags, voxlink::kShownDark);
  EXPECT_EQ(bench_.Out(Request::kSetBlank, 0)->status, TransferStatus::kOk);
  EXPECT_EQ(bench_.Seen(0), 8);
  EXPECT_EQ(bench_.Out(Request::kSetBlank, 2)->status, TransferStatus::kStall);
}

TEST_F(Device, BrightnessAndPowerLimit) {
  EXPECT_EQ(bench_.Out(Request::kSetBrightness, 32768)->status, TransferStatus::kOk);
  EXPECT_NEAR(bench_.device().brightness(), 0.5, 1e-4);
  const auto limit = voxlink::BytesOf(uint32_t{12'000});
  EXPECT_EQ(bench_.Out(Request::kSetPowerLimit, 0, limit)->status, TransferStatus::kOk);
  EXPECT_EQ(bench_.device().power_limit_mw(), 12'000u);
  EXPECT_EQ(bench_.Out(Request::kSetPowerLimit)->status, TransferStatus::kStall);
}

TEST_F(Device, ModesAreCheckedAndFixedInASession) {
  const auto mode = [](uint8_t format, uint8_t sub_frames, uint32_t rate, uint8_t bits = 0) {
    return voxlink::BytesOf(
        voxlink::Mode{.format = format, .sub_frames = sub_frames, .bits = bits, .rate_mhz = rate});
  };
  EXPECT_EQ(bench_.Out(Request::kSetMode, 0, mode(0, 1, 0))->status, TransferStatus::kStall);
  bench_.Out(Request::kStop);
  EXPECT_EQ(bench_.Out(Request::kSetMode, 0, mode(2, 3, 5000))->status, TransferStatus::kOk);
  const auto got = bench_.In(Request::kGetMode, 0, 16);
  EXPECT_EQ(voxlink::Load<voxlink::Mode>(got->in).sub_frames, 3);
  EXPECT_EQ(bench_.device().layout().format, PixelFormat::kBitPlanes);
  for (const auto& bad : {mode(5, 1, 0), mode(0, 65, 0), mode(0, 1, 10'001), mode(0, 1, 1),
                          mode(0, 1, 0, 9), mode(1, 1, 0, 2), mode(4, 1, 0, 2)}) {
    EXPECT_EQ(bench_.Out(Request::kSetMode, 0, bad)->status, TransferStatus::kStall);
  }
  EXPECT_EQ(bench_.Out(Request::kSetMode, 0, mode(2, 1, 0, 4))->status, TransferStatus::kOk);
  EXPECT_EQ(voxlink::Load<voxlink::Mode>(bench_.In(Request::kGetMode, 0, 16)->in).bits, 4);
  EXPECT_EQ(bench_.device().layout().bits_per_channel(), 4);
}

TEST_F(Device, StartForgetsTheSessionBefore) {
  bench_.SendWhole(5, 7);
  PassAlive(100 * kMillisecond);
  EXPECT_EQ(bench_.Seen(0), 7);
  bench_.Events();
  bench_.StartSession();
  EXPECT_EQ(bench_.Seen(0), -1);
  const auto events = bench_.Events();
  ASSERT_EQ(Types(events), std::vector<EventType>{EventType::kReady});
  EXPECT_EQ(events[0].header.sequence, 0u);
  EXPECT_EQ(events[0].header.credit_limit, 8192u);
  bench_.SendWhole(1, 8);
  PassAlive(100 * kMillisecond);
  EXPECT_EQ(bench_.Seen(0), 8);
}

TEST_F(Device, StatusTellsWhereItStands) {
  bench_.SendWhole(1, 7);
  PassAlive(100 * kMillisecond);
  bench_.Bulk(bench_.Begin(2, 1, 0b0001));
  const auto reply = bench_.In(Request::kGetStatus, 0, sizeof(voxlink::Status));
  ASSERT_EQ(reply->in.size(), sizeof(voxlink::Status));
  const auto status = voxlink::Load<voxlink::Status>(reply->in);
  EXPECT_EQ(status.running, 1);
  EXPECT_EQ(status.filling, 2u);
  EXPECT_EQ(status.last_complete, 1u);
  EXPECT_EQ(status.shown, 1u);
  EXPECT_EQ(status.shown_sweep, 1u);
  EXPECT_EQ(status.bytes_received, bench_.device().bytes_received());
  EXPECT_EQ(status.credit_limit, status.bytes_received + 8192);
}

TEST_F(Device, EventsAreNumberedAndAGapShowsWhatWasLost) {
  bench_.Pass(10 * kMillisecond);
  uint32_t next = bench_.Events(true).empty() ? 1 : 0;
  for (int i = 0; i < 20; ++i) {
    PassAlive(100 * kMillisecond);
    for (const SeenEvent& event : bench_.Events(true)) EXPECT_EQ(event.header.sequence, next++);
  }
}

TEST(DevicePaced, ConsumesAtItsPaceAndGivesCredit) {
  VoxlinkDeviceConfig config = Bench::SmallConfig();
  config.bytes_per_second = 100'000;
  config.receive_buffer = 65'536;
  config.max_payload = 1024;
  Bench bench(config);
  bench.StartSession();
  std::vector<std::byte> stream;
  while (stream.size() < 60'000) {
    bench.writer().Plain(stream, voxlink::PacketType::kKeepalive, 0);
  }
  const uint64_t first = bench.Bulk(stream);
  EXPECT_TRUE(bench.Result(first).has_value());
  std::vector<std::byte> more;
  for (int i = 0; i < 500; ++i) bench.writer().Plain(more, voxlink::PacketType::kKeepalive, 0);
  const uint64_t second = bench.Bulk(more);  // 20,000 bytes that do not fit
  EXPECT_FALSE(bench.Result(second).has_value());
  EXPECT_EQ(bench.device().credit_excess(), 0u);
  uint64_t credit = 65'536;
  for (int ms = 0; ms < 600; ms += 50) {
    bench.Pass(50 * kMillisecond);
    for (const SeenEvent& event : bench.Events(true)) {
      EXPECT_GE(event.header.credit_limit, credit);
      credit = event.header.credit_limit;
      EXPECT_LE(credit - 65'536, static_cast<uint64_t>((ms + 50) * 100));
    }
  }
  EXPECT_FALSE(bench.device().screen().watchdog_dark());  // busy, so its host is not lost
  EXPECT_TRUE(bench.Result(second).has_value());
  EXPECT_EQ(bench.device().credit_excess(), 60'000u + 20'000 - 65'536);
  EXPECT_GE(credit, 65'536u + 49'152);
}

TEST(DeviceDescriptors, AreWhatTheDocumentSays) {
  Bench bench;
  const auto get = [&](uint16_t value, uint16_t length = 1024) {
    return bench.Control({.request_type = 0x80, .request = 6, .value = value, .length = length});
  };
  const auto u16 = [](const std::vector<std::byte>& bytes, size_t at) {
    return voxlink::Load<uint16_t>(std::span(bytes).subspan(at));
  };
  const auto device = get(0x0100);
  ASSERT_EQ(device->in.size(), 18u);
  EXPECT_EQ(u16(device->in, 2), 0x0300);
  EXPECT_EQ(get(0x0100, 8)->in.size(), 8u);
  const auto configuration = get(0x0200);
  EXPECT_EQ(u16(configuration->in, 2), configuration->in.size());
  const auto bos = get(0x0F00);
  EXPECT_EQ(u16(bos->in, 2), bos->in.size());
  // The platform capability is the last 28 bytes: set length, vendor code.
  const size_t platform = bos->in.size() - 28;
  EXPECT_EQ(u16(bos->in, platform + 24), 162);
  const auto ms = bench.Control(
      {.request_type = 0xC0, .request = voxlink::kMsVendorCode, .index = 7, .length = 1024});
  ASSERT_EQ(ms->in.size(), 162u);
  EXPECT_EQ(u16(ms->in, 8), 162);
  EXPECT_EQ(std::to_integer<char>(ms->in[14]), 'W');
  EXPECT_EQ(get(0x0300)->in.size(), 4u);
  EXPECT_EQ(get(0x0303)->in.size(), 2 + 2 * std::string("simulated").size());
  EXPECT_EQ(get(0x0304)->status, TransferStatus::kStall);
  EXPECT_EQ(get(0x0400)->status, TransferStatus::kStall);
  EXPECT_EQ(bench.Control({.request_type = 0, .request = 9, .value = 1})->status,
            TransferStatus::kOk);
  const auto set = bench.Control({.request_type = 0x80, .request = 8, .length = 1});
  EXPECT_EQ(std::to_integer<int>(set->in.at(0)), 1);
  EXPECT_EQ(bench.Control({.request_type = 0x41, .request = 0x55})->status, TransferStatus::kStall);
  EXPECT_EQ(bench.In(Request::kGetCapabilities, 5, 4096)->status, TransferStatus::kStall);
}

}  // namespace
}  // namespace voxeld::display::emulator
