#include "gpu/cuda/broadcast_plan.h"

#include <gtest/gtest.h>

#include <cstring>
#include <random>
#include <span>
#include <vector>

#include "gpu/bulk/bulk_pool.h"
#include "gpu/geometry_arrays.h"

namespace voxeld::gpu::cuda {
namespace {

// A plan over bulk memory of two pools, so that there are several copies and gaps between them.
struct Planned {
  explicit Planned(uint32_t seed) {
    std::mt19937 random(seed);
    const std::shared_ptr<BulkPool> pools[2] = {BulkPool::Create({.shared = false}),
                                                BulkPool::Create({.shared = false})};
    const size_t count = 1 + random() % 12;
    for (size_t i = 0; i < count; ++i) {
      GeometryRecord record;
      record.kind = PrimitiveKind::kPoints;
      record.vertex_count = static_cast<uint32_t>(100 + random() % 500);
      kept.push_back(*GeometryArrays::Allocate(record, pools[random() % 2].get()));
      GeometryArrays& arrays = kept.back();
      for (float& value : arrays.writable_positions()) value = static_cast<float>(random());
      GeometryView view;
      view.record = record;
      view.positions = arrays.positions();
      view.bulk = arrays.block().owner();
      view.bulk_segment = arrays.block().segment()->id();
      plan.AddBulk(view);
    }
  }
  UploadPlan plan;
  std::vector<GeometryArrays> kept;
};

std::vector<std::byte> Whole(const UploadPlan& plan) {
  std::vector<std::byte> memory(plan.size());
  for (const UploadPlan::Copy& copy : plan.copies()) {
    std::memcpy(memory.data() + copy.to, copy.from, copy.size);
  }
  return memory;
}

TEST(BroadcastSteps, BringWhatThePlanSaysToEveryRank) {
  size_t steps_seen = 0, copies_seen = 0;
  for (uint32_t seed = 0; seed < 200; ++seed) {
    const Planned planned(seed);
    for (const size_t most : {64, 100, 4096, 1 << 20}) {
      // The first rank has what has arrived from the host so far; the other what was broadcast.
      std::vector<std::byte> first(planned.plan.size()), other(planned.plan.size());
      size_t end = 0;
      for (const BroadcastStep& step : BroadcastSteps(planned.plan, most)) {
        EXPECT_EQ(step.begin, end);
        EXPECT_GT(step.size, 0u);
        EXPECT_LE(step.size, most);
        end += step.size;
        for (const UploadPlan::Copy& copy : step.copies) {
          ASSERT_GE(copy.to, step.begin);
          ASSERT_LE(copy.to + copy.size, end) << "it would come too late";
          std::memcpy(first.data() + copy.to, copy.from, copy.size);
          ++copies_seen;
        }
        std::memcpy(other.data() + step.begin, first.data() + step.begin, step.size);
        ++steps_seen;
      }
      EXPECT_EQ(end, planned.plan.size());
      ASSERT_TRUE(other == Whole(planned.plan)) << "seed " << seed << ", pieces of " << most;
    }
  }
  EXPECT_GT(steps_seen, 2000u);
  EXPECT_GT(copies_seen, 2000u);
}

TEST(BroadcastSteps, OfNothingAreNone) { EXPECT_TRUE(BroadcastSteps(UploadPlan(), 4096).empty()); }

}  // namespace
}  // namespace voxeld::gpu::cuda
