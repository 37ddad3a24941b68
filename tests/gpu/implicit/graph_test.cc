#include "gpu/implicit/graph.h"

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "gpu/implicit/program_check.h"
#include "tests/conformance/program_generator.h"

namespace voxeld::gpu::implicit {
namespace {

TEST(Graph, WhatIsAlikeIsMadeOnceAndConstantsAreComputed) {
  Graph g;
  const Graph::Node a = g.Add(g.Axis(0), g.Constant(1)), b = g.Add(g.Axis(0), g.Constant(1));
  EXPECT_EQ(a, b);
  EXPECT_EQ(g.Mul(g.Constant(2), g.Constant(3)), g.Constant(6));
  EXPECT_EQ(g.Sqrt(g.Constant(16)), g.Constant(4));
  const absl::StatusOr<std::vector<uint32_t>> words = Compile(g, {.surface = g.Mul(a, b)});
  ASSERT_TRUE(words.ok());
  EXPECT_EQ(ProgramView{words->data()}.surface(), 4u);  // x, 1, x + 1, its square
}

TEST(Graph, WhatIsCompiledPassesTheCheck) {
  for (uint64_t seed = 0; seed < 2000; ++seed) {
    conformance::SceneGenerator random(seed);
    conformance::ModelGeometry g;
    conformance::AddProgram(random, 20, g);
    const absl::Status status = CheckProgram(g.indices, g.record.vertex_count);
    ASSERT_TRUE(status.ok()) << status;
  }
}

// A sum whose terms all need one another's slots.
TEST(Graph, TooManyResultsAtOnceAreRefused) {
  Graph g;
  std::vector<Graph::Node> layer;
  for (int i = 0; i < 64; ++i) layer.push_back(g.Sin(g.Add(g.Axis(i % 3), g.Constant(i))));
  Graph::Node product = g.Constant(1);
  for (const Graph::Node node : layer) product = g.Mul(product, node);
  // Read again in reverse, so that none may be forgotten.
  for (size_t i = layer.size(); i-- > 0;)
    product = g.Mul(g.Add(product, layer[i]), layer[(i * 7) % 64]);
  const absl::Status status = Compile(g, {.surface = product}).status();
  EXPECT_EQ(status.code(), absl::StatusCode::kResourceExhausted);
  EXPECT_NE(status.message().find("intermediate results at once; at most 1024 and 24"),
            std::string::npos)
      << status;
}

TEST(Graph, AChainAsLongAsThereAreInstructionsIsFine) {
  Graph g;
  Graph::Node chain = g.Axis(0);
  for (int i = 0; i < 1000; ++i) chain = g.Sin(chain);
  EXPECT_TRUE(Compile(g, {.surface = chain}).ok());
  for (int i = 0; i < 100; ++i) chain = g.Sin(chain);
  EXPECT_EQ(Compile(g, {.surface = chain}).status().code(), absl::StatusCode::kResourceExhausted);
}

// Every word of a program is changed: the program is refused, or still safe to run.
TEST(Program, SpoiltOnesAreRefusedOrHarmless) {
  uint64_t refused = 0, run = 0;
  for (uint64_t seed = 0; seed < 300; ++seed) {
    conformance::SceneGenerator random(seed);
    conformance::ModelGeometry g;
    conformance::AddProgram(random, 20, g);
    std::vector<uint32_t> words = g.indices;
    const size_t place = static_cast<size_t>(random.Int(0, static_cast<int64_t>(words.size()) - 1));
    words[place] =
        static_cast<uint32_t>(random.Chance(0.5) ? random.Int(0, 64) : random.Int(0, 0xFFFFFFFFll));
    if (random.Chance(0.2)) words.resize(place);
    if (!CheckProgram(words, g.record.vertex_count).ok()) {
      ++refused;
      continue;
    }
    ++run;
    const ProgramView view{words.data()};
    const float at[3] = {1, 2, 3};
    float slots[kMostSlots];
    implicit::Run(view.surface_code(), view.surface(), at, 1.0f, slots);
  }
  EXPECT_GT(refused, 100u);
  EXPECT_GT(run, 20u);
}

TEST(Program, RefusalsSayWhatIsWrong) {
  EXPECT_EQ(CheckProgram({}, 0).message(), "program: size is 0, must be 12 words at least");
  Graph g;
  std::vector<uint32_t> words = *Compile(g, {.surface = g.Axis(0)});
  EXPECT_TRUE(CheckProgram(words, 0).ok());
  EXPECT_EQ(CheckProgram(words, 3).message(),
            "program: last ring end is 0, must be 3, as there are positions");
  words[kHeaderWords] = 99;
  EXPECT_EQ(CheckProgram(words, 0).message(),
            "program: surface, instruction 0: op is 99, must be 0 to 23, but not 5");
}

}  // namespace
}  // namespace voxeld::gpu::implicit
