// Tests volumes and isosurfaces from the wire: the errors for wrong ones, and the results for valid
// ones.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>
#include <limits>
#include <string>
#include <variant>
#include <vector>

#include "daemon/wire/encode_primitive.h"
#include "daemon/wire/primitive.h"
#include "gpu/primitives/samples.h"
#include "gpu/samples_check.h"
#include "tests/daemon/wire/faults.h"
#include "tests/daemon/wire/requests.h"
#include "voxeld/v1/primitives.pb.h"

namespace voxeld::daemon::wire {
namespace grids_test {

using ::testing::ElementsAre;
using ::testing::FloatEq;
using ::testing::HasSubstr;

using P = v1::Primitive;

MaybeFault FaultOf(const P& primitive, Content* content, const Limits& limits = {}) {
  return ToContent(FieldPath("primitive"), primitive, {limits}, content);
}

void SetGrid(v1::Grid* grid) {
  Set(grid->mutable_edge_a(), 4, 0, 0);
  Set(grid->mutable_edge_b(), 0, 6, 0);
  Set(grid->mutable_edge_c(), 0, 0, 1);
  grid->set_size_a(2);
  grid->set_size_b(3);
  grid->set_size_c(1);
  grid->set_samples(Packed<float>({0, 1, 2, 3, 4, 8}));
}

P Volume() {
  P p;
  SetGrid(p.mutable_volume()->mutable_grid());
  return p;
}
P Mapped() {
  P p = Volume();
  v1::Transfer* const transfer = p.mutable_volume()->mutable_transfer();
  for (const double value : {0, 4, 8}) transfer->add_values(value);
  for (const uint32_t color : {0x000000, 0xFF0000, 0xFFFF00}) transfer->add_colors(color);
  for (const double opacity : {0.0, 1.0, 0.5}) transfer->add_opacities(opacity);
  return p;
}
P Isosurface() {
  P p;
  SetGrid(p.mutable_isosurface()->mutable_grid());
  p.mutable_isosurface()->set_level(2.5);
  return p;
}

const FaultCase kCases[] = {
    {"size", Volume, [](P& p) { p.mutable_volume()->mutable_grid()->set_size_b(0); },
     "primitive.volume.grid.size_b", Reason::kInvalidValue, "is 0; give 1 to 65536"},
    {"samples", Volume, [](P& p) { p.mutable_volume()->mutable_grid()->set_size_a(3); },
     "primitive.volume.grid.samples", Reason::kSizeMismatch,
     "has 24 bytes, 6 samples; 9 samples take 36"},
    {"huge", Volume,
     [](P& p) {
       p.mutable_volume()->mutable_grid()->set_size_a(65536);
       p.mutable_volume()->mutable_grid()->set_size_b(65536);
     },
     "primitive.volume.grid.size_a", Reason::kQuotaExceeded, "max_indices_per_entity allows"},
    {"type", Isosurface,
     [](P& p) { p.mutable_isosurface()->mutable_grid()->set_type(v1::ELEMENT_TYPE_RGBA8); },
     "primitive.isosurface.grid.type", Reason::kInvalidValue, "ELEMENT_TYPE_U8"},
    {"filter", Volume,
     [](P& p) { p.mutable_volume()->mutable_grid()->set_filter(static_cast<v1::Grid::Filter>(7)); },
     "primitive.volume.grid.filter", Reason::kInvalidValue, "LINEAR, NEAREST"},
    {"flat", Volume,
     [](P& p) { Set(p.mutable_volume()->mutable_grid()->mutable_edge_c(), 1, 1, 0); },
     "primitive.volume.grid.edge_c", Reason::kInvalidValue, "spans no volume"},
    {"infinite", Volume,
     [](P& p) {
       p.mutable_volume()->mutable_grid()->set_samples(
           Packed<float>({0, 1, 2, std::numeric_limits<float>::infinity(), 4, 8}));
     },
     "primitive.volume.grid.samples[3]", Reason::kInvalidValue, "is infinite"},
    {"values", Mapped, [](P& p) { p.mutable_volume()->mutable_transfer()->set_values(1, -1); },
     "primitive.volume.transfer.values[1]", Reason::kInvalidValue, "is -1 after 0"},
    {"no_range", Mapped,
     [](P& p) {
       p.mutable_volume()->mutable_transfer()->set_values(1, 0);
       p.mutable_volume()->mutable_transfer()->set_values(2, 0);
     },
     "primitive.volume.transfer.values[2]", Reason::kInvalidValue, "is 0 as the first"},
    {"colors", Mapped,
     [](P& p) { p.mutable_volume()->mutable_transfer()->mutable_colors()->RemoveLast(); },
     "primitive.volume.transfer.colors", Reason::kSizeMismatch, "has 2 for 3 values"},
    {"both", Mapped, [](P& p) { p.mutable_volume()->mutable_transfer()->set_colormap("jet"); },
     "primitive.volume.transfer.colormap", Reason::kInvalidValue, "give one of the two"},
    {"opacity", Mapped, [](P& p) { p.mutable_volume()->mutable_transfer()->set_opacities(1, 2); },
     "primitive.volume.transfer.opacities[1]", Reason::kInvalidValue, "is 2; give 0 to 1"},
    {"colors_with_transfer", Mapped,
     [](P& p) { p.mutable_volume()->mutable_grid()->set_type(v1::ELEMENT_TYPE_RGBA8); },
     "primitive.volume.transfer", Reason::kInvalidValue, "the samples are colours"},
    {"tiny_values", Mapped,
     [](P& p) {
       p.mutable_volume()->mutable_transfer()->set_values(1, 1e-40);
       p.mutable_volume()->mutable_transfer()->set_values(2, 2e-40);
     },
     "primitive.volume.transfer.values[2]", Reason::kOutOfRange, "too little apart"},
    {"tiny_edges", Isosurface,
     [](P& p) {
       v1::Grid* const grid = p.mutable_isosurface()->mutable_grid();
       Set(grid->mutable_edge_a(), 1e-120, 0, 0);
       Set(grid->mutable_edge_b(), 0, 1e-120, 0);
       Set(grid->mutable_edge_c(), 0, 0, 1e-120);
     },
     "primitive.isosurface.grid.edge_c", Reason::kInvalidValue, "spans no volume"},
    {"level", Isosurface,
     [](P& p) { p.mutable_isosurface()->set_level(std::numeric_limits<double>::infinity()); },
     "primitive.isosurface.level", Reason::kInvalidValue, "inf"},
    {"lines", Isosurface, [](P& p) { p.mutable_isosurface()->set_fill(v1::FILL_LINES); },
     "primitive.isosurface.fill", Reason::kInvalidValue, "is FILL_LINES"},
    {"scale", Volume, [](P& p) { p.mutable_color_scale()->set_colormap("jet"); },
     "primitive.color_scale", Reason::kInvalidValue, "volume takes none"},
};

TEST(Grids, WhatIsWrongIsSaid) {
  ExpectFaults(kCases, [](const P& p, Content* content) { return FaultOf(p, content); });
}

const GroupData& GroupOf(const Content& content) { return *std::get<GroupPtr>(content); }
gpu::SampleView ViewOf(const Content& content) {
  return {GroupOf(content).parts[0].geometry->arrays.indices().data()};
}

TEST(Grids, AGridLiesWhereItsEdgesSay) {
  P p = Volume();
  Set(p.mutable_volume()->mutable_grid()->mutable_corner(), 10, 20, 30);
  Content content;
  ASSERT_FALSE(FaultOf(p, &content).has_value());
  const GroupData& group = GroupOf(content);
  ASSERT_EQ(group.parts.size(), 1u);
  EXPECT_EQ(group.min[0], 10);
  EXPECT_EQ(group.max[1], 26);
  // The corner of sample (1, 2, 0), whose cell is 2 by 2 by 1.
  const gpu::Point3d at = gpu::Map(group.parts[0].transform, 1, 2, 0);
  EXPECT_EQ(at.x, 12);
  EXPECT_EQ(at.y, 24);
  EXPECT_EQ(at.z, 30);
  EXPECT_EQ(ViewOf(content).Number(ViewOf(content).IndexOf(1, 2, 0)), 8);
  EXPECT_EQ(group.parts[0].geometry->record.kind, gpu::PrimitiveKind::kSamples);
  EXPECT_STREQ(group.kind, "volume");
}

TEST(Grids, TransferFunctionsAreTables) {
  Content content;
  ASSERT_FALSE(FaultOf(Mapped(), &content).has_value());
  const gpu::SampleView view = ViewOf(content);
  const auto look = [&](float value) {
    return view.table()[gpu::Samples::EntryOf(view.head(), value)];
  };
  EXPECT_EQ(look(8), look(100)) << "as the last";
  EXPECT_EQ(look(8), 0x808000u | gpu::SampleHead::kDrawn);
  EXPECT_EQ(look(0), 0u) << "as the first, which is transparent";
  EXPECT_EQ(look(-100), 0u);
  EXPECT_EQ(look(4) >> 24, 1u);
  EXPECT_NEAR(look(4) >> 16 & 255, 255, 3);
  EXPECT_NEAR(look(2) >> 16 & 255, 64, 2) << "half red, half its light";
  EXPECT_NEAR(look(6) >> 8 & 255, 96, 3) << "half green, three quarters of its light";
  P steps = Mapped();
  steps.mutable_volume()->mutable_transfer()->set_values(1, 0);
  steps.mutable_volume()->mutable_transfer()->set_opacities(1, 0);
  steps.mutable_volume()->mutable_transfer()->set_opacities(2, 0);
  ASSERT_FALSE(FaultOf(steps, &content).has_value());
  for (uint32_t i = 0; i < 256; ++i)
    EXPECT_EQ(ViewOf(content).table()[i], 0u) << "nothing is drawn";
}

TEST(Grids, WithoutATransferFunctionTheUpperHalfIsDrawn) {
  P p = Volume();
  p.mutable_color()->set_rgb(0x123456);
  Content content;
  ASSERT_FALSE(FaultOf(p, &content).has_value());
  const gpu::SampleView view = ViewOf(content);
  EXPECT_EQ(view.table()[gpu::Samples::EntryOf(view.head(), 3.9f)], 0u);
  EXPECT_EQ(view.table()[gpu::Samples::EntryOf(view.head(), 4.1f)],
            0x123456u | gpu::SampleHead::kDrawn);
}

TEST(Grids, WhatIsAllAlikeIsNothingButGood) {
  for (const float value : {0.0f, 2e7f, 1e-40f, std::numeric_limits<float>::quiet_NaN()}) {
    P p = Volume();
    p.mutable_volume()->mutable_grid()->set_samples(
        Packed<float>({value, value, value, value, value, value}));
    Content content;
    ASSERT_FALSE(FaultOf(p, &content).has_value());
    EXPECT_TRUE(gpu::CheckSamples(GroupOf(content).parts[0].geometry->arrays.indices()).ok())
        << value;
  }
}

TEST(Grids, ColorsAreTurnedAround) {
  P p = Volume();
  v1::Grid* const grid = p.mutable_volume()->mutable_grid();
  grid->set_type(v1::ELEMENT_TYPE_RGBA8);
  std::string bytes;
  for (char i = 0; i < 24; ++i) bytes += i;
  grid->set_samples(bytes);
  Content content;
  ASSERT_FALSE(FaultOf(p, &content).has_value());
  EXPECT_EQ(ViewOf(content).Word(1), 0x07040506u) << "alpha, red, green, blue";
}

TEST(Grids, TheyAreToldAsTheyWereSent) {
  for (P (*const make)() : {Volume, Mapped, Isosurface}) {
    Content content;
    ASSERT_FALSE(FaultOf(make(), &content).has_value());
    P told;
    Encode(content, &told);
    EXPECT_EQ(told.SerializeAsString(), make().SerializeAsString());
    EXPECT_LE(told.ByteSizeLong(), EncodedBytes(content));
  }
}

// A sample is 2 units wide along every axis but the last, where the grid's only sample is 1 wide.
TEST(Grids, ScalesColorIsosurfacesByThePlace) {
  P p = Isosurface();
  p.mutable_color_scale()->add_colors(0x000000);
  p.mutable_color_scale()->add_colors(0xFF0000);
  Set(p.mutable_color_scale()->mutable_along(), 0, 2, 0);
  Content content;
  const auto by_place = [&](double low, double high) {
    p.mutable_color_scale()->set_low(low);
    p.mutable_color_scale()->set_high(high);
    const MaybeFault fault = FaultOf(p, &content);
    EXPECT_FALSE(fault.has_value()) << fault->field << " " << fault->message;
    const gpu::GeometryRecord& record = GroupOf(content).parts[0].geometry->record;
    return std::vector<float>(record.params, record.params + 4);
  };
  // y / 2 from 0 to 3: 256 entries over 3 samples.
  EXPECT_THAT(by_place(0, 0), ElementsAre(0, FloatEq(256.0f / 3), 0, 0));
  EXPECT_EQ(ViewOf(content).head().by_level, 2u);
  EXPECT_EQ(ViewOf(content).table()[0], gpu::SampleHead::kDrawn);
  EXPECT_EQ(ViewOf(content).table()[255], gpu::SampleHead::kDrawn | 0xFF0000);
  EXPECT_THAT(by_place(1, 3), ElementsAre(0, 128, 0, -128));
  EXPECT_THAT(by_place(3, 1), ElementsAre(0, -128, 0, 384));
  Set(p.mutable_isosurface()->mutable_grid()->mutable_corner(), 7, 4, 7);
  EXPECT_THAT(by_place(1, 3), ElementsAre(0, 128, 0, 128));
  P told;
  Encode(content, &told);
  EXPECT_EQ(told.SerializeAsString(), p.SerializeAsString());
}

TEST(Grids, WhatIsWrongWithTheScaleOfAnIsosurfaceIsSaid) {
  const auto scaled = [] {
    P p = Isosurface();
    p.mutable_color_scale()->set_colormap("viridis");
    Set(p.mutable_color_scale()->mutable_along(), 0, 0, 1);
    return p;
  };
  const FaultCase cases[] = {
      {"scalars", scaled, [](P& p) { p.mutable_color_scale()->set_scalars(Packed<float>({1})); },
       "primitive.color_scale.scalars", Reason::kInvalidValue, "has no vertices; give along"},
      {"along", scaled, [](P& p) { p.mutable_color_scale()->clear_along(); },
       "primitive.color_scale.along", Reason::kInvalidValue, "has no direction"},
      {"colormap", scaled, [](P& p) { p.mutable_color_scale()->set_colormap("sepia"); },
       "primitive.color_scale.colormap", Reason::kNotFound, "each also turned round, as viridis_r"},
      {"ends", scaled,
       [](P& p) {
         p.mutable_color_scale()->set_low(0);
         p.mutable_color_scale()->set_high(1e-38);
       },
       "primitive.color_scale.high", Reason::kOutOfRange, "too near to one another"},
  };
  ExpectFaults(cases, [](const P& p, Content* content) { return FaultOf(p, content); });
}

TEST(Grids, ShellsInUnitsAreOfThePrimitives) {
  P p = Isosurface();
  p.mutable_isosurface()->mutable_shell()->set_value(1);
  p.mutable_isosurface()->mutable_shell()->set_unit(v1::Thickness::UNITS);
  Set(p.mutable_isosurface()->mutable_grid()->mutable_edge_c(), 0, 0, 2);
  Content content;
  ASSERT_FALSE(FaultOf(p, &content).has_value());
  EXPECT_FLOAT_EQ(GroupOf(content).parts[0].geometry->record.thickness, 0.5f) << "a cell is 2 wide";
}

}  // namespace grids_test
}  // namespace voxeld::daemon::wire
