// Tests the promises of gpu/engine.h about errors, with each of the CUDA engine's calls of CUDA
// failing in turn.
//
// VOXELD_FAULTS_EVERY: fails only every n-th call (default 1, in passes 11; where a CPU plays the
// GPU 127 and 254), starting at one that VOXELD_SEED draws.
#include <gmock/gmock.h>

#include <algorithm>
#include <cstdlib>
#include <functional>
#include <iostream>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "gpu/core_engine.h"
#include "gpu/cuda/cuda_core.h"
#include "gpu/cuda/device.h"
#include "tests/conformance/engine_cases.h"
#include "tests/gpu/cuda/fault_scenario.h"

namespace voxeld::gpu {
namespace {

using ::testing::HasSubstr;

#if defined(VOXELD_TEST_SIMT)
constexpr uint64_t kEvery = 127;
#else
constexpr uint64_t kEvery = 1;
#endif

uint64_t Number(const char* name, uint64_t otherwise) {
  const char* const text = std::getenv(name);
  return text != nullptr ? std::strtoull(text, nullptr, 10) : otherwise;
}

// The CUDA engine playing the scenario, and the interface through which it calls CUDA.
class CudaPlayer {
 public:
  CudaPlayer(const cuda::FaultPlan& faults, const cuda::Tuning& tuning)
      : fails_at_(faults.call), player_({"cuda", [&](const EngineOptions& options) {
                                           return Make(options, faults, tuning);
                                         }}) {}

  absl::Status Do(const FaultStep& step) { return player_.Do(step); }
  const Seen& seen() const { return player_.seen(); }
  cuda::Api& api() { return *api_; }
  bool has_failed() const { return api_->calls() >= fails_at_; }
  uint64_t fails_at() const { return fails_at_; }

 private:
  absl::StatusOr<std::unique_ptr<Engine>> Make(const EngineOptions& options,
                                               const cuda::FaultPlan& faults,
                                               const cuda::Tuning& tuning) {
    absl::StatusOr<std::unique_ptr<cuda::Device>> device = cuda::Device::Open(0);
    if (!device.ok()) return device.status();
    api_ = &(*device)->api();
    api_->SetFaults(faults);
    return std::make_unique<CoreEngine<cuda::CudaCore>>(
        options, EngineInfo{EngineKind::kCuda, api_->device().name, "a test"},
        std::make_unique<cuda::CudaCore>(*std::move(device), SlicePart{}, tuning));
  }

  const uint64_t fails_at_;
  cuda::Api* api_ = nullptr;  // declared before the player, whose construction sets it
  FaultPlayer player_;
};

// How the engine draws: in the short way, or with hardly any room for lists, so that batches are
// deferred, merged and drawn in passes; and with which tuning.
struct Way {
  std::string name;
  uint64_t every;  // at least every n-th of its calls fails, in turn
  cuda::Tuning tuning;
  uint64_t scene = 0;  // 0: that of FaultScenario; otherwise the seed of a RandomFaultScenario
};
void PrintTo(const Way& way, std::ostream* out) { *out << way.name; }
const Way kWays[] = {
    {"plain", kEvery, {.compile_formulas = cuda::CompileFormulas::kNever}},
    {"passes",
     kEvery == 1 ? 11 : 2 * kEvery,
     {.few_items = 0,
      .group_bytes = 1,
      .few_lines = 0,
      .few_points = 0,
      .points_each = 1,
      .index_bytes = 1 << 16,
      .compile_formulas = cuda::CompileFormulas::kNever}},
#if !defined(VOXELD_TEST_SIMT)
    // With formulas that are compiled: fewer faults, since each run compiles them again.
    {"formulas", 29, {.compile_formulas = cuda::CompileFormulas::kAtOnce}},
#endif
    // The device moves layers of solids, however few.
    {"crowds",
     kEvery == 1 ? 7 : 2 * kEvery,
     {.least_crowd = 2, .compile_formulas = cuda::CompileFormulas::kNever}}};

// Nine random scenarios beside the one that is written out; one where a CPU plays the GPU.
std::vector<Way> ByChance() {
  std::vector<Way> ways;
  for (const uint64_t seed : kFaultSeeds) {
    if (kEvery > 1 && ways.size() == 1) break;
    ways.push_back({"scene_" + std::to_string(seed),
                    kEvery,
                    {.compile_formulas = cuda::CompileFormulas::kNever},
                    seed});
  }
  return ways;
}

class CudaFaults : public ::testing::TestWithParam<Way> {
 protected:
  // Records what the CPU engine leaves after each step, and how many calls of CUDA the CUDA engine
  // makes when none fails.
  void SetUp() override {
    FaultPlayer cpu(conformance::CaseOf("cpu", EngineKind::kCpu, false));
    for (const FaultStep& step : steps_) {
      ASSERT_TRUE(cpu.Do(step).ok()) << step.name;
      wanted_.push_back(cpu.seen());
    }
    CudaPlayer cuda({}, GetParam().tuning);
    for (size_t s = 0; s < steps_.size(); ++s) {
      const absl::Status status = cuda.Do(steps_[s]);
      ASSERT_TRUE(status.ok()) << steps_[s].name << ": " << status;
      ExpectSeen(cuda, s, true);
    }
    calls_ = cuda.api().calls();
    std::cout << calls_ << " calls of CUDA, of which every " << every_ << "th fails once\n";
    ASSERT_GT(calls_, 100u);
    ASSERT_LT(calls_, 3000u) << "too many to fail each of them";
  }

