// The machine that the doctor examines.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

namespace voxeld::voxelctl {

// The answers of NVIDIA's driver.
struct CudaState {
  bool installed = false;  // libcuda.so.1 can be opened
  int error = 0;           // of cuInit or of counting devices; 0: none
  std::vector<std::string> devices;
};

// The user of a TCP port of this machine: a voxeld's port for clients, its http port, another
// program, or nobody.
enum class PortState : uint8_t { kFree, kClients, kHttp, kOther };

struct Machine {
  std::string sys = "/sys", dev = "/dev";
  std::vector<std::string> rule_folders = {"/etc/udev/rules.d", "/run/udev/rules.d",
                                           "/usr/lib/udev/rules.d", "/lib/udev/rules.d"};
  std::string group_file = "/etc/group";
  uint16_t clients_port = 50551;                          // the port to which clients connect
  std::function<bool(const std::string& path)> writable;  // by the current user
  std::function<CudaState()> cuda;
  std::function<PortState(uint16_t port)> port;  // of 127.0.0.1
};

// Returns this machine.
Machine ThisMachine();

}  // namespace voxeld::voxelctl
