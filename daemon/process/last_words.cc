#include "daemon/process/last_words.h"

#include <poll.h>
#include <unistd.h>

#include <cerrno>

namespace voxeld::daemon {

void SayAtOnce(std::string_view line) noexcept {
  const int before = errno;
  pollfd out = {.fd = STDERR_FILENO, .events = POLLOUT, .revents = 0};
  // Written to where nobody reads any more, it would be a signal's turn.
  if (poll(&out, 1, 0) == 1 && (out.revents & (POLLOUT | POLLERR | POLLHUP)) == POLLOUT) {
    const ssize_t written = write(STDERR_FILENO, line.data(), line.size());
    (void)written;  // nobody may read it any more
  }
  errno = before;
}

}  // namespace voxeld::daemon
