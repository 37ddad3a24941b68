#include "daemon/process/supervisor.h"

#include <fcntl.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <cstddef>
#include <cstdlib>
#include <cstring>
#include <ctime>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"

namespace voxeld::daemon {
namespace {

constexpr int kFirstSocket = 3;  // SD_LISTEN_FDS_START
constexpr const char* kVariables[] = {"NOTIFY_SOCKET", "WATCHDOG_USEC", "WATCHDOG_PID",
                                      "LISTEN_FDS",    "LISTEN_PID",    "LISTEN_FDNAMES"};

// Returns: nothing if the variable is unset or not a number.
std::optional<int64_t> Number(const Supervisor::Environment& environment, const char* name) {
  const std::optional<std::string> text = environment(name);
  int64_t number = 0;
  if (!text.has_value() || !absl::SimpleAtoi(*text, &number)) return {};
  return number;
}

}  // namespace

Supervisor::Supervisor(const Environment& environment) {
  const std::string socket = environment("NOTIFY_SOCKET").value_or("");
  const bool usable = (socket.starts_with('/') || socket.starts_with('@')) &&
                      socket.size() < sizeof(sockaddr_un::sun_path);
  if (usable) socket_ = socket;
  const std::optional<int64_t> watchdog_pid = Number(environment, "WATCHDOG_PID");
  if (!watchdog_pid.has_value() || *watchdog_pid == getpid()) {
    const int64_t microseconds = Number(environment, "WATCHDOG_USEC").value_or(0);
    watchdog_ns_ = std::max<int64_t>(0, microseconds) * 1000;
  }
  if (Number(environment, "LISTEN_PID").value_or(-1) != getpid()) return;
  const int64_t count = Number(environment, "LISTEN_FDS").value_or(0);
  const std::vector<std::string> names =
      absl::StrSplit(environment("LISTEN_FDNAMES").value_or(""), ':');
  for (int64_t i = 0; i < std::min<int64_t>(count, 1024); ++i) {
    InheritedSocket socket_at{Descriptor(kFirstSocket + static_cast<int>(i)), ""};
    if (static_cast<size_t>(i) < names.size()) socket_at.name = names[static_cast<size_t>(i)];
    fcntl(socket_at.descriptor.get(), F_SETFD, FD_CLOEXEC);
    sockets_.push_back(std::move(socket_at));
  }
}

Supervisor Supervisor::OfProcess() {
  Supervisor supervisor([](const char* name) -> std::optional<std::string> {
    const char* value = std::getenv(name);
    if (value == nullptr) return {};
    return std::string(value);
  });
  for (const char* name : kVariables) unsetenv(name);
  return supervisor;
}

void Supervisor::Ready(std::string_view status) const {
  Tell(absl::StrCat("READY=1\nSTATUS=", absl::string_view(status.data(), status.size())));
}
void Supervisor::Reloading() const {
  timespec now{};
  clock_gettime(CLOCK_MONOTONIC, &now);
  const int64_t us = int64_t{now.tv_sec} * 1'000'000 + now.tv_nsec / 1000;
  Tell(absl::StrCat("RELOADING=1\nMONOTONIC_USEC=", us, "\nSTATUS=reading its files again"));
}
void Supervisor::Alive() const { Tell("WATCHDOG=1"); }
void Supervisor::Stopping() const { Tell("STOPPING=1\nSTATUS=shutting down"); }
void Supervisor::Status(std::string_view status) const {
  Tell(absl::StrCat("STATUS=", absl::string_view(status.data(), status.size())));
}

void Supervisor::Tell(std::string text) const {
  if (!present()) return;
  // A field is a single line.
  const size_t status = text.find("STATUS=");
  if (status != std::string::npos) {
    std::replace(text.begin() + static_cast<std::ptrdiff_t>(status), text.end(), '\n', ' ');
  }
  const Descriptor descriptor(socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0));
  if (!descriptor.ok()) return;
  sockaddr_un name = {};
  name.sun_family = AF_UNIX;
  std::memcpy(name.sun_path, socket_.data(), socket_.size());
  if (socket_.front() == '@') name.sun_path[0] = '\0';
  const auto length = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + socket_.size() +
                                             (socket_.front() != '@'));
  (void)sendto(descriptor.get(), text.data(), text.size(), MSG_NOSIGNAL,
               reinterpret_cast<const sockaddr*>(&name), length);
}

}  // namespace voxeld::daemon
