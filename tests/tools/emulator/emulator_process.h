// The real voxeld-emulator, and connections to it.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "tests/e2e/process.h"

namespace voxeld::emulator {

// A folder that is removed with all its contents.
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

// Returns the program with these arguments.
std::vector<std::string> Emulator(std::vector<std::string> arguments);

// These return descriptors of connections, and throw if the connection fails.
int Connect(const std::string& path);
int ConnectTcp(uint16_t port);

// Checks `done` whenever `fd` can be read, or soon in any case. Returns false if it did not hold
// within e2e::kPatience.
bool Until(int fd, const std::function<bool()>& done);

}  // namespace voxeld::emulator
