// Tests ranges of memory in place of payloads: the same operations as from the bytes themselves,
// and what is refused.
#include <gmock/gmock.h>

#include <algorithm>
#include <functional>
#include <limits>
#include <map>
#include <random>
#include <utility>
#include <variant>

#include "absl/strings/str_cat.h"
#include "daemon/wire/encode_primitive.h"
#include "tests/daemon/wire/requests.h"

namespace voxeld::daemon::wire {
namespace named_ranges_test {

using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

// Memories that are strings; one that was found lives as long as it is held.
class Strings final : public MemorySource {
 public:
  absl::StatusOr<MappedRange> Find(uint64_t memory, uint64_t offset, uint64_t size) const override {
    ++asked;
    if (memory == broken) return absl::UnavailableError("is broken; mend it");
    const auto found = memories.find(memory);
    if (found == memories.end()) return absl::NotFoundError(absl::StrCat("is ", memory, "; no"));
    const std::string& bytes = found->second;
    if (offset > bytes.size() || size > bytes.size() - offset) {
      return absl::OutOfRangeError(absl::StrCat("is ", size, "; beyond"));
    }
    // A copy of exactly that part: sanitizers report a read beyond it.
    const auto copy =
        std::make_shared<std::vector<char>>(bytes.begin() + static_cast<ptrdiff_t>(offset),
                                            bytes.begin() + static_cast<ptrdiff_t>(offset + size));
    return MappedRange{{copy->data(), copy->size()}, copy};
  }

  // Stores the bytes in a new memory, or as a part of one.
  void Put(const std::string& bytes, uint64_t memory, uint64_t offset, v1::MemoryRange* range) {
    std::string& all = memories[memory];
    if (all.size() < offset) all.resize(offset, '\x55');
    all.replace(offset, std::min(bytes.size(), all.size() - offset), bytes);
    range->set_memory(memory);
    range->set_offset(offset);
    range->set_size(bytes.size());
  }

  std::map<uint64_t, std::string> memories;
  uint64_t broken = ~uint64_t{0};
  mutable int asked = 0;
};

Decoded DecodeWith(const v1::StreamRequest& request, const MemorySource* source,
                   const Limits& limits = {}, AssetSource* assets = nullptr) {
  const std::string bytes = request.SerializeAsString();
  const std::string_view slice = bytes;
  return DecodeStreamRequest(std::span(&slice, 1), limits, 0, nullptr, {source, assets});
}

// Assets that are strings, under names of 32 bytes.
class Contents final : public AssetSource {
 public:
  absl::StatusOr<MappedRange> FindAsset(std::string_view digest, uint64_t offset,
                                        uint64_t size) override {
    const auto found = contents.find(std::string(digest));
    if (found == contents.end()) return absl::NotFoundError("is 00; gone");
    if (offset + size > found->second.size()) return absl::OutOfRangeError("is 9; beyond");
    const auto copy = std::make_shared<std::string>(found->second.substr(offset, size));
    return MappedRange{*copy, copy};
  }

  // Moves the bytes out of a field, into an asset of its own that begins with three other bytes.
  void Move(std::string* bytes, v1::MemoryRange* range) {
    std::string digest(32, static_cast<char>(contents.size()));
    range->set_asset(digest);
    range->set_offset(3);
    range->set_size(bytes->size());
    contents[digest] = "***" + std::exchange(*bytes, {});
  }