  void ExpectSeen(const CudaPlayer& cuda, size_t step, bool with_numbers) const {
    const Seen &got = cuda.seen(), &want = wanted_[step];
    if (steps_[step].kind == FaultStep::Kind::kVoxels) {
      EXPECT_TRUE(got.voxels == want.voxels) << steps_[step].name;
    }
    if (steps_[step].kind != FaultStep::Kind::kFrame) return;
    EXPECT_TRUE(got.pictures == want.pictures) << steps_[step].name;
    EXPECT_EQ(got.lit_voxels, want.lit_voxels) << steps_[step].name;
    EXPECT_EQ(got.singular_drawables, want.singular_drawables) << steps_[step].name;
    if (with_numbers) {
      EXPECT_TRUE(got.changed_in == want.changed_in) << steps_[step].name;
    }
  }

  // The number of calls differs by a few from run to run: the last few need not occur.
  bool Must(const CudaPlayer& cuda) const { return cuda.fails_at() + 4 <= calls_; }

  // Runs `play` with each call failing in turn, until a test has failed.
  void ForEachCall(const cuda::FaultPlan& plan, const std::function<void(CudaPlayer&)>& play) {
    const uint64_t first = 1 + Number("VOXELD_SEED", 0) % every_;
    for (uint64_t call = first; call <= calls_ && !HasFailure(); call += every_) {
      SCOPED_TRACE("call " + std::to_string(call) + " of CUDA fails");
      cuda::FaultPlan faults = plan;
      faults.call = call;
      CudaPlayer cuda(faults, GetParam().tuning);
      play(cuda);
    }
  }

  // Draws the last scene, from nothing, in an engine with any history.
  void ExpectUsable(CudaPlayer& cuda) const {
    FaultStep target = steps_.back(), whole = steps_.back();
    target.kind = FaultStep::Kind::kTarget;
    whole.kind = FaultStep::Kind::kApply;
    whole.delta.PutWhole(whole.scene);
    for (const FaultStep& step : {target, whole, steps_.back()}) {
      const absl::Status status = cuda.Do(step);
      ASSERT_TRUE(status.ok()) << status;
    }
    ExpectSeen(cuda, steps_.size() - 1, false);
  }

