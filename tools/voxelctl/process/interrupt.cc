#include "tools/voxelctl/process/interrupt.h"

#include <poll.h>
#include <pthread.h>
#include <sys/eventfd.h>
#include <sys/signalfd.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <utility>

namespace voxeld::voxelctl {
namespace {

constexpr int kExitInterrupted = 130;

}  // namespace

Interrupt::Interrupt(Watch watch) {
  if (watch == Watch::kNothing) return;
  sigset_t set;
  sigemptyset(&set);
  sigaddset(&set, SIGINT);
  sigaddset(&set, SIGTERM);
  pthread_sigmask(SIG_BLOCK, &set, nullptr);
  signals_ = ::signalfd(-1, &set, SFD_CLOEXEC);
  stop_ = ::eventfd(0, EFD_CLOEXEC);
  thread_ = std::thread([this] { Run(); });
}

Interrupt::~Interrupt() {
  if (!thread_.joinable()) return;
  const uint64_t one = 1;
  while (::write(stop_, &one, sizeof one) < 0 && errno == EINTR) {
  }
  thread_.join();
  ::close(signals_);
  ::close(stop_);
}

void Interrupt::Run() {
  for (;;) {
    pollfd waits[2] = {{signals_, POLLIN, 0}, {stop_, POLLIN, 0}};
    if (::poll(waits, 2, -1) < 0) continue;
    if (waits[1].revents != 0) return;
    signalfd_siginfo info;
    if (::read(signals_, &info, sizeof info) != sizeof info) continue;
    if (requested()) ::_exit(kExitInterrupted);
    Request();
  }
}

void Interrupt::Request() {
  sync::MutexLock lock(mutex_);
  if (requested_.exchange(true)) return;
  for (const auto& [id, listener] : listeners_) listener();
  changed_.NotifyAll();
}

bool Interrupt::WaitUntil(sync::Clock& clock, sync::TimeNs deadline) {
  sync::MutexLock lock(mutex_);
  while (!requested() && clock.Now() < deadline) clock.WaitUntil(mutex_, changed_, deadline);
  return requested();
}

int Interrupt::AddListener(std::function<void()> listener) {
  sync::MutexLock lock(mutex_);
  if (requested()) listener();
  listeners_.emplace(next_id_, std::move(listener));
  return next_id_++;
}

void Interrupt::RemoveListener(int id) {
  sync::MutexLock lock(mutex_);
  listeners_.erase(id);
}

}  // namespace voxeld::voxelctl