  std::map<std::string, std::string> contents;
};

v1::Vertices* VerticesOf(v1::StreamRequest& request) {
  v1::Primitive* primitive = PrimitiveOf(request);
  switch (primitive->kind_case()) {
    case v1::Primitive::kPoints:
      return primitive->mutable_points()->mutable_vertices();
    case v1::Primitive::kSegments:
      return primitive->mutable_segments()->mutable_vertices();
    default:
      return primitive->mutable_mesh()->mutable_vertices();
  }
}

// Moves the payloads into memories 10, 11 and 12, the last two at an offset.
void MoveOut(v1::Vertices* vertices, Strings* memory) {
  memory->Put(vertices->positions(), 10, 0, vertices->mutable_positions_in());
  vertices->clear_positions();
  if (!vertices->indices().empty()) {
    memory->Put(vertices->indices(), 11, 64, vertices->mutable_indices_in());
    vertices->clear_indices();
  }
  if (!vertices->colors().empty()) {
    memory->Put(vertices->colors(), 12, 4, vertices->mutable_colors_in());
    vertices->clear_colors();
  }
}

const GeometryData& GeometryOf(const Decoded& decoded) {
  return *std::get<GeometryPtr>(std::get<Upsert>(decoded.operations.at(0).op).entity.content);
}

void ExpectSame(const Decoded& got, const Decoded& want) {
  ASSERT_TRUE(got.status.ok() && want.status.ok());
  ASSERT_THAT(want.refused.issues, IsEmpty());
  ASSERT_THAT(got.refused.issues, IsEmpty()) << got.refused.issues[0].message;
  const GeometryData &a = GeometryOf(got), &b = GeometryOf(want);
  EXPECT_EQ(std::memcmp(&a.record, &b.record, sizeof(a.record)), 0);
  EXPECT_TRUE(std::ranges::equal(a.arrays.positions(), b.arrays.positions()));
  EXPECT_TRUE(std::ranges::equal(a.arrays.indices(), b.arrays.indices()));
  EXPECT_TRUE(std::ranges::equal(a.arrays.colors(), b.arrays.colors()));
  EXPECT_TRUE(std::equal(a.min, a.min + 3, b.min));
  EXPECT_TRUE(std::equal(a.max, a.max + 3, b.max));
}

TEST(NamedRanges, AreReadAsPayloadsAre) {
  std::mt19937 random(7);
  const auto below = [&](uint32_t end) {
    return std::uniform_int_distribution<uint32_t>(0, end - 1)(random);
  };
  const auto bytes = [&](size_t size) {
    std::string out(size, '\0');
    for (char& c : out) c = static_cast<char>(below(256));
    return out;
  };
  for (int round = 0; round < 300; ++round) {
    v1::StreamRequest request = round % 3 == 0   ? PointsRequest()
                                : round % 3 == 1 ? SegmentsRequest()
                                                 : MeshRequest();
    v1::Vertices* vertices = VerticesOf(request);
    const uint32_t count = 3 * (1 + below(40));
    vertices->set_count(count);
    switch (below(3)) {
      case 0: {
        std::vector<float> positions(size_t{count} * 3);
        for (float& p : positions) p = static_cast<float>(below(1000)) - 500.25f;
        vertices->set_positions(Packed(positions));
        break;
      }
      case 1:
        vertices->set_position_type(v1::ELEMENT_TYPE_I16);
        vertices->set_positions(bytes(size_t{count} * 6));
        break;
      default: {
        std::vector<int32_t> positions(size_t{count} * 3);
        for (int32_t& p : positions) p = static_cast<int32_t>(below(1 << 25)) - (1 << 24);
        vertices->set_position_type(v1::ELEMENT_TYPE_I32);
        vertices->set_positions(Packed(positions));
      }
    }
    if (round % 3 != 0 && below(2) == 0) {
      std::vector<uint16_t> few(3 * (1 + below(60)));
      for (uint16_t& index : few) index = static_cast<uint16_t>(below(count));
      vertices->set_index_count(static_cast<uint32_t>(few.size()));
      if (below(2) == 0) {
        vertices->set_index_type(v1::ELEMENT_TYPE_U16);
        vertices->set_indices(Packed(few));
      } else {
        vertices->set_indices(Packed(std::vector<uint32_t>(few.begin(), few.end())));
      }
    }
    if (below(2) == 0) {
      const bool four = below(2) == 0;
      if (four) vertices->set_color_type(v1::ELEMENT_TYPE_RGBX8);
      vertices->set_colors(bytes(size_t{count} * (four ? 4 : 3)));
    }
    const Decoded want = Decode(request);
    EXPECT_EQ(want.named_bytes, 0u);
    const size_t payload =
        vertices->positions().size() + vertices->indices().size() + vertices->colors().size();
    Strings memory;
    MoveOut(vertices, &memory);
    const Decoded got = DecodeWith(request, &memory);
    ExpectSame(got, want);
    EXPECT_EQ(got.named_bytes, payload);
  }
}

TEST(NamedRanges, AnObjectsPartsMayLieThere) {
  Strings memory;
  v1::StreamRequest request;
  request.mutable_define_object()->set_object("object");
  v1::Vertices* vertices = request.mutable_define_object()
                               ->mutable_definition()
                               ->add_parts()
                               ->mutable_primitive()
                               ->mutable_mesh()
                               ->mutable_vertices();
  *vertices = Triangle();
  MoveOut(vertices, &memory);
  const Decoded decoded = DecodeWith(request, &memory);
  ASSERT_THAT(decoded.operations, SizeIs(1));
  const auto& parts = std::get<DefineObject>(decoded.operations[0].op).data->parts;
  EXPECT_THAT(std::get<GeometryPtr>(parts.at(0).content)->arrays.positions(),
              ::testing::ElementsAre(0, 0, 0, 1, 0, 0, 0, 1, 0));
  EXPECT_EQ(decoded.named_bytes, 36u);
}

struct Case {
  const char* name;
  void (*spoil)(v1::Vertices*, Strings*);
  Reason reason;
  const char* field;  // after "upsert.entity.primitive.mesh.vertices."
  const char* message;
};

constexpr uint64_t kMost = std::numeric_limits<uint64_t>::max();

const Case kCases[] = {
    {"unknown", [](v1::Vertices* v, Strings*) { v->mutable_positions_in()->set_memory(99); },
     Reason::kNotFound, "positions_in.memory", "memory is 99; no"},
    {"unknown_indices", [](v1::Vertices* v, Strings*) { v->mutable_indices_in()->set_memory(98); },
     Reason::kNotFound, "indices_in.memory", "memory is 98; no"},
    {"unknown_colors", [](v1::Vertices* v, Strings*) { v->mutable_colors_in()->set_memory(97); },
     Reason::kNotFound, "colors_in.memory", "memory is 97; no"},
    {"unreadable", [](v1::Vertices*, Strings* s) { s->broken = 12; }, Reason::kInvalidValue,
     "colors_in.memory", "memory is broken; mend it"},
    {"both", [](v1::Vertices* v, Strings*) { v->set_positions(std::string(36, '\0')); },
     Reason::kInvalidValue, "positions_in", "is set, and positions has 36 bytes; give one of them"},
    {"both_colors", [](v1::Vertices* v, Strings*) { v->set_colors("x"); }, Reason::kInvalidValue,
     "colors_in", "is set, and colors has 1 bytes; give one of them"},
    {"both_indices", [](v1::Vertices* v, Strings*) { v->set_indices("x"); }, Reason::kInvalidValue,
     "indices_in", "is set, and indices has 1 bytes; give one of them"},
    {"short", [](v1::Vertices* v, Strings*) { v->mutable_positions_in()->set_size(32); },
     Reason::kSizeMismatch, "positions_in.size", "is 32; 3 elements of 12 bytes need 36"},
    {"long", [](v1::Vertices* v, Strings*) { v->mutable_colors_in()->set_size(12); },
     Reason::kSizeMismatch, "colors_in.size", "is 12; 3 elements of 3 bytes need 9"},
    {"huge", [](v1::Vertices* v, Strings*) { v->mutable_indices_in()->set_size(kMost); },
     Reason::kSizeMismatch, "indices_in.size", "is 18446744073709551615; 3 elements of 4"},
    {"unset", [](v1::Vertices* v, Strings*) { v->mutable_positions_in()->Clear(); },
     Reason::kSizeMismatch, "positions_in.size", "is 0; 3 elements of 12 bytes need 36"},
    {"odd", [](v1::Vertices* v, Strings*) { v->mutable_positions_in()->set_offset(2); },
     Reason::kInvalidValue, "positions_in.offset", "is 2; give a multiple of 4"},
    {"beyond", [](v1::Vertices* v, Strings*) { v->mutable_positions_in()->set_offset(4); },
     Reason::kInvalidValue, "positions_in.size", "size is 36; beyond"},
    {"overflow",
     [](v1::Vertices* v, Strings*) { v->mutable_positions_in()->set_offset(kMost - 3); },
     Reason::kInvalidValue, "positions_in.size", "size is 36; beyond"},
    {"count", [](v1::Vertices* v, Strings*) { v->set_count(kMost >> 32); }, Reason::kQuotaExceeded,
     "count", "max_vertices_per_entity"},
    {"value",
     [](v1::Vertices*, Strings* s) {
       s->memories[10] = Packed<float>({0, 0, 0, 0, 0, 0, 0, 0, std::nanf("")});
     },
     Reason::kInvalidValue, "positions[2].z", "is NaN"},
    {"index", [](v1::Vertices*, Strings* s) { s->memories[11][64] = 3; }, Reason::kIndexOutOfRange,
     "indices[0]", "is 3; there are 3 vertices"},
};

class WrongRange : public ::testing::TestWithParam<Case> {};

TEST_P(WrongRange, IsAnIssueWithTheFieldsPath) {
  v1::StreamRequest request = MeshRequest();
  v1::Vertices* vertices = VerticesOf(request);
  vertices->set_index_count(3);
  vertices->set_indices(Packed<uint32_t>({0, 1, 2}));
  vertices->set_colors("abcdefghi");
  Strings memory;
  MoveOut(vertices, &memory);
  ASSERT_THAT(DecodeWith(request, &memory).refused.issues, IsEmpty());
  GetParam().spoil(vertices, &memory);
  const Decoded decoded = DecodeWith(request, &memory);
  ASSERT_TRUE(decoded.status.ok());
  EXPECT_THAT(decoded.operations, IsEmpty());
  ASSERT_THAT(decoded.refused.issues, SizeIs(1));
  const Issue& issue = decoded.refused.issues[0];
  EXPECT_EQ(issue.reason, GetParam().reason);
  EXPECT_EQ(issue.field, absl::StrCat("upsert.entity.primitive.mesh.vertices.", GetParam().field));
  EXPECT_THAT(issue.message, HasSubstr(GetParam().message));
}

INSTANTIATE_TEST_SUITE_P(NamedRanges, WrongRange, ::testing::ValuesIn(kCases),
                         [](const auto& info) { return std::string(info.param.name); });

TEST(NamedRanges, PointsTakeNoIndices) {
  v1::StreamRequest request = PointsRequest();
  VerticesOf(request)->mutable_indices_in();
  Strings memory;
  const Decoded decoded = DecodeWith(request, &memory);
  ASSERT_THAT(decoded.refused.issues, SizeIs(1));
  EXPECT_THAT(decoded.refused.issues[0].field, HasSubstr("vertices.indices_in"));
  EXPECT_THAT(decoded.refused.issues[0].message, HasSubstr("points take no indices"));
}

TEST(NamedRanges, NeedALocalSocket) {
  v1::StreamRequest request = MeshRequest();
  Strings memory;
  MoveOut(VerticesOf(request), &memory);
  const Decoded decoded = DecodeWith(request, nullptr);
  ASSERT_THAT(decoded.refused.issues, SizeIs(1));
  EXPECT_EQ(decoded.refused.issues[0].reason, Reason::kNotFound);
  EXPECT_EQ(decoded.refused.issues[0].field, "upsert.entity.primitive.mesh.vertices.positions_in");
  EXPECT_THAT(decoded.refused.issues[0].message, HasSubstr("this call has no local socket"));

  v1::ApplyUpdateRequest update;
  *update.add_operations() = request;
  const Decoded updated = DecodeUpdate(update, {});
  ASSERT_THAT(updated.refused.issues, SizeIs(1));
  EXPECT_EQ(updated.refused.issues[0].field,
            "operations[0].upsert.entity.primitive.mesh.vertices.positions_in");
}

TEST(NamedRanges, OneRequestReadsAtMostWhatMayBeUncommitted) {
  Strings memory;
  v1::StreamRequest request;
  for (int i = 0; i < 1000; ++i) {
    v1::Upsert* upsert = request.mutable_batch()->add_upserts();
    *upsert = PointsRequest().upsert();
    upsert->set_id(absl::StrCat(i));
    MoveOut(upsert->mutable_entity()->mutable_primitive()->mutable_points()->mutable_vertices(),
            &memory);
  }
  const Decoded decoded = DecodeWith(request, &memory, {.max_uncommitted_bytes = 36 * 7 + 35});
  EXPECT_THAT(decoded.operations, SizeIs(7));
  EXPECT_EQ(decoded.named_bytes, 36u * 7);
  EXPECT_EQ(memory.asked, 7) << "if out of range, it is not even requested";
  EXPECT_EQ(decoded.refused.issues.size(), 993u);
  EXPECT_EQ(decoded.refused.issues[0].reason, Reason::kQuotaExceeded);
  EXPECT_EQ(decoded.refused.issues[0].field,
            "batch.upserts[7].entity.primitive.points.vertices.positions_in.size");
  EXPECT_THAT(decoded.refused.issues[0].message,
              HasSubstr("is 36 after 252 bytes that this request has read from memory and assets; "
                        "max_uncommitted_bytes allows 287 in one"));
}

// Returns what is kept of it, as watchers receive it.
v1::Primitive Kept(const Decoded& decoded) {
  v1::Primitive out;
  Encode(std::get<Upsert>(decoded.operations.at(0).op).entity.content, &out);
  return out;
}

v1::StreamRequest VolumeRequest() {
  v1::StreamRequest request = UpsertRequest();
  v1::Grid* grid = PrimitiveOf(request)->mutable_volume()->mutable_grid();
  grid->mutable_edge_a()->set_x(2);
  grid->mutable_edge_b()->set_y(2);
  grid->mutable_edge_c()->set_z(2);
  grid->set_size_a(2);
  grid->set_size_b(2);
  grid->set_size_c(1);
  grid->set_type(v1::ELEMENT_TYPE_RGBA8);
  grid->set_samples("abcdefghijklmnop");
  return request;
}

v1::StreamRequest HeightsRequest() {
  v1::StreamRequest request = UpsertRequest();
  v1::HeightMap* map = PrimitiveOf(request)->mutable_height_map();
  map->mutable_edge_a()->set_x(4);
  map->mutable_edge_b()->set_y(4);
  map->set_columns(2);
  map->set_rows(2);
  map->set_heights(Packed<float>({0, 1, 2, 3}));
  map->set_colors("rgbRGBxyzXYZ");
  return request;
}

TEST(NamedRanges, OfAssetsAreReadAsPayloadsAre) {
  v1::StreamRequest request = MeshRequest();
  VerticesOf(request)->set_colors("rgbRGBxyz");
  const Decoded want = Decode(request);
  Contents assets;
  v1::Vertices* vertices = VerticesOf(request);
  assets.Move(vertices->mutable_positions(), vertices->mutable_positions_in());
  assets.Move(vertices->mutable_colors(), vertices->mutable_colors_in());
  const Decoded got = DecodeWith(request, nullptr, {}, &assets);
  ExpectSame(got, want);
  EXPECT_EQ(got.named_bytes, 36u + 9u);

  v1::ApplyUpdateRequest update;
  *update.add_operations() = request;
  EXPECT_THAT(DecodeUpdate(update, {}, nullptr, {nullptr, &assets}).refused.issues, IsEmpty());
}

TEST(NamedRanges, StandForSamplesHeightsAndColoursToo) {
  Contents assets;
  v1::StreamRequest volume = VolumeRequest(), heights = HeightsRequest();
  const Decoded wanted_volume = Decode(volume), wanted_heights = Decode(heights);
  ASSERT_THAT(wanted_volume.refused.issues, IsEmpty());
  ASSERT_THAT(wanted_heights.refused.issues, IsEmpty());
  v1::Grid* grid = PrimitiveOf(volume)->mutable_volume()->mutable_grid();
  assets.Move(grid->mutable_samples(), grid->mutable_samples_in());
  v1::HeightMap* map = PrimitiveOf(heights)->mutable_height_map();
  assets.Move(map->mutable_heights(), map->mutable_heights_in());
  assets.Move(map->mutable_colors(), map->mutable_colors_in());

  const Decoded got_volume = DecodeWith(volume, nullptr, {}, &assets);
  const Decoded got_heights = DecodeWith(heights, nullptr, {}, &assets);
  ASSERT_THAT(got_volume.refused.issues, IsEmpty());
  ExpectSame(got_heights, wanted_heights);
  EXPECT_EQ(Kept(got_volume).SerializeAsString(), Kept(wanted_volume).SerializeAsString())
      << "the stored form has the bytes, not names of assets that may be removed";
  EXPECT_EQ(Kept(got_heights).SerializeAsString(), Kept(wanted_heights).SerializeAsString());
  EXPECT_EQ(got_volume.named_bytes, 16u);
}

TEST(NamedRanges, OfAssetsThatAreWrong) {
  const auto issue = [](const std::function<void(v1::MemoryRange*)>& spoil, bool keeps = true) {
    Contents assets;
    v1::StreamRequest request = VolumeRequest();
    v1::Grid* grid = PrimitiveOf(request)->mutable_volume()->mutable_grid();
    assets.Move(grid->mutable_samples(), grid->mutable_samples_in());
    spoil(grid->mutable_samples_in());
    const Decoded decoded =
        DecodeWith(request, nullptr, {.max_uncommitted_bytes = 100}, keeps ? &assets : nullptr);
    EXPECT_THAT(decoded.refused.issues, SizeIs(1));
    const Issue& first = decoded.refused.issues.at(0);
    return absl::StrCat(first.field, " ", first.message);
  };
  const std::string in = "upsert.entity.primitive.volume.grid.samples_in.";
  EXPECT_THAT(issue([](auto* range) { range->set_asset("short"); }),
              HasSubstr(in + "asset asset has 5 bytes; a SHA-256 has 32"));
  EXPECT_THAT(issue([](auto* range) { range->set_memory(1); }),
              HasSubstr(in + "asset asset is set, and memory is 1"));
  EXPECT_THAT(issue([](auto* range) { range->set_asset(std::string(32, 'x')); }),
              HasSubstr(in + "asset asset is 00; gone"));
  EXPECT_THAT(issue([](auto* range) { range->set_size(17); }),
              HasSubstr(in + "size size is 9; beyond"));
  EXPECT_THAT(issue([](auto* range) { range->set_size(101); }),
              HasSubstr(in + "size size is 101 after 0 bytes"));
  EXPECT_THAT(issue([](auto*) {}, false), HasSubstr("this server keeps no assets"));
  EXPECT_THAT(issue([](auto* range) { range->set_size(15); }),
              HasSubstr("volume.grid.samples samples has 15 bytes"));
  EXPECT_THAT(issue([](auto* range) { range->clear_asset(); }),
              HasSubstr("this call has no local socket"));
}

}  // namespace named_ranges_test
}  // namespace voxeld::daemon::wire
