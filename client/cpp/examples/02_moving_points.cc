// Immediate mode: each frame replaces everything that its layer held.
#include <cmath>

#include "example.h"

using namespace voxeld::client;        // NOLINT
using namespace std::chrono_literals;  // NOLINT

absl::Status Run(const std::string& address) {
  auto session = Session::Open({.address = address, .client_name = "moving points"});
  if (!session.ok()) return session.status();
  const Layer layer = (*session)->GetLayer("points");

  constexpr int kFrames = 100, kPoints = 1000;
  for (int f = 0; f < kFrames; ++f) {
    // Optional: keep no more commits in flight than the displays can show. Nothing else here
    // blocks.
    if (absl::Status room = (*session)->WaitForRoom(10s); !room.ok()) return room;
    std::vector<float> xyz;
    std::vector<uint8_t> rgb;
    for (int p = 0; p < kPoints; ++p) {
      const float along = static_cast<float>(p) / kPoints, turn = 20 * along + 0.1f * f;
      xyz.insert(xyz.end(), {0.9f * std::cos(turn), 0.9f * std::sin(turn), 2 * along - 1});
      rgb.insert(rgb.end(), {static_cast<uint8_t>(255 * along), 255, 128});
    }
    Frame frame = layer.BeginFrame();
    // Moved in, the arrays are sent without a copy.
    frame.Draw(Points{.vertices = {.positions = std::move(xyz), .colors = std::move(rgb)}});
    if (auto number = frame.Commit(); !number.ok()) return number.status();
  }
  if (absl::Status settled = (*session)->WaitSettled(10s); !settled.ok()) return settled;

  const Tally tally = (*session)->GetTally();
  for (const auto& [display, counts] : tally.displays) {
    const uint64_t sum =
        counts.presented + counts.unchanged + counts.superseded + counts.lost + counts.not_shown;
    std::printf("%s: %llu of %d frames have their outcome, %s\n", display.c_str(),
                static_cast<unsigned long long>(sum), kFrames,
                counts.presented > 0 ? "some presented" : "none presented");
  }
  return (*session)->Close();
}

int main(int argc, char** argv) { return RunExample(argc, argv, Run); }
