// Tests each fault on its own, with a device whose protocol the injector does not know.

#include "display/emulator/fault_injector.h"

#include <algorithm>
#include <string>
#include <vector>

#include "display/sync/fake_clock.h"
#include "gtest/gtest.h"

namespace voxeld::display::emulator {
namespace {

using sync::kMillisecond;
using What = Fault::What;
using When = Fault::When;

// Accepts every OUT transfer at once and records the bytes; its IN endpoint never has data.
class Sink final : public UsbDeviceModel {
 public:
  explicit Sink(std::vector<std::byte>* bytes) : bytes_(bytes) {}
  void SetComplete(Complete complete) override { complete_ = std::move(complete); }
  void Submit(const Urb& urb) override {
    if ((urb.endpoint & 0x80) != 0) {
      waiting_.push_back(urb.id);
      return;
    }
    bytes_->insert(bytes_->end(), urb.out.begin(), urb.out.end());
    complete_(urb.id, TransferStatus::kOk, static_cast<uint32_t>(urb.out.size()), {});
  }
  bool Unlink(uint64_t id) override { return std::erase(waiting_, id) > 0; }
  void Tick() override {}
  sync::TimeNs NextTimeout() const override { return sync::kNever; }
  UsbSpeed speed() const override { return UsbSpeed::kHigh; }
  void Reset() override {}
  void SetPlugged(bool plugged) override {
    plugged_ = plugged;
    if (plugged) ++plugs_;
    for (const uint64_t id : std::exchange(waiting_, {})) {
      complete_(id, TransferStatus::kDisconnected, 0, {});
    }
  }
  bool plugged() const override { return plugged_; }
  uint32_t plugs() const override { return plugs_; }

 private:
  std::vector<std::byte>* bytes_;
  Complete complete_;
  std::vector<uint64_t> waiting_;
  bool plugged_ = true;
  uint32_t plugs_ = 1;
};

class Injector : public testing::Test {
 protected:
  struct Done {
    uint64_t id;
    TransferStatus status;
    uint32_t actual;
    bool operator==(const Done&) const = default;
  };

  Injector() : injector_(std::make_unique<Sink>(&bytes_), {}, clock_) {
    injector_.SetComplete(
        [this](uint64_t id, TransferStatus status, uint32_t actual, std::span<const std::byte>) {
          done_.push_back({id, status, actual});
        });
  }
  void Plan(const std::string& text) {
    const auto plan = ParseFaultPlan(text);
    ASSERT_TRUE(plan.ok()) << plan.status();
    for (const Fault& fault : *plan) injector_.Add(fault);
  }
  // Sends ten bytes, id·16 and up.
  void Send(uint64_t id, uint8_t endpoint = 1) {
    auto& out = out_[id];
    for (uint64_t i = 0; i < 10; ++i) out.push_back(static_cast<std::byte>(id * 16 + i));
    Urb urb;
    urb.id = id;
    urb.endpoint = endpoint;
    if ((endpoint & 0x80) != 0) {
      urb.length = 64;
    } else {
      urb.out = out;
    }
    injector_.Submit(urb);
  }
  void ClearHalt(uint64_t id, uint8_t endpoint) {
    Urb urb;
    urb.id = id;
    urb.setup = {.request_type = 2, .request = 1, .value = 0, .index = endpoint};
    injector_.Submit(urb);
  }
  std::string Received() const {
    std::string text;
    for (const std::byte b : bytes_) {
      text += "0123456789abcdef"[std::to_integer<int>(b) >> 4];
      text += "0123456789abcdef"[std::to_integer<int>(b) & 15];
    }
    return text;
  }
  void Advance(int ms) {
    clock_.Advance(ms * kMillisecond);
    injector_.Tick();
  }

