// A disk that fails: what this program asks the system for a file goes through here.
#pragma once

#include <cstdint>
#include <functional>

namespace voxeld::daemon::assets {

enum class DiskCall : uint8_t { kRead, kWrite, kSync };  // pread, pwrite, fsync

// While it is there, `answer` is asked before each of these calls, in the caller's thread: 0: the system carries it out, else the
// number of the error with which it fails, or kOneByte. One at a time.
class DiskCalls {
 public:
  static constexpr int kOneByte = -1;  // it reads or writes no more
  explicit DiskCalls(std::function<int(DiskCall)> answer);
  ~DiskCalls();
  DiskCalls(const DiskCalls&) = delete;
  DiskCalls& operator=(const DiskCalls&) = delete;
};

}  // namespace voxeld::daemon::assets
