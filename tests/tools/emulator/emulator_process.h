// The real voxeld-emulator, and connections to it.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "tests/e2e/process.h"

namespace voxeld::emulator {

// A folder that is removed with all that is in it.
class TestFolder {
 public:
  TestFolder();
  ~TestFolder();
  TestFolder(const TestFolder&) = delete;
  TestFolder& operator=(const TestFolder&) = delete;
  const std::string& path() const { return path_; }

 private:
  std::string path_;
};

// The program and these.
std::vector<std::string> Emulator(std::vector<std::string> arguments);

// Descriptors of connections; throw if there is none to be had.
int Connect(const std::string& path);
int ConnectTcp(uint16_t port);

// Asks again whenever `fd` has something to read, or soon in any case; false: not within e2e::kPatience.
bool Until(int fd, const std::function<bool()>& done);

}  // namespace voxeld::emulator
