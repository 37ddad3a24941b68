// Content → primitive is the inverse of primitive → content.
#include "daemon/wire/encode_primitive.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/daemon/wire/random_primitive.h"
#include "tests/daemon/wire/watched_scene.h"

namespace voxeld::daemon::wire {
namespace {

Content Decoded1(const v1::Primitive& primitive) {
  Content content;
  const MaybeFault fault = ToContent(FieldPath("primitive"), primitive, {Limits()}, &content);
  EXPECT_FALSE(fault.has_value()) << fault->field << " " << fault->message << "\n"
                                  << primitive.DebugString().substr(0, 2000);
  return content;
}

// Returns the primitive after serialising and parsing it.
v1::Primitive Sent(const v1::Primitive& primitive) {
  v1::Primitive received;
  EXPECT_TRUE(received.ParseFromString(primitive.SerializeAsString()));
  return received;
}

TEST(EncodePrimitive, DecodesToTheSame) {
  std::mt19937 random(1);
  RandomPrimitives primitives(random);
  std::map<v1::Primitive::KindCase, int> kinds;
  for (int n = 0; n < 3000; ++n) {
    const v1::Primitive first = primitives.Next(n % 50 == 0 ? 5000 : 12, true);
    ++kinds[first.kind_case()];
    const Content content = Decoded1(first);
    v1::Primitive encoded;
    Encode(content, &encoded);
    EXPECT_EQ(encoded.kind_case(), first.kind_case());
    ASSERT_EQ(InWords(Decoded1(Sent(encoded))), InWords(content)) << "primitive " << n;
    const size_t bytes = encoded.ByteSizeLong();
    EXPECT_GE(EncodedBytes(content), bytes);
    EXPECT_LE(EncodedBytes(content), bytes + 128);
    // Once it is in its plainest form, it does not change any longer.
    v1::Primitive again;
    Encode(Decoded1(encoded), &again);
    EXPECT_EQ(again.SerializeAsString(), encoded.SerializeAsString());
  }
  EXPECT_EQ(kinds.size(), 24u);  // all but Text
}

TEST(EncodePrimitive, ArraysComeInTheirPlainestTypes) {
  v1::Primitive primitive;
  v1::Vertices* vertices = primitive.mutable_mesh()->mutable_vertices();
  vertices->set_count(3);
  vertices->set_position_type(v1::ELEMENT_TYPE_I16);
  vertices->set_positions(Packed<int16_t>({1, 2, 3, -4, 5, 6, 7, 8, -9}));
  vertices->set_index_type(v1::ELEMENT_TYPE_U16);
  vertices->set_index_count(3);
  vertices->set_indices(Packed<uint16_t>({2, 0, 1}));
  vertices->set_color_type(v1::ELEMENT_TYPE_RGBX8);
  vertices->set_colors("\x01\x02\x03\x7F\xFF\x80\x40\x7F\x0A\x0B\x0C\x7F");
  v1::Primitive encoded;
  Encode(Decoded1(primitive), &encoded);
  const v1::Vertices& out = encoded.mesh().vertices();
  EXPECT_EQ(out.count(), 3u);
  EXPECT_EQ(out.position_type(), v1::ELEMENT_TYPE_F32);
  EXPECT_EQ(out.positions(), Packed<float>({1, 2, 3, -4, 5, 6, 7, 8, -9}));
  EXPECT_EQ(out.index_type(), v1::ELEMENT_TYPE_U32);
  EXPECT_EQ(out.index_count(), 3u);
  EXPECT_EQ(out.indices(), Packed<uint32_t>({2, 0, 1}));
  EXPECT_EQ(out.color_type(), v1::ELEMENT_TYPE_RGB8);
  EXPECT_EQ(out.colors(), "\x01\x02\x03\xFF\x80\x40\x0A\x0B\x0C");
  EXPECT_EQ(encoded.color().rgb(), 0xFFFFFFu);
}

TEST(EncodePrimitive, ObjectsKeepTheirPartsInOrder) {
  std::mt19937 random(2);
  RandomPrimitives primitives(random);
  for (int n = 0; n < 100; ++n) {
    ObjectData data;
    for (uint32_t part = random() % 6; part > 0; --part) {
      gpu::Affine map;
      map.m[3] = random() % 100;
      map.m[1] = 0.25;
      data.parts.push_back({Decoded1(primitives.Next(20, true)), map});
    }
    v1::Object encoded;
    Encode(data, &encoded);
    ASSERT_EQ(encoded.parts_size(), static_cast<int>(data.parts.size()));
    for (int i = 0; i < encoded.parts_size(); ++i) {
      EXPECT_EQ(InWords(Decoded1(Sent(encoded.parts(i).primitive()))),
                InWords(data.parts[i].content));
      EXPECT_EQ(InWords(encoded.parts(i).transform()), InWords(data.parts[i].transform));
    }
    EXPECT_GE(EncodedBytes(data), encoded.ByteSizeLong());
  }
}

}  // namespace
}  // namespace voxeld::daemon::wire
