// Tests formulas that are compiled while the engine works, on a GPU: when, for which programs, and
// that they are used.
#include "gpu/cuda/compiled_formulas.h"

#include <gmock/gmock.h>

#include <chrono>
#include <thread>

#include "gpu/implicit/formula_text.h"
#include "gpu/implicit/graph.h"
#include "gpu/implicit/hoist.h"

namespace voxeld::gpu::cuda {
namespace {

// Returns sin(x)·cos(y)·… − shift, with `more` further waves.
std::vector<uint32_t> Waves(double shift, int more) {
  implicit::Graph graph;
  implicit::Graph::Node sum = graph.Constant(shift);
  for (int i = 0; i <= more; ++i) {
    const implicit::Graph::Node xy =
        graph.Add(graph.Axis(0), graph.Mul(graph.Constant(i + 1), graph.Axis(1)));
    sum = graph.Add(sum, graph.Sin(graph.Add(xy, graph.Axis(2))));
  }
  const auto program = Compile(graph, {.surface = sum});
  EXPECT_TRUE(program.ok()) << program.status();
  const uint32_t depends[3] = {1, 2, 4};
  return implicit::Hoist({program->data()}, depends);
}

class CompiledFormulasTest : public ::testing::Test {
 protected:
  CompiledFormulasTest() : api_(*Api::Open(0)) {}
  // All of these tests need the compiler: without it they fail, and say so.
  void SetUp() override {
    const auto nvrtc = Nvrtc::OpenFor(9, 0);
    ASSERT_TRUE(nvrtc.ok()) << nvrtc.status();
  }
  const std::unique_ptr<Api> api_;
};

cudaKernel_t Find(CompiledFormulas& formulas, const std::vector<uint32_t>& hoisted) {
  const absl::StatusOr<cudaKernel_t> kernel = formulas.Find(hoisted);
  EXPECT_TRUE(kernel.ok()) << kernel.status();
  return kernel.ok() ? *kernel : nullptr;
}

TEST_F(CompiledFormulasTest, AtOnceThereIsAKernelForEachShapeOfProgram) {
  CompiledFormulas formulas(*api_, CompileFormulas::kAtOnce);
  const cudaKernel_t one = Find(formulas, Waves(0.5, 0));
  ASSERT_NE(one, nullptr);
  EXPECT_EQ(Find(formulas, Waves(0.25, 0)), one);
  const cudaKernel_t other = Find(formulas, Waves(0.5, 1));
  EXPECT_NE(other, nullptr);
  EXPECT_NE(other, one);
  EXPECT_EQ(formulas.compiled(), 2u);
}

TEST_F(CompiledFormulasTest, LaterItIsCompiledForWhatComesAgain) {
  CompiledFormulas formulas(*api_, CompileFormulas::kLater);
  EXPECT_EQ(Find(formulas, Waves(0.5, 0)), nullptr);
  EXPECT_EQ(Find(formulas, Waves(0.5, 1)), nullptr);
  // It is compiled within a second, or not at all.
  const auto until = std::chrono::steady_clock::now() + std::chrono::seconds(60);
  cudaKernel_t found = nullptr;
  while (found == nullptr && std::chrono::steady_clock::now() < until) {
    found = Find(formulas, Waves(0.5, 0));
    std::this_thread::yield();
  }
  EXPECT_NE(found, nullptr);
  EXPECT_EQ(formulas.compiled(), 1u);
}

TEST_F(CompiledFormulasTest, NeitherNeverNorForWhatIsTooHeavy) {
  CompiledFormulas never(*api_, CompileFormulas::kNever);
  for (int i = 0; i < 3; ++i) EXPECT_EQ(Find(never, Waves(0.5, 0)), nullptr);
  CompiledFormulas at_once(*api_, CompileFormulas::kAtOnce);
  const std::vector<uint32_t> heavy = Waves(0.5, 25);
  EXPECT_GT(implicit::FormulaWeight(heavy), CompiledFormulas::kMostWeight);
  EXPECT_EQ(Find(at_once, heavy), nullptr);
  EXPECT_EQ(at_once.compiled(), 0u);
}

TEST_F(CompiledFormulasTest, WhatWasAskedForTheLongestAgoGoes) {
  CompiledFormulas formulas(*api_, CompileFormulas::kAtOnce, 2);
  const cudaKernel_t first = Find(formulas, Waves(0.5, 0));
  Find(formulas, Waves(0.5, 1));
  formulas.BeginFrame();
  EXPECT_EQ(Find(formulas, Waves(0.5, 0)), first);
  EXPECT_NE(Find(formulas, Waves(0.5, 2)), nullptr);  // replaces the second
  EXPECT_EQ(formulas.kept(), 2u);
  EXPECT_EQ(formulas.compiled(), 3u);
  EXPECT_EQ(Find(formulas, Waves(0.5, 0)), first);
  EXPECT_EQ(formulas.compiled(), 3u);
  EXPECT_NE(Find(formulas, Waves(0.5, 1)), nullptr);
  EXPECT_EQ(formulas.compiled(), 4u);
}

TEST_F(CompiledFormulasTest, WhatAFrameHasFoundStaysForIt) {
  CompiledFormulas formulas(*api_, CompileFormulas::kAtOnce, 1);
  formulas.BeginFrame();
  for (int more = 0; more < 3; ++more) EXPECT_NE(Find(formulas, Waves(0.5, more)), nullptr);
  EXPECT_EQ(formulas.kept(), 3u);
  formulas.BeginFrame();
  Find(formulas, Waves(0.5, 3));
  EXPECT_EQ(formulas.kept(), 3u);  // one has been removed
}

TEST_F(CompiledFormulasTest, MayGoWhileItCompiles) {
  for (int i = 0; i < 3; ++i) {
    CompiledFormulas formulas(*api_, CompileFormulas::kLater);
    for (int round = 0; round < 2; ++round) {
      for (int more = 0; more < 4; ++more) Find(formulas, Waves(0.5, more));
    }
  }
}

TEST_F(CompiledFormulasTest, AFaultOfTheDeviceIsTold) {
  CompiledFormulas formulas(*api_, CompileFormulas::kAtOnce);
  api_->SetFaults({.call = 1, .error = cudaErrorMemoryAllocation});
  EXPECT_EQ(formulas.Find(Waves(0.5, 0)).status().code(), absl::StatusCode::kResourceExhausted);
}

}  // namespace
}  // namespace voxeld::gpu::cuda
