// Tests the real program, as seen by a host at the other end of USB/IP or usbredir.
#include <sys/socket.h>

#include <charconv>
#include <csignal>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>

#include "gtest/gtest.h"
#include "tests/display/emulator/carriers/peer.h"
#include "tests/display/emulator/carriers/usbredir_host.h"
#include "tests/e2e/process.h"
#include "tests/hil/control_client.h"
#include "tests/tools/emulator/emulator_process.h"

namespace voxeld::emulator {
namespace {

using display::emulator::Bytes;
using display::emulator::Hex;
using display::emulator::Peer;
using display::emulator::UsbredirHost;

constexpr const char* kDevice = "voxlink,size=4x4x2,rate=100,serial=e2e,speed=high";
constexpr const char* kDescriptor = "12 01 10 02 00 00 00 40 09 12 01 00 00 01 01 02 03 01";

class Program : public testing::Test {
 protected:
  ~Program() override {
    if (process_ == nullptr) return;
    process_->Signal(SIGTERM);
    EXPECT_EQ(process_->Wait(), 0) << process_->output();
    EXPECT_FALSE(std::filesystem::exists(control_));
    EXPECT_FALSE(std::filesystem::exists(usbredir_));
  }
  // Starts it, and waits until it is ready. Returns its output.
  std::string Start(std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), kDevice);
    arguments.insert(arguments.end(), {"--control", control_});
    process_ = std::make_unique<e2e::Process>(Emulator(std::move(arguments)));
    EXPECT_TRUE(process_->ReadLineWith("ready").has_value()) << process_->output();
    return process_->output();
  }
  std::string Ask(const std::string& line) { return hil::ControlClient(control_).Ask(line); }
  nlohmann::json Status() { return nlohmann::json::parse(Ask("status")); }

  TestFolder folder_;
  const std::string control_ = folder_.path() + "/control";
  const std::string usbredir_ = folder_.path() + "/usb";
  std::unique_ptr<e2e::Process> process_;
};

TEST(CommandLine, AWrongOneEndsWithTwoAndSaysWhatWasMeant) {
  e2e::Process process(Emulator({kDevice, "--usbredr", "x"}));
  EXPECT_EQ(process.Wait(), 2);
  EXPECT_NE(process.output().find("--usbredr is no option here; did you mean --usbredir?"),
            std::string::npos)
      << process.output();
}

class OverUsbip : public Program {
 protected:
  void SetUp() override {
    const std::string said = Start({"--usbip", "0"});
    const std::string before = "127.0.0.1:";
    const size_t at = said.find(before);
    ASSERT_NE(at, std::string::npos) << said;
    std::from_chars(said.data() + at + before.size(), said.data() + said.size(), port_);
    ASSERT_NE(port_, 0);
  }
  // Returns the first `size` bytes that arrive; fewer if they do not.
  static Bytes Receive(Peer& peer, size_t size) {
    Bytes all;
    Until(peer.fd(), [&] {
      const Bytes some = peer.Take();
      all.insert(all.end(), some.begin(), some.end());
      return all.size() >= size;
    });
    return all;
  }
  static bool AwaitEnd(Peer& peer) {
    return Until(peer.fd(), [&] {
      char byte = 0;
      return recv(peer.fd(), &byte, 1, MSG_DONTWAIT) == 0;
    });
  }
  std::unique_ptr<Peer> Import() {
    auto peer = std::make_unique<Peer>(ConnectTcp(port_));
    peer->Send(Hex("01 11 80 03 00 00 00 00  31 2d 31 00*29"));
    EXPECT_EQ(Receive(*peer, 320).size(), 320u);
    return peer;
  }
  static void ExpectDescriptor(Peer& peer) {
    peer.Send(
        Hex("00 00 00 01  00 00 00 07  00 01 00 02  00 00 00 01  00 00 00 00  00 00 00 00 "
            "00 00 00 12  00 00 00 00  ff ff ff ff  00 00 00 00  80 06 00 01 00 00 12 00"));
    const Bytes answer = Receive(peer, 66);
    ASSERT_EQ(answer.size(), 66u);
    EXPECT_EQ(Bytes(answer.begin() + 48, answer.end()), Hex(kDescriptor));
  }

  uint16_t port_ = 0;
};

TEST_F(OverUsbip, ListsTheDevice) {
  Peer peer(ConnectTcp(port_));
  peer.Send(Hex("01 11 80 05 00 00 00 00"));
  EXPECT_EQ(Receive(peer, 328).size(), 328u);  // 12, the device's 312, its interface's 4
  EXPECT_TRUE(AwaitEnd(peer));
}

TEST_F(OverUsbip, PlaysTheDeviceOneHostAfterTheOther) {
  std::unique_ptr<Peer> first = Import();
  ExpectDescriptor(*first);
  const int plugs = Status()["plugs"];
  first = nullptr;
  // For the device, a disconnected host is a pulled cable.
  EXPECT_TRUE(Until(-1, [&] { return Status()["plugs"] == plugs + 1; }));
  ExpectDescriptor(*Import());
}

