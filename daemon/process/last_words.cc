#include "daemon/process/last_words.h"

#include <poll.h>
#include <unistd.h>

#include <cerrno>

namespace voxeld::daemon {

void SayAtOnce(std::string_view line) noexcept {
  const int before = errno;
  pollfd out = {.fd = STDERR_FILENO, .events = POLLOUT, .revents = 0};
  if (poll(&out, 1, 0) == 1) {
    const ssize_t written = write(STDERR_FILENO, line.data(), line.size());
    (void)written;  // nobody may read it any more
  }
  errno = before;
}

}  // namespace voxeld::daemon