  sync::FakeClock clock_;
  std::vector<std::byte> bytes_;
  FaultInjector injector_;
  std::map<uint64_t, std::vector<std::byte>> out_;
  std::vector<Done> done_;
};

constexpr TransferStatus kOk = TransferStatus::kOk;
constexpr TransferStatus kStall = TransferStatus::kStall;
constexpr TransferStatus kError = TransferStatus::kError;
constexpr TransferStatus kDisconnected = TransferStatus::kDisconnected;

TEST_F(Injector, TransfersAndBytesCountFromWhenAFaultIsAdded) {
  Send(1);
  Send(2);
  Plan("stall@t2");
  Send(3);
  Send(4);
  ASSERT_EQ(done_.size(), 4u);
  EXPECT_EQ(done_[2].status, TransferStatus::kOk);
  EXPECT_EQ(done_[3].status, TransferStatus::kStall);
  ClearHalt(5, 1);
  bytes_.clear();
  Plan("corrupt:1@b12");
  Send(6);
  Send(7);
  EXPECT_EQ(Received(), "6061626364656667686970718d73747576777879");
}

TEST_F(Injector, WithoutAPlanAllPasses) {
  Send(1);
  EXPECT_EQ(done_, (std::vector<Done>{{1, kOk, 10}}));
  EXPECT_EQ(Received(), "10111213141516171819");
}

TEST_F(Injector, StallHaltsUntilCleared) {
  Plan("stall@t2");
  Send(1);
  Send(2);
  Send(3);
  ClearHalt(4, 1);
  Send(5);
  EXPECT_EQ(done_, (std::vector<Done>{
                       {1, kOk, 10}, {2, kStall, 0}, {3, kStall, 0}, {4, kOk, 0}, {5, kOk, 10}}));
  EXPECT_EQ(injector_.faults_left(), 0u);
}

TEST_F(Injector, PartialPassesItsBytesThenHalts) {
  Plan("partial:4@t1");
  Send(1);
  Send(2);
  EXPECT_EQ(done_, (std::vector<Done>{{1, kStall, 4}, {2, kStall, 0}}));
  EXPECT_EQ(Received(), "10111213");
}

TEST_F(Injector, ErrorsCountDown) {
  Plan("error:2@t1");
  for (uint64_t id = 1; id <= 3; ++id) Send(id);
  EXPECT_EQ(done_, (std::vector<Done>{{1, kError, 0}, {2, kError, 0}, {3, kOk, 10}}));
  EXPECT_EQ(Received(), "30313233343536373839");
}

TEST_F(Injector, CorruptsOneByteByOffsetOrByStream) {
  Plan("corrupt:3@t1;corrupt:0@b15");
  Send(1);
  Send(2);
  EXPECT_EQ(Received(),
            "101112ec141516171819"
            "2021222324da26272829");
  EXPECT_EQ(done_, (std::vector<Done>{{1, kOk, 10}, {2, kOk, 10}}));
}

TEST_F(Injector, DropsBytesThatTheHostThinksItSent) {
  Plan("drop:3@t1;drop:20@b18");
  Send(1);
  Send(2);
  EXPECT_EQ(Received(),
            "10111213141819"
            "2021222324252627");
  EXPECT_EQ(done_, (std::vector<Done>{{1, kOk, 10}, {2, kOk, 10}}));
}

TEST_F(Injector, NakHoldsTheEndpointInOrder) {
  Plan("nak:20@t2");
  for (uint64_t id = 1; id <= 3; ++id) Send(id);
  EXPECT_EQ(done_.size(), 1u);
  EXPECT_EQ(injector_.NextTimeout(), clock_.Now() + 20 * kMillisecond);
  EXPECT_TRUE(injector_.Unlink(2));
  Advance(19);
  EXPECT_EQ(done_.size(), 1u);
  Advance(1);
  EXPECT_EQ(done_, (std::vector<Done>{{1, kOk, 10}, {3, kOk, 10}}));
}

TEST_F(Injector, DelayHoldsCompletionsInOrder) {
  Plan("delay:20@t1");
  Send(1);
  Send(2);
  EXPECT_EQ(bytes_.size(), 20u);
  EXPECT_TRUE(done_.empty());
  Advance(20);
  EXPECT_EQ(done_, (std::vector<Done>{{1, kOk, 10}, {2, kOk, 10}}));
}

TEST_F(Injector, UnplugsAndPlugsInAgain) {
  Plan("unplug:50@100ms");
  Send(1, 0x82);
  EXPECT_EQ(injector_.NextTimeout(), clock_.Now() + 100 * kMillisecond);
  Advance(100);
  EXPECT_FALSE(injector_.plugged());
  Send(2);
  EXPECT_EQ(done_, (std::vector<Done>{{1, kDisconnected, 0}, {2, kDisconnected, 0}}));
  Advance(50);
  EXPECT_TRUE(injector_.plugged());
  EXPECT_EQ(injector_.plugs(), 2u);
  EXPECT_EQ(injector_.NextTimeout(), sync::kNever);
}

TEST_F(Injector, FaultsKeepToTheirEndpoint) {
  Plan("stall@t1/in");
  Send(1);
  Send(2, 0x82);
  EXPECT_EQ(done_, (std::vector<Done>{{1, kOk, 10}, {2, kStall, 0}}));
}

TEST(FaultPlan, IsReadAndRefused) {
  const auto plan = ParseFaultPlan("nak:5@t7;unplug:500@2000ms;corrupt:0@b99;stall@3ms/in");
  ASSERT_TRUE(plan.ok());
  ASSERT_EQ(plan->size(), 4u);
  EXPECT_EQ((*plan)[0].what, What::kNak);
  EXPECT_EQ((*plan)[0].amount, 5u * kMillisecond);
  EXPECT_EQ((*plan)[0].at, 7u);
  EXPECT_EQ((*plan)[1].when, When::kTime);
  EXPECT_EQ((*plan)[1].at, 2u * sync::kSecond);
  EXPECT_EQ((*plan)[2].when, When::kByte);
  EXPECT_EQ((*plan)[3].endpoint, 0x82);
  EXPECT_TRUE(ParseFaultPlan("")->empty());
  for (const char* bad : {"stall", "fire@t1", "stall:3@t1", "nak@t1", "nak:x@t1", "stall@7",
                          "stall@t", "stall@-1ms", "nak:-1@t1", "nak:99999999999999@t1"}) {
    const auto refused = ParseFaultPlan(bad);
    EXPECT_EQ(refused.status().code(), absl::StatusCode::kInvalidArgument) << bad;
    EXPECT_NE(std::string(refused.status().message()).find(bad), std::string::npos);
  }
}

TEST(FaultPlan, WhatIsWrongIsShownEscapedAndNotAtLength) {
  const auto control = ParseFaultPlan("t\001y\"\xffvalue\n");
  EXPECT_TRUE(std::string(control.status().message())
                  .starts_with("fault \"t\\x01y\\\"\\xffvalue\\n\": there is no '@'"))
      << control.status();
  const std::string longest(64, 'a');
  for (const char* rest : {"@t1", "@t1;stall@t1", ""}) {
    const auto whole = ParseFaultPlan(longest.substr(0, 61) + rest);
    EXPECT_NE(std::string(whole.status().message()).find("\": there is no"), std::string::npos);
    EXPECT_EQ(std::string(whole.status().message()).find("…"), std::string::npos);
  }
  const auto cut = ParseFaultPlan(longest + std::string(100'000, 'b'));
  EXPECT_TRUE(std::string(cut.status().message())
                  .starts_with("fault \"" + longest + "…\": there is no '@'"))
      << cut.status();
}

}  // namespace
}  // namespace voxeld::display::emulator
