// Tests every kind of primitive with every fill: the results for those that have lines and dots,
// the errors for the others, and the refusals wherever memory runs out.
#include <gmock/gmock.h>
#include <google/protobuf/descriptor.h>
#include <google/protobuf/message.h>

#include <map>
#include <set>
#include <string>
#include <variant>

#include "absl/strings/str_cat.h"
#include "daemon/text/fonts.h"
#include "daemon/wire/primitive.h"
#include "gpu/bulk/bulk_pool.h"
#include "tests/daemon/pictures/files.h"
#include "tests/daemon/wire/full_primitives.h"

namespace voxeld::daemon::wire {
namespace fills_test {

using ::testing::HasSubstr;
using ::testing::StartsWith;

MaybeFault FaultOf(const v1::Primitive& primitive, Content* content, gpu::BulkPool* pool = nullptr,
                   const Limits& limits = {}) {
  static text::Fonts fonts;
  return ToContent(FieldPath("primitive"), primitive,
                   {.limits = limits, .pool = pool, .fonts = &fonts}, content);
}

std::string KindOf(const v1::Primitive& primitive) {
  return v1::Primitive::descriptor()->FindFieldByNumber(primitive.kind_case())->name();
}

// Returns the primitive's message, if it has a fill.
google::protobuf::Message* WithFill(v1::Primitive* primitive) {
  google::protobuf::Message* const message = primitive->GetReflection()->MutableMessage(
      primitive, v1::Primitive::descriptor()->FindFieldByNumber(primitive->kind_case()));
  return message->GetDescriptor()->FindFieldByName("fill") == nullptr ? nullptr : message;
}

void SetFill(google::protobuf::Message* message, v1::Fill fill, bool keep_shell) {
  const auto* const descriptor = message->GetDescriptor();
  message->GetReflection()->SetEnumValue(message, descriptor->FindFieldByName("fill"), fill);
  if (!keep_shell)
    message->GetReflection()->ClearField(message, descriptor->FindFieldByName("shell"));
}

// Kinds that have no inside, and kinds that have neither lines nor dots.
const std::set<std::string> kNoInside = {"disc", "patch", "polygon", "height_map",
                                         "bezier_surface"};
const std::set<std::string> kNoEdges = {"implicit", "isosurface"};

TEST(Fills, LinesAndDotsAreWhatAShapeHas) {
  for (v1::Primitive primitive : FullPrimitives()) {
    google::protobuf::Message* const message = WithFill(&primitive);
    if (message == nullptr) continue;
    const std::string kind = KindOf(primitive);
    for (const v1::Fill fill : {v1::FILL_LINES, v1::FILL_DOTS}) {
      SCOPED_TRACE(absl::StrCat(kind, " ", v1::Fill_Name(fill)));
      SetFill(message, fill, false);
      Content content;
      const MaybeFault fault = FaultOf(primitive, &content);
      if (kNoEdges.contains(kind)) {
        ASSERT_TRUE(fault.has_value());
        EXPECT_EQ(fault->field, absl::StrCat("primitive.", kind, ".fill"));
        EXPECT_THAT(fault->message,
                    StartsWith(absl::StrCat("is ", v1::Fill_Name(fill), ", which it has none of")));
        continue;
      }
      ASSERT_FALSE(fault.has_value()) << fault->field << " " << fault->message;
      const GeometryData& data = *std::get<GeometryPtr>(content);
      EXPECT_EQ(data.record.kind == gpu::PrimitiveKind::kPoints, fill == v1::FILL_DOTS);
      EXPECT_EQ(data.record.kind == gpu::PrimitiveKind::kCurves ||
                    data.record.kind == gpu::PrimitiveKind::kSegments,
                fill == v1::FILL_LINES);
      EXPECT_GT(data.record.vertex_count, 0u);
      EXPECT_EQ(data.record.fill, gpu::Fill::kSurface);
    }
  }
}

TEST(Fills, OnlySurfacesHaveShells) {
  for (const v1::Primitive& good : FullPrimitives()) {
    for (const v1::Fill fill : {v1::FILL_SOLID, v1::FILL_LINES, v1::FILL_DOTS}) {
      v1::Primitive primitive = good;
      google::protobuf::Message* const message = WithFill(&primitive);
      if (message == nullptr) continue;
      const std::string kind = KindOf(primitive);
      const auto* const shell = message->GetDescriptor()->FindFieldByName("shell");
      google::protobuf::Message* const thickness =
          message->GetReflection()->MutableMessage(message, shell);
      static_cast<v1::Thickness*>(thickness)->set_value(2);
      SCOPED_TRACE(absl::StrCat(kind, " ", v1::Fill_Name(fill)));
      SetFill(message, fill, true);
      Content content;
      const MaybeFault fault = FaultOf(primitive, &content);
      ASSERT_TRUE(fault.has_value());
      const bool has_none =
          fill == v1::FILL_SOLID ? kNoInside.contains(kind) : kNoEdges.contains(kind);
      if (has_none) {
        EXPECT_EQ(fault->field, absl::StrCat("primitive.", kind, ".fill"));
      } else {
        EXPECT_EQ(fault->field, absl::StrCat("primitive.", kind, ".shell.value"));
        EXPECT_THAT(fault->message,
                    StartsWith("is 2, but only what is drawn as FILL_SURFACE has a shell"));
      }
      EXPECT_EQ(fault->reason, Reason::kInvalidValue);
    }
  }
}

TEST(Fills, SolidIsForWhatHasAnInside) {
  for (v1::Primitive primitive : FullPrimitives()) {
    google::protobuf::Message* const message = WithFill(&primitive);
    if (message == nullptr) continue;
    SetFill(message, v1::FILL_SOLID, false);
    const std::string kind = KindOf(primitive);
    SCOPED_TRACE(kind);
    Content content;
    const MaybeFault fault = FaultOf(primitive, &content);
    EXPECT_EQ(fault.has_value(), kNoInside.contains(kind));
    if (fault.has_value()) {
      EXPECT_EQ(fault->field, absl::StrCat("primitive.", kind, ".fill"));
      EXPECT_THAT(fault->message, HasSubstr("is FILL_SOLID, but it has no inside"));
    } else if (kind != "isosurface" &&
               kind != "mesh") {  // a group; if it is open, its surface is drawn
      EXPECT_EQ(std::get<GeometryPtr>(content)->record.fill, gpu::Fill::kSolid);
    }
  }
}

// With increasing room: until all of it fits, each attempt is refused, and nothing is kept.
TEST(Fills, WhatCannotBeKeptIsRefusedWhereverMemoryEnds) {
  std::vector<v1::Primitive> all = FullPrimitives();
  for (v1::Primitive primitive : FullPrimitives()) {
    google::protobuf::Message* const message = WithFill(&primitive);
    if (message == nullptr || kNoEdges.contains(KindOf(primitive))) continue;
    SetFill(message, v1::FILL_LINES, false);
    all.push_back(primitive);
  }
  v1::Primitive mesh;
  *mesh.mutable_mesh()->mutable_vertices() = Corners(6);
  mesh.mutable_mesh()->mutable_vertices()->set_colors_of(v1::Vertices::ELEMENTS);
  mesh.mutable_mesh()->mutable_vertices()->set_colors("rgbRGB");
  all.push_back(mesh);
  mesh.mutable_mesh()->mutable_vertices()->clear_colors_of();
  mesh.mutable_mesh()->mutable_vertices()->clear_colors();
  mesh.mutable_mesh()->mutable_texture()->set_picture(pictures::PngOf(2, 2, {1, 2, 3, 4}));
  mesh.mutable_mesh()->mutable_texture()->set_coordinates(std::string(6 * 8, '\0'));
  all.push_back(mesh);
  // Large enough to be in the pool each time that they are made again.
  v1::Primitive large;
  *large.mutable_mesh()->mutable_vertices() = Corners(900);
  all.push_back(large);
  large.mutable_mesh()->set_fill(v1::FILL_LINES);
  all.push_back(large);
  large.mutable_mesh()->set_fill(v1::FILL_SURFACE);
  large.mutable_mesh()->mutable_texture()->set_picture(
      pictures::PngOf(32, 32, std::vector<uint32_t>(32 * 32, 5)));
  large.mutable_mesh()->mutable_texture()->set_coordinates(std::string(900 * 8, '\0'));
  all.push_back(large);
  large.mutable_mesh()->clear_texture();
  large.mutable_mesh()->mutable_vertices()->set_colors_of(v1::Vertices::ELEMENTS);
  large.mutable_mesh()->mutable_vertices()->set_colors(std::string(900, 'c'));
  all.push_back(large);
  for (const v1::Primitive& primitive : FullPrimitives()) {
    if (!primitive.has_height_map()) continue;
    large = primitive;
    large.mutable_height_map()->set_columns(30);
    large.mutable_height_map()->set_rows(30);
    large.mutable_height_map()->set_heights(std::string(900 * 4, '\0'));
    all.push_back(large);
  }
  int refused = 0;
  for (const v1::Primitive& primitive : all) {
    SCOPED_TRACE(KindOf(primitive));
    bool fits = false;
    for (uint64_t limit = 64; limit <= 128 << 10; limit += 64 + limit / 512 * 64) {
      const auto pool = gpu::BulkPool::Create(
          {.limit_bytes = limit, .segment_bytes = 64, .keep_bytes = 0, .shared = false});
      Content content;
      const MaybeFault fault = FaultOf(primitive, &content, pool.get());
      if (fault.has_value()) {
        ++refused;
        ASSERT_EQ(fault->reason, Reason::kQuotaExceeded) << fault->field << " " << fault->message;
        ASSERT_THAT(fault->field, StartsWith("primitive."));
        ASSERT_THAT(fault->message, HasSubstr(absl::StrCat("limit ", limit)));
        ASSERT_FALSE(fits) << "with more room than was enough";
      } else {
        fits = true;
      }
      content = Content();
      ASSERT_EQ(pool->used_bytes(), 0u);
    }
    EXPECT_TRUE(fits);
  }
  EXPECT_GT(refused, 100);
}

}  // namespace fills_test
}  // namespace voxeld::daemon::wire
