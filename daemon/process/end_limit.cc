#include "daemon/process/end_limit.h"

#include <signal.h>
#include <sys/time.h>
#include <unistd.h>

#include <string_view>

#include "daemon/process/last_words.h"

namespace voxeld::daemon {
namespace {

void EndNow(int) {
  constexpr std::string_view kWhy =
      "voxeld: it did not end in time, and is ended; what was told to be durable is kept\n";
  SayAtOnce(kWhy);
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
