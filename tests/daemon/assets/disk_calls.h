// A disk that fails: the file operations of this program go through here.
#pragma once

#include <cstdint>
#include <functional>

namespace voxeld::daemon::assets {

enum class DiskCall : uint8_t { kRead, kWrite, kSync };  // pread, pwrite, fsync

// As long as it exists, `answer` is called before each of these calls, in the caller's thread. It
// returns 0 to let the system carry it out, the number of the error with which it fails, or
// kOneByte. Only one may exist at a time.
class DiskCalls {
 public:
  static constexpr int kOneByte = -1;  // it reads or writes only one byte
  explicit DiskCalls(std::function<int(DiskCall)> answer);
  ~DiskCalls();
  DiskCalls(const DiskCalls&) = delete;
  DiskCalls& operator=(const DiskCalls&) = delete;
};

}  // namespace voxeld::daemon::assets
