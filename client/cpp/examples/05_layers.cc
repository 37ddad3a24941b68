// Layers: order, opacity, blending, hiding.
#include "example.h"

using namespace voxeld::client;        // NOLINT
using namespace std::chrono_literals;  // NOLINT

absl::Status Run(const std::string& address) {
  auto session = Session::Open({.address = address, .client_name = "layers", .strict = true});
  if (!session.ok()) return session.status();

  const Layer base = (*session)->GetLayer("base"), glow = (*session)->GetLayer("glow"),
              hole = (*session)->GetLayer("hole");
  absl::Status status;
  const auto put = [&status](const Layer& layer, const Shape& shape, Color color) {
    if (status.ok()) status = layer.Put("it", shape, {.color = color}).status();
  };
  const auto set = [&status](const Layer& layer, const LayerLook& look) {
    if (status.ok()) status = layer.Set(look);
  };
  put(base, Box{.size = {1, 1, 1}, .fill = Fill::kSolid}, {0, 0, 200});
  put(glow, Sphere{.radius = 0.7, .fill = Fill::kSolid}, {200, 60, 0});
  put(hole, Cylinder{.radius = 0.2, .height = 2, .fill = Fill::kSolid}, {});
  set(base, {.order = 0});
  set(glow, {.opacity = uint8_t{128}, .order = 1, .blend = Blend::kAdd});
  set(hole, {.order = 2, .blend = Blend::kErase});
  if (!status.ok()) return status;
  auto together = (*session)->Commit();
  if (!together.ok()) return together.status();
  auto shown = (*session)->WaitShown(*together, 10s);
  if (!shown.ok()) return shown.status();
  std::printf("three layers: %s\n",
              shown->outcomes.empty() ? "no display" : Word(shown->outcomes[0].kind));
  // A hidden layer keeps its content; what is put into it is not shown.
  set(glow, {.visible = false});
  if (!status.ok()) return status;
  auto hidden = (*session)->Commit();
  if (!hidden.ok()) return hidden.status();
  if (auto receipt = (*session)->WaitShown(*hidden, 10s); !receipt.ok()) return receipt.status();
  put(glow, Sphere{.radius = 0.8, .fill = Fill::kSolid}, {255, 0, 0});
  if (!status.ok()) return status;
  auto unseen = (*session)->Commit();
  if (!unseen.ok()) return unseen.status();
  shown = (*session)->WaitShown(*unseen, 10s);
  if (!shown.ok()) return shown.status();
  for (const Outcome& outcome : shown->outcomes)
    std::printf("into a hidden layer: %s (%s)\n", Word(outcome.kind), outcome.reason.c_str());
  return (*session)->Close();
}

int main(int argc, char** argv) { return RunExample(argc, argv, Run); }
