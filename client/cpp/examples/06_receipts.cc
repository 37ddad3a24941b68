// Receipts by callback, and the time that a commit spends in each stage.
#include <atomic>

#include "example.h"

using namespace voxeld::client;        // NOLINT
using namespace std::chrono_literals;  // NOLINT

absl::Status Run(const std::string& address) {
  std::atomic<int> settled = 0;
  Options options{.address = address, .client_name = "receipts"};
  // Called on the session's own thread, after each change.
  options.on_receipt = [&settled](const Receipt& receipt) { settled += receipt.settled ? 1 : 0; };
  auto session = Session::Open(std::move(options));
  if (!session.ok()) return session.status();

  const Layer layer = (*session)->GetLayer("receipts");
  uint64_t last = 0;
  for (int i = 0; i < 20; ++i) {
    auto ball = layer.Put("ball", Sphere{.radius = 0.3 + 0.02 * i});
    if (!ball.ok()) return ball.status();
    auto frame = (*session)->Commit();
    if (!frame.ok()) return frame.status();
    last = *frame;
    if (absl::Status room = (*session)->WaitForRoom(10s); !room.ok()) return room;
  }
  auto receipt = (*session)->WaitShown(last, 10s);
  if (!receipt.ok()) return receipt.status();
  if (absl::Status all = (*session)->WaitSettled(10s); !all.ok()) return all;
  for (const Outcome& outcome : receipt->outcomes) {
    const Stages& at = outcome.stages;
    const std::pair<const char*, int64_t> stages[] = {
        {"sent", at.sent_ns},       {"received", at.received_ns},
        {"decoded", at.decoded_ns}, {"applied", at.applied_ns},
        {"drawing", at.drawing_ns}, {"assembled", at.assembled_ns},
        {"sliced", at.sliced_ns},   {"transferred", at.transferred_ns},
        {"shown", at.shown_ns}};
    int64_t before = 0;
    bool ascending = true;
    std::printf("%s: %s\n", outcome.display.c_str(), Word(outcome.kind));
    for (const auto& [name, time] : stages) {
      if (time == 0) continue;  // unknown
      if (before != 0)
        std::printf("  %-12s +%.3f ms\n", name, static_cast<double>(time - before) / 1e6);
      ascending = ascending && time >= before;
      before = time;
    }
    std::printf("stages ascend: %s\n", ascending ? "yes" : "no");
  }
  const absl::Status closed = (*session)->Close();
  session->reset();  // no callback comes after this
  std::printf("settled, as the callback was told: %d\n", settled.load());
  return closed;
}

int main(int argc, char** argv) { return RunExample(argc, argv, Run); }
