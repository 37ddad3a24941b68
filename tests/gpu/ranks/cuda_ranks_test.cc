// Tests one display over two GPUs of this machine, linked by NCCL (VOXELD_NCCL says where it is, if
// the loader does not find it): it gives the bytes of one GPU and of the CPU; and what happens when
// one of them is lost, or is out of memory.
#include <cuda_runtime_api.h>
#include <gmock/gmock.h>
#include <unistd.h>

#include <algorithm>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <future>
#include <iostream>
#include <memory>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "display/geometry/footprint.h"
#include "display/sync/clock.h"
#include "tests/conformance/engine_driver.h"
#include "tests/conformance/scene_generator.h"
#include "tests/programs.h"

namespace voxeld::gpu {
namespace {

using conformance::DeltaBuffer;
using conformance::EngineDriver;
using conformance::SceneGenerator;
using conformance::SceneModel;
using ::testing::HasSubstr;

constexpr int kSize = 24;
constexpr int64_t kDeadline = 30 * sync::kSecond;

EngineDriver Drive(const EngineOptions& options) {
  return {{"engine", [](const EngineOptions& o) { return CreateEngine(o); }}, options};
}

EngineDriver TwoGpus(const char* worker = "") {
  EngineOptions options;
  options.kind = EngineKind::kCuda;
  options.devices = {0, 1};
  options.worker_deadline_ns = kDeadline;
  if (*worker != '\0') options.worker = ProgramBeside(worker);
  return Drive(options);
}

EngineDriver Cpu() { return Drive({.kind = EngineKind::kCpu}); }

Target Cube(int32_t n) {
  display::PlanarStack stack;
  stack.width_px = stack.height_px = n;
  for (int32_t i = 0; i < n; ++i) stack.positions_mm.push_back(i - (n - 1) * 0.5);
  Target target;
  target.geometry.shape = stack;
  target.geometry.grid = display::DefaultGrid(target.geometry);
  target.layout = {
      .slices = n, .width = n, .height = n, .format = display::PixelFormat::kBitPlanes};
  target.tone.SetCurve(display::Tone::Linear());
  return target;
}

// Inserts `count` lines anywhere in n³ voxels, with colours along them: 32 bytes a line.
void PutLines(DeltaBuffer& delta, uint64_t id, uint32_t count, int32_t n, uint32_t seed) {
  std::mt19937 random(seed);
  conformance::ModelGeometry lines;
  lines.record.id = id;
  lines.record.kind = PrimitiveKind::kSegments;
  lines.record.color_mode = ColorMode::kPerVertex;
  lines.record.vertex_count = 2 * count;
  for (uint32_t i = 0; i < 6 * count; ++i) {
    lines.positions.push_back(static_cast<float>(random() % (static_cast<uint32_t>(n) * 256)) /
                              256);
  }
  for (uint32_t i = 0; i < 2 * count; ++i) lines.colors.push_back(random() & 0xFFFFFF);
  delta.Put(lines);
}

class CudaRanks : public ::testing::Test {
 protected:
  CudaRanks() {
    setenv("VOXELD_FAULT_FILE", file_.c_str(), 1);
    int count = 0;
    EXPECT_EQ(cudaGetDeviceCount(&count), cudaSuccess);
    EXPECT_GE(count, 2) << "this test needs two GPUs";
  }
  ~CudaRanks() override { unsetenv("VOXELD_FAULT_FILE"); }

  void FailOneRank(const std::string& kind) const {
    std::ofstream(file_ + ".next") << kind;
    std::filesystem::rename(file_ + ".next", file_);
  }

