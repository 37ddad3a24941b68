// A display whose driver is controlled by the test.
#pragma once

#include <gtest/gtest.h>

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "display/api/display.h"
#include "display/sync/fake_clock.h"

namespace voxeld::display {

using sync::kMillisecond;
using sync::kSecond;
using Kind = VolumeOutcome::Kind;

inline constexpr FrameLayout kLayout{.slices = 2, .width = 2, .height = 1};

// The bytes of a volume are the whole of it.
class PlainDecoder final : public WireDecoder {
 public:
  absl::Status OnBytes(uint8_t, std::span<const std::byte> bytes, size_t) override {
    if (bytes.empty()) return absl::DataLossError("nothing");
    bytes_.insert(bytes_.end(), bytes.begin(), bytes.end());
    return absl::OkStatus();
  }
  std::optional<DecodedVolume> TakeVolume() override {
    if (bytes_.size() != kLayout.bytes()) return std::nullopt;
    DecodedVolume decoded{.volume = 99, .layout = kLayout};
    const size_t each = kLayout.bytes_per_slice();
    const std::vector<std::byte> bytes = std::exchange(bytes_, {});
    for (size_t at = 0; at < bytes.size(); at += each) {
      decoded.pictures.push_back(std::make_shared<const std::vector<std::byte>>(
          bytes.data() + at, bytes.data() + at + each));
    }
    return decoded;
  }

 private:
  std::vector<std::byte> bytes_;
};

class ScriptedDisplay final : public Display {
 public:
  explicit ScriptedDisplay(sync::Clock& clock)
      : Display(DisplayInfo{.name = "d", .driver = "scripted", .layout = kLayout}, clock) {}
  ~ScriptedDisplay() override { Stop(); }

  using Display::Attached;
  using Display::DeviceLost;
  using Display::FrameDone;
  using Display::FrameLost;
  using Display::in_flight;
  using Display::tapped;

  void Done() { FrameDone(clock().Now(), Evidence::kEstimated, clock().Now() - 1, 10); }

  struct Sent {
    uint64_t volume;
    bool full;
    bool operator==(const Sent&) const = default;
  };
  std::vector<Sent> sent;
  std::vector<std::string> calls;
  absl::Status start_status, brightness_status, blank_status;
  bool done_at_once = false;
  bool lost_at_once = false;
  size_t tap_bytes = kLayout.bytes();
  std::function<void()> in_tick;

 private:
  absl::Status DoStart() override { return start_status; }
  void DoStop() override { calls.push_back("stop"); }
  void DoSend(const SliceFramePtr& frame, bool full) override {
    sent.push_back({frame->volume, full});
    if (tapped()) TapOut(1, std::span(frame->bytes).first(tap_bytes));
    if (lost_at_once) return FrameLost("script", 3);
    if (done_at_once) Done();
  }
  sync::TimeNs DoTick(sync::TimeNs now) override {
    if (in_tick) std::exchange(in_tick, nullptr)();
    return now + kSecond;
  }
  absl::Status DoSetBrightness(double brightness) override {
    calls.push_back("brightness " + std::to_string(brightness));
    return brightness_status;
  }
  absl::Status DoSetBlank(bool blank) override {
    calls.push_back(blank ? "blank" : "unblank");
    return blank_status;
  }
  std::unique_ptr<WireDecoder> DoMakeDecoder() const override {
    return std::make_unique<PlainDecoder>();
  }
};

struct Log final : Display::Listener {
  void OnOutcome(const VolumeOutcome& outcome) override { outcomes.push_back(outcome); }
  void OnState(DisplayState state, const std::string& reason) override { states.push_back(state); }
  bool HasNewer() const override { return has_newer; }
  bool has_newer = false;
  std::vector<VolumeOutcome> outcomes;
  std::vector<DisplayState> states;
};

class DisplayTest : public testing::Test {
 protected:
  DisplayTest() : display_(clock_) {}

  static SliceFramePtr Frame(uint64_t volume) {
    SliceFrame frame{.volume = volume, .layout = kLayout};
    frame.bytes.assign(kLayout.bytes(), static_cast<std::byte>(volume));
    frame.changed_in.assign(kLayout.pictures(), volume);
    return std::make_shared<SliceFrame>(std::move(frame));
  }
  void Start() {
    ASSERT_TRUE(display_.Start(&log_, [] {}).ok());
  }
  void StartAttached() {
    Start();
    display_.Attached();
  }
  void ExpectOutcome(size_t index, uint64_t volume, Kind kind, const std::string& reason = "") {
    ASSERT_LT(index, log_.outcomes.size());
    EXPECT_EQ(log_.outcomes[index].volume, volume);
    EXPECT_EQ(log_.outcomes[index].kind, kind);
    EXPECT_EQ(log_.outcomes[index].reason, reason);
  }
  using Captured = std::optional<absl::StatusOr<DecodedVolume>>;
  void Capture(Captured& into, sync::TimeNs timeout = kSecond) {
    display_.Capture(timeout, [&into](absl::StatusOr<DecodedVolume> v) {
      ASSERT_FALSE(into.has_value()) << "answered twice";
      into = std::move(v);
    });
  }

  sync::FakeClock clock_;
  Log log_;
  ScriptedDisplay display_;
};

}  // namespace voxeld::display
