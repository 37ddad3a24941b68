// Tests geometries in bulk memory: engines read them in place, and hold them as long as they exist.
#include <gmock/gmock.h>

#include <algorithm>
#include <memory>
#include <utility>
#include <vector>

#include "gpu/bulk/bulk_pool.h"
#include "gpu/geometry_arrays.h"
#include "gpu/worker/bulk_ledger.h"
#include "tests/conformance/conformance_test.h"

namespace voxeld::gpu::conformance {
namespace {

using testing::HasSubstr;

class EngineBulk : public EngineConformance {};
INSTANTIATE_TEST_SUITE_P(Engines, EngineBulk, testing::ValuesIn(EngineCases()),
                         [](const auto& info) { return info.param.name; });

constexpr uint32_t kDots = 200;

std::shared_ptr<BulkPool> MakePool(bool shared = true) {
  return BulkPool::Create({.segment_bytes = 8192, .keep_bytes = 0, .shared = shared});
}

GeometryRecord Record(uint64_t id) {
  GeometryRecord record;
  record.id = id;
  record.kind = PrimitiveKind::kPoints;
  record.vertex_count = kDots;
  record.thickness = 3;
  return record;
}

std::vector<float> Positions(uint64_t seed) {
  SceneGenerator generator(seed);
  std::vector<float> positions(3 * kDots);
  for (float& value : positions) value = static_cast<float>(generator.Real(-1, 1));
  return positions;
}

// A delta, and the bulk memory that it refers to.
struct Bulk {
  template <typename Write>
  Bulk(size_t size, Write&& write) : bytes(size) {
    DeltaWriter writer(bytes);
    write(writer);
    EXPECT_EQ(writer.size(), size);
    referred = writer.TakeReferred();
  }
  std::vector<std::byte> bytes;
  std::vector<BulkBlock> referred;
};

const LayerRecord kLayer{.id = 1};

DrawableRecord DrawableOf(uint64_t geometry) {
  return {.id = geometry, .geometry = geometry, .layer = 1};
}

// Inserts dots, and the drawable that shows them; `arrays` are in bulk memory or not.
Bulk Put(uint64_t id, const GeometryArrays& arrays) {
  const GeometryRecord record = Record(id);
  const size_t size =
      arrays.block() ? DeltaWriter::kSizeOfBulkGeometry : DeltaWriter::SizeOf(record);
  return Bulk(size + DeltaWriter::SizeOf(kLayer) + DeltaWriter::SizeOf(DrawableOf(id)),
              [&](DeltaWriter& writer) {
                writer.PutLayer(kLayer);
                if (arrays.block()) {
                  writer.PutGeometry(record, arrays.block());
                } else {
                  writer.PutGeometry(record, arrays.positions(), {}, {});
                }
                writer.PutDrawable(DrawableOf(id));
              });
}

Bulk Drop(uint64_t id) {
  return Bulk(2 * DeltaWriter::kSizeOfId, [&](DeltaWriter& writer) {
    writer.Drop(Op::kDropDrawable, id);
    writer.Drop(Op::kDropGeometry, id);
  });
}

GeometryArrays InPool(BulkPool& pool, uint64_t id) {
  GeometryArrays arrays = *GeometryArrays::Allocate(Record(id), &pool);
  EXPECT_TRUE(arrays.block());
  std::ranges::copy(Positions(id), arrays.writable_positions().begin());
  return arrays;
}

// Overwrites every free place.
void Spoil(BulkPool& pool) {
  std::vector<BulkBlock> blocks;
  for (int i = 0; i < 50; ++i) {
    BulkPool::Fresh fresh = *pool.Allocate(1024);
    std::ranges::fill(fresh.bytes, std::byte{0x3F});
    blocks.push_back(std::move(fresh.block));
  }
}

Target SmallTarget(uint64_t seed) {
  SceneGenerator generator(seed);
  Target target = generator.RandomTarget();
  target.view = Affine();
  const display::VoxelGrid& grid = target.geometry.grid;
  const double size[3] = {double(grid.nx), double(grid.ny), double(grid.nz)};
  for (int axis = 0; axis < 3; ++axis) {
    target.view.m[5 * axis] = size[axis] / 2;
    target.view.m[4 * axis + 3] = size[axis] / 2;
  }
  return target;
}

TEST_P(EngineBulk, BulkMemoryIsHeldUntilItsGeometryIsDropped) {
  const auto pool = MakePool();
  EngineDriver engine = Make(), other = Make();
  const GeometryArrays plain = GeometryArrays::Of(Record(1), Positions(1));
  ASSERT_TRUE(other.ApplyBytes(Put(1, plain).bytes).ok());
  {
    Bulk put = Put(1, InPool(*pool, 1));
    ASSERT_TRUE(engine.ApplyBytes(put.bytes, std::move(put.referred)).ok());
  }
  for (uint64_t seed = 1; seed <= 3; ++seed) {  // everything is drawn again from what the engine
                                                // holds
    const Target target = SmallTarget(seed);
    ASSERT_TRUE(engine.SetTarget(target).ok() && other.SetTarget(target).ok());
    Spoil(*pool);
    const absl::StatusOr<FrameResult> frame = engine.Frame();
    ASSERT_TRUE(frame.ok() && other.Frame().ok());
    EXPECT_GT(frame->lit_voxels, 0u);
    EXPECT_TRUE(engine.Voxels() == other.Voxels());
    EXPECT_TRUE(engine.pictures() == other.pictures());
  }
  ASSERT_TRUE(engine.ApplyBytes(Drop(1).bytes).ok());
  ASSERT_EQ(engine.Frame().status(), absl::OkStatus());
  EXPECT_EQ(pool->used_bytes(), 0u);
  EXPECT_EQ(pool->held_bytes(), 0u);
}

TEST_P(EngineBulk, BulkMemoryComesAndGoes) {
  const auto pool = MakePool();
  EngineDriver engine = Make(), other = Make();
  const Target target = SmallTarget(4);
  ASSERT_TRUE(engine.SetTarget(target).ok() && other.SetTarget(target).ok());
  SceneGenerator generator(SeedOr(5));
  std::vector<uint64_t> there;
  uint64_t most = 0;
  for (uint64_t id = 1; id <= 120; ++id) {
    if (there.size() > 10 || (!there.empty() && generator.Chance(0.3))) {
      const size_t at =
          static_cast<size_t>(generator.Int(0, static_cast<int64_t>(there.size()) - 1));
      const Bulk drop = Drop(there[at]);
      ASSERT_TRUE(engine.ApplyBytes(drop.bytes).ok() && other.ApplyBytes(drop.bytes).ok());
      there.erase(there.begin() + static_cast<ptrdiff_t>(at));
    }
    Bulk put = Put(id, InPool(*pool, id));
    ASSERT_TRUE(engine.ApplyBytes(put.bytes, std::move(put.referred)).ok());
    ASSERT_TRUE(
        other.ApplyBytes(Put(id, GeometryArrays::Of(Record(id), Positions(id))).bytes).ok());
    there.push_back(id);
    most = std::max(most, pool->held_bytes());
    if (id % 10 != 0) continue;
    Spoil(*pool);
    ASSERT_TRUE(engine.Frame().ok() && other.Frame().ok());
    ASSERT_TRUE(engine.pictures() == other.pictures()) << id;
  }
  EXPECT_LE(most, 20 * 8192u);  // places are reused
  Bulk reset(DeltaWriter::kSizeOfReset, [](DeltaWriter& writer) { writer.Reset(); });
  ASSERT_TRUE(engine.ApplyBytes(reset.bytes).ok());
  ASSERT_EQ(engine.Frame().status(), absl::OkStatus());
  EXPECT_EQ(pool->held_bytes(), 0u);
}

TEST_P(EngineBulk, BulkMemoryThatDidNotComeAlongIsRefused) {
  const auto pool = MakePool();
  EngineDriver engine = Make();
  ASSERT_TRUE(engine.SetTarget(SmallTarget(1)).ok());
  const GeometryArrays arrays = InPool(*pool, 1);
  const Bulk put = Put(1, arrays);
  EXPECT_EQ(engine.ApplyBytes(put.bytes).code(), absl::StatusCode::kInvalidArgument);
  const GeometryArrays others = InPool(*pool, 2);
  const absl::Status refused = engine.ApplyBytes(put.bytes, {others.block()});
  EXPECT_EQ(refused.code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(std::string(refused.message()), HasSubstr("no block at byte"));
  EXPECT_TRUE(engine.ApplyBytes(put.bytes, {others.block(), arrays.block()}).ok());
}

TEST(BulkInAWorker, MustBeShared) {
  EngineDriver engine(CaseOf("cpu_worker", EngineKind::kCpu, true), {.threads = 1});
  ASSERT_TRUE(engine.SetTarget(SmallTarget(1)).ok());
  const auto pool = MakePool(false);
  Bulk put = Put(1, InPool(*pool, 1));
  const absl::Status refused = engine.ApplyBytes(put.bytes, put.referred);
  EXPECT_EQ(refused.code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(std::string(refused.message()), HasSubstr("of this process alone"));
  put = Put(1, InPool(*MakePool(), 1));
  EXPECT_TRUE(engine.ApplyBytes(put.bytes, put.referred).ok());
  EXPECT_EQ(engine.Frame().status(), absl::OkStatus());
}

// ------------------------------------------------------------------------------------ the ledger

TEST(BulkLedger, HoldsWhatIsReadInPlace) {
  const auto pool = MakePool();
  const auto apply = [](BulkLedger& ledger, const Bulk& delta, bool copies) {
    absl::StatusOr<BulkLedger::Change> change = BulkLedger::ChangeOf(delta.bytes, delta.referred);
    ASSERT_TRUE(change.ok());
    ledger.Apply(*std::move(change), copies);
  };
  BulkLedger in_place, copying;
  for (uint64_t id = 1; id <= 3; ++id) {
    const Bulk put = Put(id, InPool(*pool, id));
    apply(in_place, put, false);
    apply(copying, put, true);
  }
  EXPECT_EQ(in_place.size(), 3u);
  EXPECT_EQ(copying.size(), 0u);
  EXPECT_EQ(pool->used_bytes(), 3 * 2432u);
  apply(in_place, Drop(2), false);
  EXPECT_EQ(pool->used_bytes(), 2 * 2432u);
  apply(in_place, Bulk(DeltaWriter::kSizeOfReset, [](DeltaWriter& w) { w.Reset(); }), false);
  EXPECT_EQ(pool->used_bytes(), 0u);
  // Every engine reads in place the geometries that the CPU draws.
  GeometryRecord record = Record(4);
  record.drawn_by = DrawnBy::kCpu;
  apply(copying,
        Bulk(DeltaWriter::kSizeOfBulkGeometry,
             [&](DeltaWriter& w) { w.PutGeometry(record, InPool(*pool, 4).block()); }),
        true);
  EXPECT_EQ(copying.size(), 1u);
}

TEST(BulkLedger, TakesAnyBytes) {
  const auto pool = MakePool();
  const Bulk put = Put(1, InPool(*pool, 1));
  SceneGenerator generator(SeedOr(9));
  for (int i = 0; i < 2000; ++i) {
    std::vector<std::byte> bytes = put.bytes;
    bytes.resize(static_cast<size_t>(generator.Int(0, static_cast<int64_t>(bytes.size()))));
    for (int n = 0; n < 3 && !bytes.empty(); ++n) {
      const int64_t last = static_cast<int64_t>(bytes.size()) - 1;
      bytes[static_cast<size_t>(generator.Int(0, last))] =
          static_cast<std::byte>(generator.Int(0, 255));
    }
    const auto change = BulkLedger::ChangeOf(bytes, put.referred);
    EXPECT_TRUE(change.ok() || absl::IsInvalidArgument(change.status())) << change.status();
  }
}

}  // namespace
}  // namespace voxeld::gpu::conformance
