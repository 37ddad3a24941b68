#include "tools/lights/receiver.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/ip/udp.hpp>
#include <boost/asio/write.hpp>
#include <functional>
#include <string>
#include <thread>

namespace voxeld::lights {
namespace {

namespace asio = boost::asio;
using asio::ip::tcp;
using asio::ip::udp;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

constexpr sync::TimeNs kLong = 20 * sync::kSecond;

class ReceiverTest : public ::testing::Test {
 protected:
  void Open(const IntakeOptions& lights, size_t connections = 64) {
    intake_ = std::make_unique<Intake>(lights);
    auto opened = Receiver::Open({.listen = "127.0.0.1:0", .most_connections = connections}, lights,
                                 *intake_, clock_);
    ASSERT_TRUE(opened.ok()) << opened.status();
    receiver_ = *std::move(opened);
    port_ = static_cast<uint16_t>(
        std::stoi(receiver_->address().substr(receiver_->address().rfind(':') + 1)));
  }
  void RunUntil(const std::function<bool()>& done) {
    const sync::TimeNs deadline = clock_.Now() + kLong;
    while (!done() && clock_.Now() < deadline) receiver_->Run(deadline - clock_.Now());
    EXPECT_TRUE(done());
  }
  tcp::socket Connect() {
    tcp::socket socket(io_);
    socket.connect(tcp::endpoint(asio::ip::address_v4::loopback(), port_));
    return socket;
  }

  sync::SystemClock clock_;
  std::unique_ptr<Intake> intake_;
  std::unique_ptr<Receiver> receiver_;
  uint16_t port_ = 0;
  asio::io_context io_;
};

TEST_F(ReceiverTest, TakesOpcOfSeveral) {
  Open({.protocol = Protocol::kOpc, .lights = 1});
  tcp::socket one = Connect(), two = Connect();
  const std::array<uint8_t, 7> message = {0, 0, 0, 3, 1, 2, 3};
  asio::write(one, asio::buffer(message));
  asio::write(two, asio::buffer(message));
  RunUntil([this] { return intake_->tally().set == 2; });
  EXPECT_THAT(*intake_->Take(), ElementsAre(1, 2, 3));
  EXPECT_EQ(receiver_->tally().open, 2u);
  // One connection ends within a message, the other continues.
  asio::write(one, asio::buffer(message, 5));
  one.close();
  RunUntil([this] { return receiver_->tally().cut_off == 1; });
  asio::write(two, asio::buffer(message));
  RunUntil([this] { return intake_->tally().set == 3; });
  EXPECT_EQ(receiver_->tally().open, 1u);
}

TEST_F(ReceiverTest, RefusesMoreThanItHasRoomFor) {
  Open({.protocol = Protocol::kOpc, .lights = 1}, 1);
  tcp::socket one = Connect(), two = Connect();
  RunUntil([this] { return receiver_->tally().connections == 2; });
  EXPECT_EQ(receiver_->tally().refused, 1u);
  boost::system::error_code error;
  std::array<uint8_t, 1> byte{};
  two.read_some(asio::buffer(byte), error);
  EXPECT_TRUE(error);  // closed
  one.close();
  RunUntil([this] { return receiver_->tally().open == 0; });
  tcp::socket three = Connect();
  RunUntil([this] { return receiver_->tally().open == 1; });
}

TEST_F(ReceiverTest, TakesDatagramsAndAnswersPolls) {
  Open({.protocol = Protocol::kArtNet, .lights = 2, .first_universe = 0});
  udp::socket socket(io_, udp::v4());
  const udp::endpoint to(asio::ip::address_v4::loopback(), port_);
  const std::array<uint8_t, 22> light = {'A', 'r', 't', '-', 'N', 'e', 't', 0, 0, 0x50, 0,
                                         14,  0,   0,   0,   0,   0,   4,   9, 8, 7,    6};
  socket.send_to(asio::buffer(light), to);
  RunUntil([this] { return intake_->tally().set == 1; });
  std::array<uint8_t, 14> poll = {'A', 'r', 't', '-', 'N', 'e', 't', 0, 0, 0x20, 0, 14, 0, 0};
  socket.send_to(asio::buffer(poll), to);
  RunUntil([this] { return intake_->tally().other == 1; });
  std::array<uint8_t, 512> answer{};
  EXPECT_EQ(socket.receive(asio::buffer(answer)), 239u);
  EXPECT_EQ(answer[9], 0x21);
}

TEST_F(ReceiverTest, SaysWhyAnAddressCannotBeHad) {
  Open({.protocol = Protocol::kOpc, .lights = 1});
  const IntakeOptions lights = {.protocol = Protocol::kOpc, .lights = 1};
  const auto second = Receiver::Open({.listen = receiver_->address()}, lights, *intake_, clock_);
  EXPECT_EQ(second.status().code(), absl::StatusCode::kUnavailable);
  EXPECT_THAT(std::string(second.status().message()), HasSubstr(receiver_->address()));
  EXPECT_FALSE(Receiver::Open({.listen = "somewhere:1"}, lights, *intake_, clock_).ok());
}

TEST_F(ReceiverTest, AWakeEndsItsRun) {
  Open({.protocol = Protocol::kOpc, .lights = 1});
  std::thread other([this] { receiver_->Wake(); });
  receiver_->Run(kLong);
  other.join();
}

}  // namespace
}  // namespace voxeld::lights
