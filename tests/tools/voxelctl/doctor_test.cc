#include "tools/voxelctl/doctor/doctor.h"

#include <arpa/inet.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <set>
#include <sstream>

#include "tests/tools/voxelctl/temp_folder.h"

namespace voxeld::voxelctl {
namespace {

namespace fs = std::filesystem;
using State = Finding::State;
using ::testing::HasSubstr;

// A machine simulated by files.
class DoctorTest : public testing::Test {
 protected:
  DoctorTest() {
    machine_.sys = folder_.Path("sys");
    machine_.dev = folder_.Path("dev");
    machine_.rule_folders = {folder_.Path("rules")};
    machine_.writable = [this](const std::string& path) { return writable_.contains(path); };
    machine_.cuda = [this] { return cuda_; };
    machine_.port = [this](uint16_t port) { return port == taken_ ? port_ : PortState::kFree; };
    Write("sys/module/usbcore/parameters/usbfs_memory_mb", "256\n");
    Write("rules/70-voxeld.rules", "");
  }
  void Write(const std::string& path, const std::string& text) {
    const fs::path to = folder_.Path(path);
    fs::create_directories(to.parent_path());
    std::ofstream(to) << text;
  }
  void Attach(const std::string& place, const std::string& vendor, const std::string& product,
              int number) {
    const std::string device = "sys/bus/usb/devices/" + place;
    Write(device + "/idVendor", vendor + "\n");
    Write(device + "/idProduct", product + "\n");
    Write(device + "/serial", "S" + std::to_string(number) + "\n");
    Write(device + "/busnum", "3\n");
    Write(device + "/devnum", std::to_string(number) + "\n");
  }
  // Returns the findings of a kind.
  std::vector<Finding> Of(const std::string& what) const {
    std::vector<Finding> found;
    for (const Finding& f : Examine(machine_)) {
      if (f.what == what) found.push_back(f);
    }
    return found;
  }
  std::string Told(bool json, absl::Status* status) const {
    std::ostringstream out, err;
    Console console(out, err, json, false);
    *status = Doctor(machine_, server_, console);
    return out.str();
  }