  const std::vector<FaultStep> steps_ =
      GetParam().scene == 0 ? FaultScenario() : RandomFaultScenario(GetParam().scene);
  std::vector<Seen> wanted_;
  const uint64_t every_ = std::max<uint64_t>(1, Number("VOXELD_FAULTS_EVERY", GetParam().every));
  uint64_t calls_ = 0;
};

constexpr cuda::FaultPlan kNoMemoryOnce = {1, cudaErrorMemoryAllocation, false};
constexpr cuda::FaultPlan kNoMemoryFromThen = {1, cudaErrorMemoryAllocation, true};
constexpr cuda::FaultPlan kIllegalFromThen = {1, cudaErrorIllegalAddress, true};

TEST_P(CudaFaults, WantOfMemoryRefusesACallThatSucceedsWhenItIsMadeAgain) {
  int refused = 0;
  ForEachCall(kNoMemoryOnce, [&](CudaPlayer& cuda) {
    int refused_here = 0;
    for (size_t s = 0; s < steps_.size(); ++s) {
      absl::Status status = cuda.Do(steps_[s]);
      if (!status.ok()) {
        ++refused_here;
        EXPECT_EQ(status.code(), absl::StatusCode::kResourceExhausted) << status;
        EXPECT_THAT(status.message(), HasSubstr("out of memory"));
        status = cuda.Do(steps_[s]);
      }
      ASSERT_TRUE(status.ok()) << steps_[s].name << ": " << status;
      ExpectSeen(cuda, s, true);
    }
    EXPECT_TRUE(cuda.has_failed() || !Must(cuda));
    EXPECT_LE(refused_here, 1);
    refused += refused_here;
  });
  EXPECT_GT(static_cast<uint64_t>(refused) * every_, calls_ / 9);
}

// A refused frame is left out; what it would have shown is in the next one.
TEST_P(CudaFaults, WantOfMemoryCostsAFrameNotTheNext) {
  int left_out = 0;
  ForEachCall(kNoMemoryOnce, [&](CudaPlayer& cuda) {
    for (size_t s = 0; s < steps_.size(); ++s) {
      absl::Status status = cuda.Do(steps_[s]);
      const bool looks =
          steps_[s].kind == FaultStep::Kind::kFrame || steps_[s].kind == FaultStep::Kind::kVoxels;
      if (!status.ok() && looks && s + 1 < steps_.size()) {
        EXPECT_EQ(status.code(), absl::StatusCode::kResourceExhausted) << status;
        ++left_out;
        continue;
      }
      if (!status.ok()) status = cuda.Do(steps_[s]);
      ASSERT_TRUE(status.ok()) << steps_[s].name << ": " << status;
      ExpectSeen(cuda, s, false);
    }
    EXPECT_TRUE(cuda.has_failed() || !Must(cuda));
  });
  EXPECT_GT(static_cast<uint64_t>(left_out) * every_, calls_ / 9);
}

TEST_P(CudaFaults, WantOfMemoryThatLastsRefusesAndEndsWithIt) {
  ForEachCall(kNoMemoryFromThen, [&](CudaPlayer& cuda) {
    int refused = 0;
    for (const FaultStep& step : steps_) {
      const absl::Status status = cuda.Do(step);
      if (status.ok()) continue;
      ++refused;
      // After a refused delta or target, later steps may not fit the scene.
      EXPECT_TRUE(
          absl::IsResourceExhausted(status) ||
          (refused > 1 && (absl::IsInvalidArgument(status) || absl::IsFailedPrecondition(status))))
          << step.name << ": " << status;
    }
    EXPECT_TRUE(refused > 0 || !Must(cuda));
    cuda.api().SetFaults({});
    ExpectUsable(cuda);
  });
}

TEST_P(CudaFaults, AnIllegalAddressLosesTheEngineForGood) {
  ForEachCall(kIllegalFromThen, [&](CudaPlayer& cuda) {
    bool lost = false;
    for (const FaultStep& step : steps_) {
      const uint64_t before = cuda.api().calls();
      const absl::Status status = cuda.Do(step);
      if (lost) {
        EXPECT_EQ(cuda.api().calls(), before) << "a lost engine calls CUDA: " << step.name;
      } else if (status.ok()) {
        continue;
      }
      lost = true;
      EXPECT_EQ(status.code(), absl::StatusCode::kDataLoss) << step.name << ": " << status;
      EXPECT_THAT(status.message(), HasSubstr("cudaErrorIllegalAddress"));
    }
    EXPECT_TRUE(lost || !Must(cuda));
  });
}

INSTANTIATE_TEST_SUITE_P(Ways, CudaFaults, testing::ValuesIn(kWays),
                         [](const auto& way) { return way.param.name; });
INSTANTIATE_TEST_SUITE_P(ByChance, CudaFaults, testing::ValuesIn(ByChance()),
                         [](const auto& way) { return way.param.name; });

}  // namespace
}  // namespace voxeld::gpu
