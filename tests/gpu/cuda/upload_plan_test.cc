#include "gpu/cuda/upload_plan.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <memory>
#include <random>
#include <span>
#include <utility>
#include <vector>

#include "gpu/bulk/bulk_pool.h"
#include "gpu/geometry_arrays.h"

namespace voxeld::gpu::cuda {
namespace {

GeometryRecord Record(uint32_t vertices, uint32_t indices, bool colored) {
  GeometryRecord record;
  record.kind = PrimitiveKind::kSegments;
  record.vertex_count = vertices;
  record.index_count = indices;
  record.color_mode = colored ? ColorMode::kPerVertex : ColorMode::kUniform;
  return record;
}

// Random geometries in bulk memory, and their views.
struct Scene {
  void Add(BulkPool& pool, const GeometryRecord& record) {
    GeometryArrays arrays = *GeometryArrays::Allocate(record, &pool);
    for (float& value : arrays.writable_positions()) value = static_cast<float>(random() % 1000);
    for (uint32_t& value : arrays.writable_indices()) value = random();
    for (uint32_t& value : arrays.writable_colors()) value = random();
    GeometryView view;
    view.record = record;
    view.positions = arrays.positions();
    view.indices = arrays.indices();
    view.colors = arrays.colors();
    view.bulk = arrays.block().owner();
    view.bulk_segment = arrays.block().segment()->id();
    views.push_back(view);
    kept.push_back(std::move(arrays));
  }
  std::mt19937 random{1};
  std::vector<GeometryView> views;
  std::vector<GeometryArrays> kept;
};

// Carries out the copies, and compares the results with the geometries.
void ExpectAllThere(const UploadPlan& plan, const Scene& scene, const std::vector<size_t>& places) {
  std::vector<std::byte> device(plan.size());
  for (const UploadPlan::Copy& copy : plan.copies()) {
    ASSERT_LE(copy.to + copy.size, device.size());
    std::memcpy(device.data() + copy.to, copy.from, copy.size);
  }
  for (size_t i = 0; i < places.size(); ++i) {
    const GeometryView& view = scene.views[i];
    const auto* host = reinterpret_cast<const std::byte*>(view.positions.data());
    EXPECT_EQ(places[i] % 16, 0u);
    const auto same = [&](auto array) {
      const std::span<const std::byte> bytes = std::as_bytes(array);
      const auto at = places[i] + static_cast<size_t>(bytes.data() - host);
      return bytes.empty() || (at + bytes.size() <= device.size() &&
                               std::memcmp(device.data() + at, bytes.data(), bytes.size()) == 0);
    };
    EXPECT_TRUE(same(view.positions) && same(view.indices) && same(view.colors)) << i;
  }
}

TEST(UploadPlan, NeighboursGoOverAsOne) {
  const auto pool = BulkPool::Create({.segment_bytes = 1 << 20});
  Scene scene;
  for (uint32_t i = 0; i < 20; ++i) scene.Add(*pool, Record(300 + i, i % 3, i % 2 == 0));
  UploadPlan plan;
  std::vector<size_t> places;
  for (const GeometryView& view : scene.views) places.push_back(plan.AddBulk(view));
  EXPECT_EQ(plan.copies().size(), 1u);
  ExpectAllThere(plan, scene, places);
}

TEST(UploadPlan, SegmentsAndHolesGoOverApart) {
  const auto pool = BulkPool::Create({.segment_bytes = 32 << 10});
  Scene scene;
  for (uint32_t i = 0; i < 60; ++i) scene.Add(*pool, Record(200 + i, 10, true));
  for (size_t i = 0; i < scene.views.size(); i += 4) std::swap(scene.views[i], scene.views[i / 2]);
  UploadPlan plan;
  std::vector<size_t> places;
  for (const GeometryView& view : scene.views) places.push_back(plan.AddBulk(view));
  EXPECT_GT(plan.copies().size(), 5u);
  EXPECT_LT(plan.copies().size(), 60u);
  ExpectAllThere(plan, scene, places);
}

TEST(UploadPlan, WhatLiesInTheDeltaComesFirst) {
  const auto pool = BulkPool::Create();
  Scene scene;
  for (int i = 0; i < 3; ++i) scene.Add(*pool, Record(100, 0, true));
  // As if the second were in a delta: it is copied by itself, with the third.
  UploadPlan plan;
  plan.AddInline(scene.views[1]);
  plan.AddInline(scene.views[2]);
  EXPECT_EQ(plan.inline_begin(),
            reinterpret_cast<const std::byte*>(scene.views[1].positions.data()));
  const size_t third = static_cast<size_t>(
      reinterpret_cast<const std::byte*>(scene.views[2].positions.data()) - plan.inline_begin());
  const size_t first = plan.AddBulk(scene.views[0]);
  EXPECT_EQ(plan.copies().size(), 2u);
  ExpectAllThere(plan, scene, {first, 0, third});
}

}  // namespace
}  // namespace voxeld::gpu::cuda