TEST_F(OverUsbip, UnplugEndsTheConnectionAndPlugTakesANewOne) {
  const std::unique_ptr<Peer> peer = Import();
  EXPECT_EQ(Ask("unplug"), "ok");
  EXPECT_TRUE(AwaitEnd(*peer));
  Peer refused(ConnectTcp(port_));
  refused.Send(Hex("01 11 80 03 00 00 00 00  31 2d 31 00*29"));
  EXPECT_EQ(Receive(refused, 8), Hex("01 11 00 03 00 00 00 01"));
  EXPECT_EQ(Ask("plug"), "ok");
  ExpectDescriptor(*Import());
}

TEST_F(OverUsbip, GarbageEndsOneConnectionOnly) {
  Peer garbage(ConnectTcp(port_));
  garbage.Send(Hex("ff*8"));
  EXPECT_TRUE(AwaitEnd(garbage));
  const std::unique_ptr<Peer> peer = Import();
  peer->Send(Hex("ff*48"));
  EXPECT_TRUE(AwaitEnd(*peer));
  ExpectDescriptor(*Import());
}

TEST_F(OverUsbip, FaultsAreTakenAndRefused) {
  EXPECT_EQ(Ask("fault stall@t1"), "ok");
  EXPECT_EQ(Ask("clear"), "ok");
  EXPECT_THROW(Ask("fault boom@t1"), std::runtime_error);
  EXPECT_THROW(Ask("jump"), std::runtime_error);
}

class OverUsbredir : public Program {
 protected:
  void SetUp() override { Start({"--usbredir", usbredir_}); }
};

struct Guest {
  explicit Guest(const std::string& path) : peer(Connect(path)), host(peer) { host.Write(); }
  bool Await(const std::function<bool()>& done) {
    return Until(peer.fd(), [&] { return host.Read() && done(); });
  }
  Peer peer;
  UsbredirHost host;
};

TEST_F(OverUsbredir, PlaysTheDeviceThroughUnplugs) {
  Guest guest(usbredir_);
  ASSERT_TRUE(guest.Await([&] { return guest.host.connects == 1; }));
  guest.host.Control(1, 0x80, 6, 0x0100, 18);
  ASSERT_TRUE(guest.Await([&] { return guest.host.controls.size() == 1; }));
  EXPECT_EQ(guest.host.controls[0].data, Hex(kDescriptor));
  Ask("unplug");
  ASSERT_TRUE(guest.Await([&] { return guest.host.disconnects == 1; }));
  Ask("plug");
  ASSERT_TRUE(guest.Await([&] { return guest.host.connects == 2; }));
  guest.host.Control(2, 0x80, 6, 0x0100, 18);
  ASSERT_TRUE(guest.Await([&] { return guest.host.controls.size() == 2; }));
}

// Events arrive without further requests from the guest.
TEST_F(OverUsbredir, InterruptsGoOn) {
  Guest guest(usbredir_);
  ASSERT_TRUE(guest.Await([&] { return guest.host.connects == 1; }));
  guest.host.StartInterrupts(1, 0x82);
  guest.host.Control(2, 0x41, 5, 0, 0);  // START
  EXPECT_TRUE(guest.Await([&] { return guest.host.interrupts.size() >= 20; }));
}

TEST_F(OverUsbredir, GarbageEndsOneConnectionOnly) {
  {
    Guest guest(usbredir_);
    ASSERT_TRUE(guest.Await([&] { return guest.host.connects == 1; }));
    guest.peer.Send(Hex("ff*64"));
    ASSERT_TRUE(Until(guest.peer.fd(), [&] { return !guest.host.Read(); }));
  }
  Guest guest(usbredir_);
  EXPECT_TRUE(guest.Await([&] { return guest.host.connects == 1; }));
}

TEST_F(OverUsbredir, APathThatIsTakenIsRefused) {
  const e2e::Ended ended = e2e::RunToEnd(Emulator({kDevice, "--usbredir", usbredir_}));
  EXPECT_EQ(ended.code, 1) << ended.output;
  EXPECT_NE(ended.output.find(usbredir_), std::string::npos) << ended.output;
  Guest guest(usbredir_);  // and still exists
  EXPECT_TRUE(guest.Await([&] { return guest.host.connects == 1; }));
}

TEST(ProgramArguments, WhatIsWrongIsSaid) {
  const auto code = [](std::vector<std::string> arguments) {
    const e2e::Ended ended = e2e::RunToEnd(Emulator(std::move(arguments)));
    EXPECT_FALSE(ended.output.empty());
    return ended.code;
  };
  EXPECT_EQ(code({"voxlink"}), 2);
  EXPECT_EQ(code({"toaster", "--usbip", "0"}), 2);
  EXPECT_NE(code({"voxlink", "--usbip", "0", "--usbredir", "/tmp/x"}), 0);
  EXPECT_NE(code({"voxlink", "--usbip", "99999"}), 0);
  EXPECT_EQ(code({"voxlink", "--usbip", "0", "--control", "/nowhere/at/all"}), 1);
  EXPECT_EQ(code({"--help"}), 0);
}

}  // namespace
}  // namespace voxeld::emulator
