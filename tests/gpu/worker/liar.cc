#include "tests/gpu/worker/liar.h"

#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <cstdio>
#include <cstdlib>
#include <thread>
#include <utility>

#include "gpu/worker/message.h"

namespace voxeld::gpu {
namespace {

void Tell(Message& answer, const std::string& lie) {
  if (answer.type != MessageType::kFrameDone) return;
  auto done = *answer.As<FrameDoneMessage>();
  if (lie == "call") answer.call += 1000;
  if (lie == "type") answer.type = MessageType::kReady;
  if (lie == "short") answer.body.resize(sizeof(FrameDoneMessage) - 1);
  if (lie == "frame") ++done.result.frame;
  if (lie == "sum") done.crc ^= 1;
  if (lie == "frame" || lie == "sum") {
    answer = MakeMessage(answer.type, answer.call, done);
  }
  if (lie == "done") answer = MakeDone(answer.call, absl::OkStatus());
}

// Forwards one message; returns false when either side ends.
template <typename Change>
bool PassOn(int from, int to, Change change) {
  absl::StatusOr<Message> message = ReceiveMessage(from);
  if (!message.ok()) return false;
  change(*message);
  const bool sent = SendMessage(to, *message).ok();
  if (message->fd >= 0) close(message->fd);
  return sent;
}

void Stand(int owner, int worker, const std::string& lie) {
  std::array<pollfd, 2> ends = {pollfd{owner, POLLIN, 0}, pollfd{worker, POLLIN, 0}};
  for (bool open = true; open && poll(ends.data(), ends.size(), -1) > 0;) {
    if (ends[0].revents != 0) open = PassOn(owner, worker, [](Message&) {});
    if (open && ends[1].revents != 0) {
      open = PassOn(worker, owner, [&](Message& answer) { Tell(answer, lie); });
    }
  }
  close(owner);
  close(worker);
}

std::array<int, 2> Pair() {
  std::array<int, 2> ends = {-1, -1};
  if (socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0, ends.data()) != 0) {
    std::perror("socketpair");
    std::abort();
  }
  return ends;
}

}  // namespace

int ServeThroughALiar(int control, const std::string& lie) {
  const std::array<int, 2> on = Pair();
  std::thread([control, lie, to = on[0]] {
    for (;;) {
      absl::StatusOr<Message> message = ReceiveMessage(control);
      if (!message.ok() || message->fd < 0) break;
      const std::array<int, 2> between = Pair();
      std::thread(Stand, std::exchange(message->fd, between[1]), between[0], lie).detach();
      const bool sent = SendMessage(to, *message).ok();
      close(between[1]);
      if (!sent) break;
    }
    close(to);
  }).detach();
  return on[1];
}

}  // namespace voxeld::gpu
