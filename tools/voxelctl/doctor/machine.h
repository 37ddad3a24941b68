// The machine that a doctor looks at.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

namespace voxeld::voxelctl {

// What NVIDIA's driver answers.
struct CudaState {
  bool installed = false;  // libcuda.so.1 can be opened
  int error = 0;           // of cuInit, of counting; 0: none
  std::vector<std::string> devices;
};

// Who has a TCP port of this machine's: a voxeld's port for clients, its http port.
enum class PortState : uint8_t { kFree, kClients, kHttp, kOther };

struct Machine {
  std::string sys = "/sys", dev = "/dev";
  std::vector<std::string> rule_folders = {"/etc/udev/rules.d", "/run/udev/rules.d",
                                           "/usr/lib/udev/rules.d", "/lib/udev/rules.d"};
  std::string group_file = "/etc/group";
  uint16_t clients_port = 50551;                          // that clients connect to
  std::function<bool(const std::string& path)> writable;  // by whoever runs this
  std::function<CudaState()> cuda;
  std::function<PortState(uint16_t port)> port;  // of 127.0.0.1
};

// This one.
Machine ThisMachine();

}  // namespace voxeld::voxelctl
