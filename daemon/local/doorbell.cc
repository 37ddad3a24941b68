#include "daemon/local/doorbell.h"

#include <sys/eventfd.h>

#include <cerrno>
#include <cstdint>

#include "absl/status/status.h"

namespace voxeld::daemon::local {

absl::StatusOr<std::shared_ptr<Doorbell>> Doorbell::Make() {
  Descriptor made(eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK));
  if (made.get() < 0) return absl::ErrnoToStatus(errno, "eventfd");
  return std::shared_ptr<Doorbell>(new Doorbell(std::move(made)));
}

void Doorbell::Ring() const {
  // Fails only if it has been rung 2⁶⁴ - 2 times already.
  const uint64_t one = 1;
  [[maybe_unused]] const ssize_t written = write(descriptor_.get(), &one, sizeof(one));
}

void Doorbell::Quiet() const {
  uint64_t rung = 0;
  [[maybe_unused]] const ssize_t got = read(descriptor_.get(), &rung, sizeof(rung));
}

}  // namespace voxeld::daemon::local
