// Retained mode: entities stay, and changing one sends only the change.
#include "example.h"

using namespace voxeld::client;        // NOLINT
using namespace std::chrono_literals;  // NOLINT

// Commits and waits; returns how many bytes were handed to the server, over the wire and in sealed
// memory.
static absl::StatusOr<uint64_t> CommitAndCount(Session& session) {
  const auto given = [&session] {
    const Tally tally = session.GetTally();
    return tally.bytes_sent + tally.memory_bytes;
  };
  const uint64_t before = given();
  auto frame = session.Commit();
  if (!frame.ok()) return frame.status();
  auto receipt = session.WaitAccepted(*frame, 10s);
  if (!receipt.ok()) return receipt.status();
  return given() - before;
}

absl::Status Run(const std::string& address) {
  auto session = Session::Open(
      {.address = address, .client_name = "handles", .strict = true, .ping_interval = Duration(0)});
  if (!session.ok()) return session.status();
  if (absl::Status opened = (*session)->WaitOpened(10s); !opened.ok()) return opened;
  const Layer layer = (*session)->GetLayer("handles");
  std::vector<float> cloud(3 * 20'000);
  for (size_t i = 0; i < cloud.size(); ++i)
    cloud[i] = static_cast<float>((i * 7919) % 1000) / 1000 - 0.5f;
  auto points = layer.Put("cloud", Points{.vertices = {.positions = cloud}});
  auto ball = layer.Put("ball", Sphere{.radius = 0.3}, {.color = {0, 200, 255}});
  if (!points.ok()) return points.status();
  if (!ball.ok()) return ball.status();
  auto bytes = CommitAndCount(**session);
  if (!bytes.ok()) return bytes.status();
  std::printf("put up: over %llu KiB\n",
              static_cast<unsigned long long>(*bytes / 1024 / 100 * 100));

  for (int step = 1; step <= 10; ++step) {
    absl::Status moved = points->SetTransform(Affine::Rotate({0, 0, 1}, 0.1 * step));
    if (!moved.ok()) return moved;
    bytes = CommitAndCount(**session);
    if (!bytes.ok()) return bytes.status();
  }
  std::printf("moved ten times: each under %d bytes\n", *bytes < 300 ? 300 : -1);

  if (absl::Status set = ball->Set(Box{.size = {0.2, 0.2, 0.2}}); !set.ok()) return set;
  if (absl::Status removed = points->Remove(); !removed.ok()) return removed;
  bytes = CommitAndCount(**session);
  if (!bytes.ok()) return bytes.status();
  std::printf("changed and removed: under %d bytes\n", *bytes < 400 ? 400 : -1);
  return (*session)->Close();
}

int main(int argc, char** argv) { return RunExample(argc, argv, Run); }
