#include "gpu/worker/worker_server.h"

#include <unistd.h>

#include <csignal>
#include <cstdlib>
#include <memory>
#include <thread>

namespace voxeld::gpu {
namespace {

constexpr int kLostEngine = 3;

// Runs until the owner closes the connection. Returns the exit status of the process.
int Serve(int socket, const WorkerHooks& hooks) {
  const std::unique_ptr<WorkerConnection> connection = NewWorkerConnection(socket, hooks);
  for (;;) {
    absl::StatusOr<Message> message = ReceiveMessage(socket);
    if (!message.ok()) return 0;
    const absl::Status status = connection->Handle(*message);
    if (absl::IsUnavailable(status)) return 0;
    if (absl::IsDataLoss(status)) return kLostEngine;
    if (!status.ok()) return 1;
  }
}

}  // namespace

void ServeEngines(int control, const WorkerHooks& hooks) {
  for (;;) {
    const absl::StatusOr<Message> message = ReceiveMessage(control);
    if (!message.ok()) _exit(0);
    if (message->type != MessageType::kConnect || message->fd < 0) _exit(1);
    std::thread([connection = message->fd, &hooks] {
      if (const int code = Serve(connection, hooks); code != 0) _exit(code);
      close(connection);
    }).detach();
  }
}

void BecomeWorker() {
  setenv("CUDA_MODULE_LOADING", "EAGER", 0);
  // Multicast over NVLink needs a service of the machine that may be missing, and then hangs. The
  // ranks of one display are on one host, and no other host should reach the address where they
  // meet.
  setenv("NCCL_NVLS_ENABLE", "0", 1);
  setenv("NCCL_SOCKET_IFNAME", "lo", 0);
  // A terminal's Ctrl-C is meant for the owner, which ends its worker by closing the socket.
  std::signal(SIGINT, SIG_IGN);
  std::signal(SIGTERM, SIG_IGN);
  std::signal(SIGPIPE, SIG_IGN);
}

}  // namespace voxeld::gpu
