// A mesh from arrays in the caller's memory, defined as an object that two instances draw.
#include "example.h"

using namespace voxeld::client;        // NOLINT
using namespace std::chrono_literals;  // NOLINT

absl::Status Run(const std::string& address) {
  auto session = Session::Open({.address = address, .client_name = "mesh", .strict = true});
  if (!session.ok()) return session.status();

  static constexpr float kCorners[] = {1, 1, 1, 1, -1, -1, -1, 1, -1, -1, -1, 1};
  static constexpr uint8_t kColors[] = {255, 0, 0, 0, 255, 0, 0, 0, 255, 255, 255, 0};
  static constexpr uint32_t kFaces[] = {0, 1, 2, 0, 3, 1, 0, 2, 3, 1, 3, 2};
  const Mesh tetrahedron{.vertices = {.positions = std::span<const float>(kCorners),
                                      .colors = std::span<const uint8_t>(kColors),
                                      .indices = std::span<const uint32_t>(kFaces)}};
  absl::Status status = (*session)->DefineObject(
      "tetrahedron", {{.shape = tetrahedron, .color = {}, .transform = Affine::Scale(0.4)}});
  if (!status.ok()) return status;
  const Layer layer = (*session)->GetLayer("mesh");
  for (const double side : {-1.0, 1.0}) {
    auto instance = layer.Put(
        side < 0 ? "left" : "right", Instance{"tetrahedron"},
        {.transform = Affine::Translate({0.5 * side, 0, 0}) * Affine::Rotate({0, 0, 1}, side)});
    if (!instance.ok()) return instance.status();
  }
  auto frame = (*session)->Commit();
  if (!frame.ok()) return frame.status();
  auto receipt = (*session)->WaitShown(*frame, 10s);
  if (!receipt.ok()) return receipt.status();
  std::printf("accepted with %llu operations refused; %s\n",
              static_cast<unsigned long long>(receipt->refused_operations),
              receipt->outcomes.empty() ? "no display" : Word(receipt->outcomes[0].kind));
  return (*session)->Close();
}

int main(int argc, char** argv) { return RunExample(argc, argv, Run); }