  TempFolder folder_;
  Machine machine_;
  std::set<std::string> writable_;
  CudaState cuda_;
  std::string server_;
  uint16_t taken_ = 0;
  PortState port_ = PortState::kFree;
};

TEST_F(DoctorTest, AMachineThatIsWell) {
  absl::Status status;
  const std::string told = Told(false, &status);
  EXPECT_TRUE(status.ok()) << status;
  EXPECT_THAT(told, HasSubstr("good  usb    no Fadecandy and no voxlink device is attached\n"));
  EXPECT_THAT(told, HasSubstr("good  cuda   no NVIDIA GPU: the CPU draws\n"));
  EXPECT_THAT(told, HasSubstr("good  port   127.0.0.1:8088 (health and metrics) is free\n"));
  for (const Finding& f : Examine(machine_)) EXPECT_EQ(f.state, State::kGood) << f.text;
}

TEST_F(DoctorTest, DevicesThatCannotBeOpened) {
  Attach("1-1", "1d50", "607a", 7);
  Attach("1-2", "1234", "0001", 8);
  Write("sys/bus/usb/devices/1-2/1-2:1.0/bInterfaceClass", "ff\n");
  Write("sys/bus/usb/devices/1-2/1-2:1.0/bInterfaceSubClass", "56\n");
  Write("sys/bus/usb/devices/1-2/1-2:1.0/bInterfaceProtocol", "01\n");
  Attach("1-3", "046d", "c31c", 9);  // a keyboard
  writable_ = {machine_.dev + "/bus/usb/003/008"};
  const std::vector<Finding> usb = Of("usb");
  ASSERT_EQ(usb.size(), 2u);
  EXPECT_EQ(usb[0].state, State::kBad);
  EXPECT_EQ(usb[0].text, "Fadecandy S7 at " + machine_.dev +
                             "/bus/usb/003/007 cannot be opened: it is not yours to write");
  EXPECT_THAT(usb[0].fix, HasSubstr("udevadm trigger"));
  EXPECT_EQ(usb[1].state, State::kGood);
  EXPECT_THAT(usb[1].text, HasSubstr("voxlink device S8"));
  absl::Status status;
  Told(false, &status);
  EXPECT_EQ(status.message(), "1 thing is to be mended");
  // If the rules are missing, they are the remedy.
  fs::remove(folder_.Path("rules/70-voxeld.rules"));
  EXPECT_THAT(Of("usb")[0].fix, HasSubstr("cp packaging/70-voxeld.rules"));
  EXPECT_EQ(Of("udev")[0].state, State::kNote);
}

TEST_F(DoctorTest, WhatADeviceSaysOfItselfIsEscaped) {
  Attach("1-1", "1d50", "607a", 7);
  Write("sys/bus/usb/devices/1-1/serial", "a\x1b[2Jb");
  absl::Status status;
  EXPECT_EQ(Told(false, &status).find('\x1b'), std::string::npos);
  EXPECT_EQ(Told(true, &status).find('\x1b'), std::string::npos);
}

TEST_F(DoctorTest, LittleMemoryForTransfers) {
  Write("sys/module/usbcore/parameters/usbfs_memory_mb", "16\n");
  EXPECT_EQ(Of("usbfs")[0].state, State::kNote);
  EXPECT_EQ(Of("usbfs")[0].fix,
            "echo 64 | sudo tee " + machine_.sys + "/module/usbcore/parameters/usbfs_memory_mb");
  Write("sys/module/usbcore/parameters/usbfs_memory_mb", "0\n");
  EXPECT_EQ(Of("usbfs")[0].state, State::kGood);
  fs::remove_all(folder_.Path("sys/module"));
  EXPECT_THAT(Of("usbfs")[0].text, HasSubstr("no USB"));
}

TEST_F(DoctorTest, Gpus) {
  Write("sys/bus/pci/devices/0000:01:00.0/vendor", "0x10de\n");
  Write("sys/bus/pci/devices/0000:01:00.0/class", "0x030000\n");
  EXPECT_EQ(Of("cuda")[0].state, State::kBad);
  EXPECT_THAT(Of("cuda")[0].fix, HasSubstr("apt install nvidia-driver"));
  cuda_ = {.installed = true, .error = 999};
  EXPECT_EQ(Of("cuda")[0].state, State::kBad);
  EXPECT_THAT(Of("cuda")[0].text, HasSubstr("error 999"));
  cuda_ = {.installed = true, .devices = {"NVIDIA H200"}};
  EXPECT_EQ(Of("cuda")[0].state, State::kGood);
  EXPECT_EQ(Of("cuda")[0].text, "NVIDIA H200");
}

TEST_F(DoctorTest, PortsOfOthers) {
  taken_ = 8088;
  port_ = PortState::kHttp;
  EXPECT_THAT(Of("port")[1].text, HasSubstr("voxeld answers at 127.0.0.1:8088"));
  port_ = PortState::kClients;
  EXPECT_THAT(Of("port")[1].text, HasSubstr("is taken by a voxeld's port for clients"));
  port_ = PortState::kOther;
  EXPECT_EQ(Of("port")[1].state, State::kBad);
  EXPECT_THAT(Of("port")[1].fix, HasSubstr("voxeld --http 127.0.0.1:8089"));
  absl::Status status;
  EXPECT_THAT(Told(true, &status), HasSubstr("\"state\": \"bad\""));
  EXPECT_EQ(status.code(), absl::StatusCode::kFailedPrecondition);
}

TEST_F(DoctorTest, TheServerThatIsAskedFor) {
  taken_ = 7001;
  port_ = PortState::kOther;
  server_ = "localhost:7001";
  absl::Status status;
  EXPECT_THAT(Told(false, &status),
              HasSubstr("bad  port   127.0.0.1:7001 (clients) is taken by another program\n"
                        "             voxeld --listen 127.0.0.1:7002 "));
  for (const char* elsewhere : {"there.example:50551", "unix:/run/voxeld.sock", "tls:127.0.0.1:1",
                                "[::1]:50551", "127.0.0.2:50551"}) {
    server_ = elsewhere;
    EXPECT_EQ(Told(false, &status), "");
    EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument);
    EXPECT_THAT(status.message(), HasSubstr(server_));
  }
  server_ = "127.0.0.1:7001";
  port_ = PortState::kHttp;
  EXPECT_THAT(Told(false, &status),
              HasSubstr("(clients) is taken by a voxeld's port for health and metrics"));
  port_ = PortState::kClients;
  EXPECT_THAT(Told(false, &status),
              HasSubstr("good  port   voxeld answers at 127.0.0.1:7001 (clients)"));
  server_ = "there";
  Told(false, &status);
  EXPECT_THAT(status.message(), HasSubstr("has no port"));
}

TEST(ThisMachineTest, KnowsAPortThatIsTaken) {
  const int fd = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  ASSERT_EQ(bind(fd, reinterpret_cast<sockaddr*>(&address), sizeof(address)), 0);
  ASSERT_EQ(listen(fd, 4), 0);
  socklen_t size = sizeof(address);
  ASSERT_EQ(getsockname(fd, reinterpret_cast<sockaddr*>(&address), &size), 0);
  const Machine machine = ThisMachine();
  EXPECT_EQ(machine.port(ntohs(address.sin_port)), PortState::kOther);
  close(fd);
  EXPECT_EQ(machine.port(ntohs(address.sin_port)), PortState::kFree);
}

}  // namespace
}  // namespace voxeld::voxelctl
