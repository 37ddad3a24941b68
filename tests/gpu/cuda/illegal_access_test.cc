// Tests a kernel that really writes to an illegal address: what the engine's owner sees, and that
// the next worker is unaffected.
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

class IllegalAccess : public ::testing::Test {
 protected:
  IllegalAccess() {
    poison_.record.id = 1'000'000;
    poison_.record.color = 0xBADBAD;
    poison_.record.vertex_count = 1;
    poison_.positions = {1.5, 1.5, 1.5};
  }

  static conformance::EngineDriver Make(const FaultEnvironment::Fault& fault) {
    const FaultEnvironment environment(fault);
    EngineOptions options;
    options.kind = EngineKind::kCuda;
    options.worker = ProgramBeside("faulty_cuda_engine");
    options.worker_deadline_ns = 30'000'000'000;
    return {{"faulty", [](const EngineOptions& o) { return CreateEngine(o); }}, options};
  }

  void ExpectLost(conformance::EngineDriver& engine) const {
    const absl::Status lost = engine.Frame().status();
    EXPECT_EQ(lost.code(), absl::StatusCode::kDataLoss);
    EXPECT_THAT(lost.message(), HasSubstr("cudaErrorIllegalAddress"));
    EXPECT_EQ(engine.Frame().status().code(), absl::StatusCode::kDataLoss);
    EXPECT_EQ(engine.SetTarget(target_).code(), absl::StatusCode::kDataLoss);
    conformance::DeltaBuffer reset;
    reset.Reset();
    EXPECT_EQ(engine.Apply(reset).code(), absl::StatusCode::kDataLoss);
  }

  void GiveScene(conformance::EngineDriver& engine) const {
    ASSERT_EQ(engine.engine().info().kind, EngineKind::kCuda);
    conformance::DeltaBuffer whole;
    whole.PutWhole(scene_);
    ASSERT_TRUE(engine.SetTarget(target_).ok());
    ASSERT_TRUE(engine.Apply(whole).ok());
  }

  void ExpectDraws(conformance::EngineDriver& engine) const {
    const absl::StatusOr<FrameResult> frame = engine.Frame();
    ASSERT_TRUE(frame.ok()) << frame.status();
    const conformance::DenseVolume want = conformance::OracleVoxels(scene_, target_);
    EXPECT_TRUE(engine.pictures() == conformance::OraclePictures(want, target_));
  }

  conformance::SceneGenerator generator_{21};
  const Target target_ = generator_.RandomTarget();
  const conformance::SceneModel scene_ = generator_.RandomScene(30);
  conformance::ModelGeometry poison_;
};

TEST_F(IllegalAccess, LosesTheEngineAndNotTheNextOne) {
  conformance::EngineDriver engine = Make({.frame = "3"});
  GiveScene(engine);
  ExpectDraws(engine);
  ExpectDraws(engine);
  ExpectLost(engine);
  conformance::EngineDriver next = Make({});
  GiveScene(next);
  for (int frame = 0; frame < 4; ++frame) ExpectDraws(next);
}

TEST_F(IllegalAccess, OfOneGeometryLosesEveryEngineThatHasIt) {
  for (int attempt = 0; attempt < 2; ++attempt) {
    conformance::EngineDriver engine = Make({.color = "BADBAD"});
    GiveScene(engine);
    ExpectDraws(engine);
    conformance::DeltaBuffer delta;
    delta.Put(poison_);
    ASSERT_TRUE(engine.Apply(delta).ok());
    ExpectLost(engine);
  }
  conformance::EngineDriver without = Make({.color = "BADBAD"});
  GiveScene(without);
  ExpectDraws(without);
}

// One GPU, two processes: the engine of the other one continues to draw.
TEST_F(IllegalAccess, LeavesOtherWorkersAlone) {
  conformance::EngineDriver good = Make({}), bad = Make({.frame = "1"});
  GiveScene(good);
  GiveScene(bad);
  ExpectDraws(good);
  ExpectLost(bad);
  ExpectDraws(good);
}

}  // namespace
}  // namespace voxeld::gpu
