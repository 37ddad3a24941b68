// Draws one line and waits until it is shown.
#include "example.h"

using namespace voxeld::client;        // NOLINT
using namespace std::chrono_literals;  // NOLINT

absl::Status Run(const std::string& address) {
  auto session = Session::Open({.address = address, .client_name = "hello line"});
  if (!session.ok()) return session.status();

  const Layer layer = (*session)->GetLayer("hello");
  auto line = layer.Put("line", Segments{.vertices = {.positions = {-1, -1, -1, 1, 1, 1}}},
                        {.color = {255, 160, 0}});
  if (!line.ok()) return line.status();
  auto frame = (*session)->Commit();
  if (!frame.ok()) return frame.status();

  auto receipt = (*session)->WaitShown(*frame, 10s);
  if (!receipt.ok()) return receipt.status();
  for (const Outcome& outcome : receipt->outcomes) {
    std::printf("%s: %s, volume %llu\n", outcome.display.c_str(), Word(outcome.kind),
                static_cast<unsigned long long>(outcome.volume));
  }
  return (*session)->Close();
}

int main(int argc, char** argv) { return RunExample(argc, argv, Run); }
