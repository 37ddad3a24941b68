// Commits for future times, by the server's clock, which pings estimate.
#include <thread>

#include "example.h"

using namespace voxeld::client;        // NOLINT
using namespace std::chrono_literals;  // NOLINT

absl::Status Run(const std::string& address) {
  auto session = Session::Open({.address = address, .client_name = "present at"});
  if (!session.ok()) return session.status();
  if (absl::Status opened = (*session)->WaitOpened(10s); !opened.ok()) return opened;
  std::optional<int64_t> now;
  while (!(now = (*session)->ServerNow())) std::this_thread::sleep_for(10ms);
  const ClockEstimate clock = *(*session)->clock();
  std::printf("the server's clock is known to %s\n",
              clock.round_trip_ns < 100'000'000 ? "under 50 ms" : "no use");

  const Layer layer = (*session)->GetLayer("timed");
  constexpr int64_t kStep = 100'000'000;
  std::vector<uint64_t> frames;
  for (int i = 1; i <= 5; ++i) {
    Frame frame = layer.BeginFrame();
    frame.Draw(Sphere{.radius = 0.15 * i});
    auto number = frame.Commit({.present_at_ns = *now + 2 * kStep + i * kStep});
    if (!number.ok()) return number.status();
    frames.push_back(*number);
  }
  int in_time = 0, late = 0;
  for (size_t i = 0; i < frames.size(); ++i) {
    auto receipt = (*session)->WaitShown(frames[i], 10s);
    if (!receipt.ok()) return receipt.status();
    late += receipt->late ? 1 : 0;
    const int64_t due = *now + 2 * kStep + static_cast<int64_t>(i + 1) * kStep;
    for (const Outcome& outcome : receipt->outcomes) {
      if (outcome.kind == Outcome::Kind::kPresented && outcome.time_ns >= due) ++in_time;
    }
  }
  std::printf("%d shown, none before its time; %d late\n", in_time, late);
  return (*session)->Close();
}

int main(int argc, char** argv) { return RunExample(argc, argv, Run); }
