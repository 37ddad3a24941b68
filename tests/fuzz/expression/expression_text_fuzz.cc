// Expressions as text: refused with a reason, or compiled to a program that can be run.

#include <bit>
#include <cmath>
#include <cstdint>
#include <string>
#include <vector>

#include "absl/strings/ascii.h"
#include "gpu/implicit/graph.h"
#include "gpu/implicit/parse.h"
#include "gpu/implicit/program_check.h"
#include "tests/fuzz/expect.h"
#include "tests/fuzz/expression/evaluate.h"
#include "tests/fuzz/script.h"

namespace voxeld::fuzz {
namespace {

namespace implicit = gpu::implicit;

float Finite(Script& script) {
  const auto value = std::bit_cast<float>(static_cast<uint32_t>(script.Number(4)));
  return std::isfinite(value) ? value : 1;
}

void Run(Script script) {
  const uint8_t how = script.Byte() % 3;
  const std::string text = script.Text();
  implicit::Parameters parameters;
  for (int i = script.Byte() % 4; i > 0; --i) {
    std::string name = "p";  // the caller's names are letters and digits
    for (const char c : script.Text()) {
      if (absl::ascii_isalnum(static_cast<unsigned char>(c))) name += c;
    }
    parameters[name] = Finite(script);
  }
  const implicit::ParseLimits limits{.nodes = 256, .depth = 32};
  implicit::Graph graph;
  implicit::Graph::Node surface = -1, bound = -1;
  absl::Status status;
  if (how == 0) {
    const auto shape = implicit::ParseShape(text, parameters, limits, graph);
    status = shape.status();
    if (shape.ok()) surface = shape->surface, bound = shape->bound;
  } else {
    const auto node = how == 1 ? implicit::ParseCondition(text, parameters, limits, graph)
                               : implicit::ParseValue(text, parameters, limits, graph);
    status = node.status();
    if (node.ok()) surface = *node;
  }
  EXPECT_THAT_HOLDS(graph.size() <= limits.nodes + 64, graph.size(), " nodes");
  if (!status.ok()) {
    EXPECT_THAT_HOLDS(absl::IsInvalidArgument(status) || absl::IsResourceExhausted(status));
    return ExpectSays(status);
  }
  EXPECT_THAT_HOLDS(surface >= 0 && static_cast<size_t>(surface) < graph.size());
  const auto words = implicit::Compile(graph, {.surface = surface, .bound = bound});
  if (!words.ok()) {
    EXPECT_THAT_HOLDS(absl::IsResourceExhausted(words.status()));
    return ExpectSays(words.status());
  }
  const absl::Status checked = implicit::CheckProgram(*words, 0);
  EXPECT_THAT_HOLDS(checked.ok(), checked.ToString());
  for (int i = 0; i < 4; ++i) {
    float low[3], size[3];
    for (int axis = 0; axis < 3; ++axis) {
      low[axis] = static_cast<float>(script.Byte() - 128) / 16;
      size[axis] = static_cast<float>(script.Byte()) / 64;
    }
    Evaluate(*words, low, size, static_cast<float>(script.Byte()) / 255);
  }
}

}  // namespace
}  // namespace voxeld::fuzz

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  voxeld::fuzz::Run(voxeld::fuzz::Script(data, size));
  return 0;
}
