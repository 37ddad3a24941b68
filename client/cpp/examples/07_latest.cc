// More frames than any display could show, under the policy LATEST: dropped frames are counted,
// here and in the server, and the newest is always shown.
#include "example.h"

using namespace voxeld::client;        // NOLINT
using namespace std::chrono_literals;  // NOLINT

absl::Status Run(const std::string& address) {
  auto session =
      Session::Open({.address = address, .client_name = "latest", .flow = Flow::kLatest});
  if (!session.ok()) return session.status();
  if (absl::Status opened = (*session)->WaitOpened(10s); !opened.ok()) return opened;
  const Layer layer = (*session)->GetLayer("flood");
  constexpr uint64_t kFrames = 300, kPoints = 30'000;
  std::vector<float> xyz(3 * kPoints);
  for (size_t i = 0; i < xyz.size(); ++i) xyz[i] = static_cast<float>(i * 31 % 2000) / 1000 - 1;
  uint64_t newest = 0;
  for (uint64_t f = 0; f < kFrames; ++f) {
    Frame frame = layer.BeginFrame();
    frame.Draw(Points{.vertices = {.positions = xyz}},
               {.transform = Affine::Rotate({0, 0, 1}, 0.01 * static_cast<double>(f))});
    auto number = frame.Commit();  // never blocks, and never fails for lack of room
    if (!number.ok()) return number.status();
    newest = *number;
  }
  if (absl::Status settled = (*session)->WaitSettled(60s); !settled.ok()) return settled;
  auto last = (*session)->WaitShown(newest, 10s);
  if (!last.ok()) return last.status();
  const Tally tally = (*session)->GetTally();
  std::printf("given up here %llu, there %llu\n",
              static_cast<unsigned long long>(tally.client_dropped_frames),
              static_cast<unsigned long long>(tally.server_dropped_frames));
  std::printf("sums: %s\n", tally.commits == kFrames && tally.accepted + tally.dropped == kFrames &&
                                    tally.refused + tally.lost + tally.unsettled == 0
                                ? "right"
                                : "wrong");
  std::printf("the newest: %s\n", last->dropped_frames == 0 ? "kept" : "given up");
  return (*session)->Close();
}

int main(int argc, char** argv) { return RunExample(argc, argv, Run); }
