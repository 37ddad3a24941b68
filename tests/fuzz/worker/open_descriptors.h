// Finds out whether descriptors were left open, and which.
#pragma once

#include <dirent.h>
#include <unistd.h>

#include <set>
#include <string>

namespace voxeld::fuzz {

// Returns the files of the open descriptors.
inline std::multiset<std::string> OpenDescriptors() {
  std::multiset<std::string> open;
  DIR* const folder = opendir("/proc/self/fd");
  while (const dirent* entry = readdir(folder)) {
    char target[256];
    const ssize_t size = readlinkat(dirfd(folder), entry->d_name, target, sizeof(target));
    if (size > 0) open.emplace(target, static_cast<size_t>(size));
  }
  closedir(folder);
  return open;
}

}  // namespace voxeld::fuzz
