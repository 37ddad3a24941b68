// A session that outlives its server: its content is restored after a restart, and the loop
// continues meanwhile. Ends after the server was reachable, was gone, and is back.
#include <condition_variable>
#include <mutex>
#include <thread>

#include "example.h"

using namespace voxeld::client;        // NOLINT
using namespace std::chrono_literals;  // NOLINT

absl::Status Run(const std::string& address) {
  std::mutex mutex;
  std::condition_variable changed;
  bool again = false;
  Options options{.address = address, .client_name = "reconnect"};
  // a server that keeps running keeps the session that long
  options.on_disconnect = OnDisconnect::kLinger;
  options.linger = 10s;
  options.first_pause = 50ms;
  options.longest_pause = 500ms;
  options.on_connection = [&](const ConnectionChange& change) {
    using Kind = ConnectionChange::Kind;
    const std::lock_guard lock(mutex);
    if (change.kind == Kind::kLost) std::printf("lost\n");
    if (change.kind == Kind::kResumed || change.kind == Kind::kRestored) {
      std::printf("%s\n", change.kind == Kind::kResumed ? "resumed" : "restored");
      again = true;
      changed.notify_all();
    }
  };
  auto session = Session::Open(std::move(options));
  if (!session.ok()) return session.status();
  const Layer layer = (*session)->GetLayer("outlives");
  auto ball = layer.Put("ball", Sphere{.radius = 0.5});
  if (!ball.ok()) return ball.status();
  auto frame = (*session)->Commit();
  if (!frame.ok()) return frame.status();
  if (auto receipt = (*session)->WaitAccepted(*frame, 10s); !receipt.ok()) return receipt.status();
  std::printf("up\n");

  // The caller's loop, which a lost connection does not block.
  for (int i = 1;; ++i) {
    if (absl::Status moved = ball->SetTransform(Affine::Rotate({0, 0, 1}, 0.01 * i)); !moved.ok())
      return moved;
    frame = (*session)->Commit();
    if (!frame.ok()) return frame.status();
    std::unique_lock lock(mutex);
    if (changed.wait_for(lock, 20ms, [&] { return again; })) break;
  }
  // Moving a missing entity would be refused, so this shows that it was restored.
  if (absl::Status moved = ball->SetTransform(Affine()); !moved.ok()) return moved;
  frame = (*session)->Commit();
  if (!frame.ok()) return frame.status();
  auto receipt = (*session)->WaitAccepted(*frame, 10s);
  if (!receipt.ok()) return receipt.status();
  const Tally tally = (*session)->GetTally();
  std::printf("still up: %llu operations refused, %llu commits lost\n",
              static_cast<unsigned long long>(tally.refused_operations),
              static_cast<unsigned long long>(tally.lost));
  return (*session)->Close();
}

int main(int argc, char** argv) { return RunExample(argc, argv, Run); }
