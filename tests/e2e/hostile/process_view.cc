#include "tests/e2e/hostile/process_view.h"

#include <sys/resource.h>

#include <filesystem>
#include <fstream>
#include <set>
#include <string>

namespace voxeld::e2e {
namespace {

std::filesystem::path ProcFolder(pid_t process) {
  return std::filesystem::path("/proc") / std::to_string(process);
}

uint64_t ProcFigure(pid_t process, const char* name) {
  std::ifstream status(ProcFolder(process) / "status");
  std::string word;
  while (status >> word) {
    uint64_t kib = 0;
    if (word == name && status >> kib) return kib;
  }
  return 0;
}

}  // namespace

uint64_t ResidentKib(pid_t process) { return ProcFigure(process, "VmRSS:"); }
uint64_t MostResidentKib(pid_t process) { return ProcFigure(process, "VmHWM:"); }

bool LeaveDescriptors(pid_t process, size_t spare) {
  std::set<size_t> used;
  std::error_code error;
  for (const auto& entry : std::filesystem::directory_iterator(ProcFolder(process) / "fd", error)) {
    used.insert(std::stoul(entry.path().filename().string()));
  }
  size_t most = 0;
  while (used.contains(most) || spare-- > 0) ++most;

  rlimit limit = {};
  if (prlimit(process, RLIMIT_NOFILE, nullptr, &limit) != 0) return false;
  limit.rlim_cur = most;
  return prlimit(process, RLIMIT_NOFILE, &limit, nullptr) == 0;
}

}  // namespace voxeld::e2e
