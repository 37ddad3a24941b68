// The stand-in for voxeld-engine fails on request, and only then.
#include <gmock/gmock.h>

#include <string>

#include "tests/conformance/engine_driver.h"
#include "tests/conformance/oracle.h"
#include "tests/conformance/scene_generator.h"
#include "tests/gpu/worker/fault_environment.h"
#include "tests/programs.h"

namespace voxeld::gpu {
namespace {

using ::testing::HasSubstr;

constexpr uint32_t kPoison = 0xBADBAD;

class FaultyEngineProgram : public ::testing::Test {
 protected:
  static conformance::EngineDriver Make(const FaultEnvironment::Fault& fault,
                                        EngineKind kind = EngineKind::kCuda) {
    const FaultEnvironment environment(fault);
    EngineOptions options;
    options.kind = kind;
    options.threads = 1;
    options.in_worker = true;
    options.worker = ProgramBeside("faulty_engine");
    options.worker_deadline_ns = 20'000'000'000;
    return {{"faulty", [](const EngineOptions& o) { return CreateEngine(o); }}, options};
  }

  static conformance::DeltaBuffer Poison(DrawnBy drawn_by = DrawnBy::kEngine) {
    conformance::ModelGeometry dot;
    dot.record.id = 1'000'000;
    dot.record.color = kPoison;
    dot.record.vertex_count = 1;
    dot.record.drawn_by = drawn_by;
    dot.positions = {1.5, 1.5, 1.5};
    conformance::DeltaBuffer delta;
    delta.Put(dot);
    return delta;
  }

  conformance::SceneGenerator generator_{11};
  const Target target_ = generator_.RandomTarget();
  const conformance::SceneModel scene_ = generator_.RandomScene(30);
};

TEST_F(FaultyEngineProgram, IsTheCpuByAnotherNameWhenCudaIsAskedFor) {
  conformance::EngineDriver engine = Make({});
  EXPECT_EQ(engine.engine().info().kind, EngineKind::kCuda);
  EXPECT_EQ(engine.engine().info().device, "a GPU that faults");
  conformance::DeltaBuffer delta;
  delta.PutWhole(scene_);
  ASSERT_TRUE(engine.SetTarget(target_).ok());
  ASSERT_TRUE(engine.Apply(delta).ok());
  for (int frame = 0; frame < 3; ++frame) ASSERT_TRUE(engine.Frame().ok());
  const conformance::DenseVolume want = conformance::OracleVoxels(scene_, target_);
  EXPECT_TRUE(engine.pictures() == conformance::OraclePictures(want, target_));

  conformance::EngineDriver cpu = Make({}, EngineKind::kCpu);
  EXPECT_EQ(cpu.engine().info().kind, EngineKind::kCpu);
  EXPECT_THAT(cpu.engine().info().device, HasSubstr("CPU"));
}

TEST_F(FaultyEngineProgram, FailsWhileTheColourIsInItsScene) {
  for (const char* kind : {"crash", "exit", "dataloss"}) {
    SCOPED_TRACE(kind);
    conformance::EngineDriver engine = Make({.color = "BADBAD", .kind = kind});
    ASSERT_TRUE(engine.SetTarget(target_).ok());
    ASSERT_TRUE(engine.Frame().ok());
    ASSERT_TRUE(engine.Apply(Poison()).ok());
    const absl::Status lost = engine.Frame().status();
    EXPECT_EQ(lost.code(), absl::StatusCode::kDataLoss);
    EXPECT_THAT(lost.message(),
                HasSubstr(std::string(kind) == "dataloss" ? "a fault that was asked for"
                                                          : "the worker was lost"));
    EXPECT_EQ(engine.SetTarget(target_).code(), absl::StatusCode::kDataLoss);
  }
}

TEST_F(FaultyEngineProgram, DrawsOnOnceTheColourHasGone) {
  conformance::EngineDriver engine = Make({.color = "BADBAD", .kind = "crash"});
  ASSERT_TRUE(engine.SetTarget(target_).ok());
  ASSERT_TRUE(engine.Apply(Poison()).ok());
  conformance::DeltaBuffer drop;
  drop.Drop(Op::kDropGeometry, 1'000'000);
  ASSERT_TRUE(engine.Apply(drop).ok());
  ASSERT_TRUE(engine.Frame().ok());
  ASSERT_TRUE(engine.Apply(Poison()).ok());
  conformance::DeltaBuffer reset;
  reset.Reset();
  ASSERT_TRUE(engine.Apply(reset).ok());
  ASSERT_TRUE(engine.Frame().ok());
  // A refused geometry is not in the scene.
  conformance::DeltaBuffer refused = Poison();
  refused.Drop(Op::kDropDrawable, 77);
  EXPECT_EQ(engine.Apply(refused).code(), absl::StatusCode::kInvalidArgument);
  ASSERT_TRUE(engine.Frame().ok());
  // Nor does the GPU draw what the CPU is to draw.
  ASSERT_TRUE(engine.Apply(Poison(DrawnBy::kCpu)).ok());
  EXPECT_TRUE(engine.Frame().ok());
}

}  // namespace
}  // namespace voxeld::gpu
