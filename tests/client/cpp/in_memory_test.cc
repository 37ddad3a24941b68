// Requests whose payloads were moved are unchanged once their ranges are filled in again.
#include "client/cpp/src/in_memory.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <numeric>

#include "client/cpp/src/encode.h"
#include "voxeld/v1/scene.pb.h"

namespace voxeld::client {
namespace in_memory_test {

template <typename T>
std::vector<T> Counting(size_t count) {
  std::vector<T> values(count);
  std::iota(values.begin(), values.end(), T{1});
  return values;
}

// Returns `count` vertices; with colours, they take an odd number of bytes.
Vertices Cloud(size_t count) {
  return {.positions = Counting<float>(3 * count), .colors = Counting<uint8_t>(3 * count)};
}

UpsertOperation Upsert(const std::string& id, const Shape& shape) {
  return {.layer = "l",
          .id = id,
          .primitive = *EncodePrimitive(shape, {1, 2, 3}),
          .transform = Affine::Scale(2),
          .priority = 7,
          .label = "label"};
}

Rope BatchOf(const std::vector<UpsertOperation>& upserts) {
  Batcher batcher(size_t{1} << 30);
  for (const UpsertOperation& upsert : upserts) batcher.Add(upsert);
  Rope request = batcher.Take().at(0).bytes;
  AddSequence(77, &request);
  return request;
}

v1::StreamRequest Parse(const Rope& request) {
  v1::StreamRequest parsed;
  EXPECT_TRUE(parsed.ParseFromString(request.Flat()));
  return parsed;
}

uint64_t ranges_filled = 0;

void Fill(const std::string& memory, uint64_t id, bool has, const v1::MemoryRange& range,
          std::string* payload) {
  if (!has) return;
  EXPECT_TRUE(payload->empty());
  EXPECT_EQ(range.memory(), id);
  EXPECT_EQ(range.offset() % 4, 0u);
  ASSERT_LE(range.offset() + range.size(), memory.size());
  *payload = memory.substr(range.offset(), range.size());
  ++ranges_filled;
}

void FillIn(const std::string& memory, uint64_t id, v1::Primitive* primitive) {
  v1::Vertices* vertices = primitive->has_points() ? primitive->mutable_points()->mutable_vertices()
                           : primitive->has_segments()
                               ? primitive->mutable_segments()->mutable_vertices()
                           : primitive->has_mesh() ? primitive->mutable_mesh()->mutable_vertices()
                                                   : nullptr;
  if (vertices == nullptr) return;
  Fill(memory, id, vertices->has_positions_in(), vertices->positions_in(),
       vertices->mutable_positions());
  Fill(memory, id, vertices->has_colors_in(), vertices->colors_in(), vertices->mutable_colors());
  Fill(memory, id, vertices->has_indices_in(), vertices->indices_in(), vertices->mutable_indices());
  vertices->clear_positions_in();
  vertices->clear_colors_in();
  vertices->clear_indices_in();
}

// Moves the payloads and moves them back. Returns the number of ranges.
uint64_t RangesOf(const Rope& request) {
  const std::optional<InMemory> moved = MoveToMemory(request, 5);
  if (!moved) return 0;
  EXPECT_LT(moved->request.size() + moved->memory.size(), request.size() + 200);
  const std::string memory = moved->memory.Flat();
  v1::StreamRequest back = Parse(moved->request);
  ranges_filled = 0;
  if (back.has_batch()) {
    for (v1::Upsert& upsert : *back.mutable_batch()->mutable_upserts())
      FillIn(memory, 5, upsert.mutable_entity()->mutable_primitive());
  } else {
    for (v1::Object::Part& part :
         *back.mutable_define_object()->mutable_definition()->mutable_parts())
      FillIn(memory, 5, part.mutable_primitive());
  }
  // Not EXPECT_EQ: its output would be unreadable.
  EXPECT_TRUE(back.SerializeAsString() == Parse(request).SerializeAsString());
  return ranges_filled;
}

TEST(InMemory, PayloadsOfAllShapesAreMoved) {
  Vertices triangles = Cloud(10'000);
  triangles.indices = Counting<uint32_t>(9'999);
  Vertices narrow = Cloud(9'001);
  narrow.short_indices = Counting<uint16_t>(9'001);
  EXPECT_EQ(RangesOf(BatchOf({Upsert("p", Points{.vertices = Cloud(9'001)})})), 2u);
  EXPECT_EQ(RangesOf(BatchOf({Upsert("s", Segments{.vertices = narrow})})), 3u);
  EXPECT_EQ(RangesOf(BatchOf({Upsert("m", Mesh{.vertices = triangles})})), 3u);
}

TEST(InMemory, WhatIsSmallStaysInItsPlace) {
  EXPECT_EQ(RangesOf(BatchOf({Upsert("small", Points{.vertices = Cloud(100)}), Upsert("box", Box{}),
                              Upsert("large", Points{.vertices = Cloud(9'001)}),
                              Upsert("again", Points{.vertices = Cloud(9'003)}),
                              Upsert("after", Sphere{})})),
            4u);
  EXPECT_EQ(RangesOf(BatchOf({Upsert("p", Points{.vertices = Cloud(4'000)})})), 0u);
  std::vector<UpsertOperation> many;
  for (int i = 0; i < 100; ++i)
    many.push_back(Upsert(std::to_string(i), Points{.vertices = Cloud(200)}));
  EXPECT_EQ(RangesOf(BatchOf(many)), 0u) << "together large, each small";
}

TEST(InMemory, ObjectsAreMovedPartByPart) {
  const absl::StatusOr<DefineOperation> define =
      EncodeDefinition("o", {{.shape = Box{}},
                             {.shape = Points{.vertices = Cloud(9'001)}},
                             {.shape = Mesh{.vertices = {.positions = Counting<float>(90'000)}}}});
  ASSERT_TRUE(define.ok());
  EXPECT_EQ(RangesOf(EncodeOperation(*define)), 3u);
}

TEST(InMemory, PayloadsAreNotCopied) {
  std::vector<float> positions = Counting<float>(60'000);
  const void* const where = positions.data();
  const Rope request =
      BatchOf({Upsert("p", Points{.vertices = {.positions = std::move(positions)}})});
  const std::optional<InMemory> moved = MoveToMemory(request, 1);
  ASSERT_TRUE(moved.has_value());
  ASSERT_EQ(moved->memory.tail().size(), 1u);
  EXPECT_EQ(static_cast<const void*>(moved->memory.tail()[0].shared.data()), where);
}

TEST(InMemory, WhatIsNoRequestIsLeftAlone) {
  Rope request = BatchOf({Upsert("p", Points{.vertices = Cloud(9'001)})});
  request.Append(std::string("\x7f"));  // a wire type that does not exist
  EXPECT_FALSE(MoveToMemory(request, 1).has_value());
}

}  // namespace in_memory_test
}  // namespace voxeld::client
