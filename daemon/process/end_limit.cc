#include "daemon/process/end_limit.h"

#include <poll.h>
#include <signal.h>
#include <sys/time.h>
#include <unistd.h>

#include <string_view>

namespace voxeld::daemon {
namespace {

void EndNow(int) {
  constexpr std::string_view kWhy =
      "voxeld: it did not end in time, and is ended; what was told to be durable is kept\n";
  pollfd out = {.fd = STDERR_FILENO, .events = POLLOUT, .revents = 0};
  // Nobody may read it any more.
  if (poll(&out, 1, 0) == 1 && write(STDERR_FILENO, kWhy.data(), kWhy.size()) < 0) _exit(1);
  _exit(1);
}

}  // namespace

EndLimit::EndLimit(sync::TimeNs limit) {
  struct sigaction action = {};
  action.sa_handler = EndNow;
  sigaction(SIGALRM, &action, nullptr);
  sigset_t alarm;
  sigemptyset(&alarm);
  sigaddset(&alarm, SIGALRM);
  pthread_sigmask(SIG_UNBLOCK, &alarm, nullptr);
  constexpr sync::TimeNs kMicrosecond = 1000;
  const itimerval timer = {
      .it_interval = {},
      .it_value = {.tv_sec = limit / sync::kSecond,
                   .tv_usec = static_cast<suseconds_t>(limit % sync::kSecond / kMicrosecond)}};
  setitimer(ITIMER_REAL, &timer, nullptr);
}

EndLimit::~EndLimit() {
  const itimerval off = {};
  setitimer(ITIMER_REAL, &off, nullptr);
}

}  // namespace voxeld::daemon
