#include "daemon/process/last_words.h"

#include <poll.h>
#include <unistd.h>

#include <cerrno>

namespace voxeld::daemon {

void SayAtOnce(std::string_view line) noexcept {
  const int before = errno;
  pollfd out = {.fd = STDERR_FILENO, .events = POLLOUT, .revents = 0};
  // Writing to a closed pipe would raise a signal.
  if (poll(&out, 1, 0) == 1 && (out.revents & (POLLOUT | POLLERR | POLLHUP)) == POLLOUT) {
    const ssize_t written = write(STDERR_FILENO, line.data(), line.size());
    (void)written;  // the reader may be gone
  }
  errno = before;
}

}  // namespace voxeld::daemon