  const std::string file_ = (std::filesystem::path(::testing::TempDir()) /
                             ("voxeld_cuda_ranks_" + std::to_string(getpid())))
                                .string();
};

// Compares what the engines show for the same scene, frame by frame.
void ExpectSame(EngineDriver& ranks, std::vector<EngineDriver*> others) {
  const absl::StatusOr<FrameResult> got = ranks.Frame();
  ASSERT_TRUE(got.ok()) << got.status();
  const std::vector<uint32_t> voxels = ranks.Voxels();
  for (EngineDriver* other : others) {
    const absl::StatusOr<FrameResult> want = other->Frame();
    ASSERT_TRUE(want.ok()) << want.status();
    ASSERT_TRUE(ranks.pictures() == other->pictures());
    ASSERT_EQ(ranks.changed_in(), other->changed_in());
    ASSERT_TRUE(voxels == other->Voxels());
    EXPECT_EQ(got->lit_voxels, want->lit_voxels);
    EXPECT_EQ(got->changed, want->changed);
  }
}

TEST_F(CudaRanks, ShowWhatOneGpuAndTheCpuShow) {
  EngineDriver ranks = TwoGpus();
  EXPECT_THAT(ranks.engine().info().reason, HasSubstr("to the others by NCCL"));
  std::cout << ranks.engine().info().device << "; " << ranks.engine().info().reason << "\n";
  EngineDriver one = Drive({.kind = EngineKind::kCuda, .device = 1});
  EngineDriver cpu = Cpu();
  for (uint64_t seed = 0; seed < 40; ++seed) {
    SCOPED_TRACE(seed);
    SceneGenerator generator(seed);
    const Target target = generator.RandomTarget();
    SceneModel scene = generator.RandomScene(kSize);
    for (EngineDriver* engine : {&ranks, &one, &cpu}) {
      DeltaBuffer delta;
      delta.Reset();
      delta.PutWhole(scene);
      ASSERT_TRUE(engine->SetTarget(target).ok());
      ASSERT_TRUE(engine->Apply(delta).ok());
    }
    ExpectSame(ranks, {&one, &cpu});
    for (int step = 0; step < 5; ++step) {
      DeltaBuffer delta;
      generator.Change(scene, kSize, delta);
      for (EngineDriver* engine : {&ranks, &one, &cpu}) ASSERT_TRUE(engine->Apply(delta).ok());
      ExpectSame(ranks, {&one, &cpu});
    }
  }
}

// Deltas above and below the size from which they are broadcast, and of several pieces.
TEST_F(CudaRanks, LargeDeltasReachBoth) {
  constexpr int32_t kCube = 128;
  EngineDriver ranks = TwoGpus();
  EngineDriver cpu = Cpu();
  const Target target = Cube(kCube);
  uint64_t id = 0;
  for (EngineDriver* engine : {&ranks, &cpu}) ASSERT_TRUE(engine->SetTarget(target).ok());
  DeltaBuffer layer;
  layer.Put(LayerRecord{.id = 1});
  for (EngineDriver* engine : {&ranks, &cpu}) ASSERT_TRUE(engine->Apply(layer).ok());
  for (const uint32_t lines : {1u, 30'000u, 32'768u, 40'000u, 131'072u, 300'000u}) {
    SCOPED_TRACE(lines);
    DeltaBuffer delta;
    if (id > 0) {
      delta.Drop(Op::kDropDrawable, id);
      delta.Drop(Op::kDropGeometry, id);
    }
    ++id;
    PutLines(delta, id, lines, kCube, lines);
    delta.Put(DrawableRecord{.id = id, .geometry = id, .layer = 1});
    for (EngineDriver* engine : {&ranks, &cpu}) {
      const absl::Status applied = engine->Apply(delta);
      ASSERT_TRUE(applied.ok()) << applied;
    }
    ExpectSame(ranks, {&cpu});
  }
}

// Another process holds all but a little of the second GPU's memory.
TEST_F(CudaRanks, WithoutMemoryOnOneGpuADeltaIsRefusedByBoth) {
  constexpr int32_t kCube = 64;
  constexpr uint32_t kManyLines = 20'000'000;  // 640 MB
  EngineDriver ranks = TwoGpus();
  ASSERT_TRUE(ranks.SetTarget(Cube(kCube)).ok());
  DeltaBuffer few;
  few.Put(LayerRecord{.id = 1});
  PutLines(few, 1, 1000, kCube, 1);
  few.Put(DrawableRecord{.id = 1, .geometry = 1, .layer = 1});
  ASSERT_TRUE(ranks.Apply(few).ok());
  ASSERT_TRUE(ranks.Frame().ok());
  const std::vector<std::byte> before = ranks.pictures();
  DeltaBuffer many;
  PutLines(many, 2, kManyLines, kCube, 2);
  ASSERT_EQ(cudaSetDevice(1), cudaSuccess);
  size_t free_bytes = 0, all_bytes = 0;
  ASSERT_EQ(cudaMemGetInfo(&free_bytes, &all_bytes), cudaSuccess);
  void* taken = nullptr;
  ASSERT_EQ(cudaMalloc(&taken, free_bytes - (size_t{300} << 20)), cudaSuccess);
  const absl::Status refused = ranks.Apply(many);
  EXPECT_EQ(refused.code(), absl::StatusCode::kResourceExhausted) << refused;
  const absl::StatusOr<FrameResult> frame = ranks.Frame();
  ASSERT_TRUE(frame.ok()) << frame.status();
  EXPECT_FALSE(frame->changed);
  EXPECT_TRUE(ranks.pictures() == before);
  ASSERT_EQ(cudaFree(taken), cudaSuccess);
  const absl::Status taken_in = ranks.Apply(many);
  EXPECT_TRUE(taken_in.ok()) << taken_in;
}

TEST_F(CudaRanks, ALostOneTakesTheOtherAlongAndTheNextDrawTheSame) {
  SceneGenerator generator(21);
  const Target target = generator.RandomTarget();
  const SceneModel scene = generator.RandomScene(kSize);
  EngineDriver cpu = Cpu();
  DeltaBuffer delta;
  delta.PutWhole(scene);
  ASSERT_TRUE(cpu.SetTarget(target).ok());
  ASSERT_TRUE(cpu.Apply(delta).ok());
  ASSERT_TRUE(cpu.Frame().ok());
  for (const char* kind : {"illegal", "crash"}) {
    SCOPED_TRACE(kind);
    EngineDriver ranks = TwoGpus("faulty_cuda_engine");
    ASSERT_TRUE(ranks.SetTarget(target).ok());
    ASSERT_TRUE(ranks.Apply(delta).ok());
    ASSERT_TRUE(ranks.Frame().ok());
    EXPECT_TRUE(ranks.pictures() == cpu.pictures());
    FailOneRank(kind);
    const absl::Status lost = ranks.Frame().status();
    EXPECT_EQ(lost.code(), absl::StatusCode::kDataLoss) << lost;
    std::cout << lost << "\n";
    EXPECT_EQ(ranks.Frame().status().code(), absl::StatusCode::kDataLoss);
  }
}

// Returns the processes that this one has started, and which have not exited.
std::vector<pid_t> Children() {
  std::vector<pid_t> children;
  for (const auto& entry : std::filesystem::directory_iterator("/proc")) {
    const std::string name = entry.path().filename().string();
    if (name.find_first_not_of("0123456789") != std::string::npos) continue;
    std::ifstream in(entry.path() / "stat");
    std::string stat;
    std::getline(in, stat);
    char state = 0;
    int parent = 0;
    const size_t end = stat.rfind(')');
    if (end == std::string::npos) continue;
    if (std::sscanf(stat.c_str() + end + 1, " %c %d", &state, &parent) != 2) continue;
    if (parent == getpid() && state != 'Z') children.push_back(std::stoi(name));
  }
  std::sort(children.begin(), children.end());
  return children;
}

// Killed while both take part in a broadcast: the other does not wait for it.
TEST_F(CudaRanks, AKilledOneHoldsNobodyUp) {
  const sync::SystemClock clock;
  constexpr int32_t kCube = 64;
  for (const bool first : {true, false}) {
    const std::vector<pid_t> before = Children();
    EngineDriver ranks = TwoGpus();
    ASSERT_TRUE(ranks.SetTarget(Cube(kCube)).ok());
    std::vector<pid_t> own;
    for (const pid_t child : Children()) {
      if (!std::binary_search(before.begin(), before.end(), child)) own.push_back(child);
    }
    ASSERT_EQ(own.size(), 2u);
    DeltaBuffer delta;
    PutLines(delta, 1, 4'000'000, kCube, 1);
    auto block = ranks.engine().AcquireStaging(delta.bytes().size());
    ASSERT_TRUE(block.ok());
    std::copy(delta.bytes().begin(), delta.bytes().end(), block->bytes().begin());
    block->Refer(delta.referred());
    std::promise<absl::Status> answer;
    const sync::TimeNs start = clock.Now();
    ranks.engine().Apply(*std::move(block), delta.bytes().size(),
                         [&](absl::Status status) { answer.set_value(std::move(status)); });
    ASSERT_EQ(kill(first ? own.front() : own.back(), SIGKILL), 0);
    const absl::Status status = answer.get_future().get();
    EXPECT_EQ(status.code(), absl::StatusCode::kDataLoss) << status;
    EXPECT_EQ(ranks.Frame().status().code(), absl::StatusCode::kDataLoss);
    EXPECT_LT(clock.Now() - start, kDeadline / 3) << "a rank waited for the deadline";
  }
}

}  // namespace
}  // namespace voxeld::gpu
