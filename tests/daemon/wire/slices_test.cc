// Tests bytes in any number of pieces, and corrupted bytes.
#include <gmock/gmock.h>

#include <random>

#include "absl/strings/str_cat.h"
#include "daemon/wire/encode.h"
#include "daemon/wire/slice_stream.h"
#include "tests/daemon/wire/requests.h"

namespace voxeld::daemon::wire {
namespace {

using ::testing::ElementsAreArray;
using ::testing::SizeIs;

// Returns one of everything that a stream can carry.
std::vector<std::string> Corpus() {
  std::vector<v1::StreamRequest> requests = {MeshRequest(), PointsRequest(), SegmentsRequest()};
  v1::StreamRequest* r = &requests.emplace_back(MeshRequest());
  v1::Vertices* vertices = PrimitiveOf(*r)->mutable_mesh()->mutable_vertices();
  vertices->set_index_count(6);
  vertices->set_index_type(v1::ELEMENT_TYPE_U16);
  vertices->set_indices(Packed<uint16_t>({0, 1, 2, 2, 1, 0}));
  vertices->set_colors("rgbrgbrgb");
  for (int i = 0; i < 12; ++i) {
    r->mutable_upsert()->mutable_entity()->mutable_transform()->add_m(i % 5 == 0 ? 1.5 : 0);
  }
  v1::StreamRequest shapes;
  for (int i = 0; i < 4; ++i) {
    v1::Upsert* upsert = shapes.mutable_batch()->add_upserts();
    upsert->set_layer("layer");
    upsert->set_id(absl::StrCat("shape", i));
    v1::Primitive* primitive = upsert->mutable_entity()->mutable_primitive();
    if (i == 0) primitive->mutable_sphere()->set_radius(1);
    if (i == 1) primitive->mutable_cylinder()->set_radius(1);
    if (i == 1) primitive->mutable_cylinder()->set_height(1);
    if (i == 2) primitive->mutable_box()->mutable_size()->set_x(1);
    if (i == 3) primitive->mutable_instance()->set_object("object");
  }
  requests.push_back(shapes);
  r = &requests.emplace_back();
  r->mutable_define_object()->set_object("object");
  *r->mutable_define_object()->mutable_definition()->add_parts()->mutable_primitive() =
      *PrimitiveOf(requests[3]);
  r = &requests.emplace_back();
  r->mutable_open()->set_client_name("client");
  r->mutable_open()->set_linger_ns(5);
  r->mutable_open()->set_on_disconnect(v1::DISCONNECT_POLICY_LINGER);
  r = &requests.emplace_back();
  r->mutable_layer_state()->set_layer("layer");
  r->mutable_layer_state()->set_opacity(200);
  r = &requests.emplace_back();
  r->mutable_delete_()->set_layer("layer");
  r->mutable_delete_()->set_prefix("p");
  requests.emplace_back().mutable_commit()->set_frame_id(99);
  requests.emplace_back().mutable_frame_begin()->set_layer("layer");
  std::vector<std::string> corpus;
  for (const v1::StreamRequest& request : requests) corpus.push_back(request.SerializeAsString());
  return corpus;
}

std::vector<std::string_view> Cut(std::string_view bytes, std::mt19937& random) {
  std::vector<std::string_view> slices;
  while (!bytes.empty()) {
    const size_t size = std::min<size_t>(bytes.size(), random() % 20);
    slices.push_back(bytes.substr(0, size));  // empty ones too
    bytes.remove_prefix(size);
  }
  return slices;
}

TEST(Slices, CutAnywhereDecodeTheSame) {
  std::mt19937 random(1);
  for (const std::string& bytes : Corpus()) {
    const Decoded whole = DecodeBytes(bytes);
    ASSERT_TRUE(whole.status.ok());
    for (int round = 0; round < 50; ++round) {
      const Decoded cut = DecodeStreamRequest(Cut(bytes, random), {}, 0);
      ASSERT_TRUE(cut.status.ok());
      ASSERT_THAT(cut.operations, SizeIs(whole.operations.size()));
      ASSERT_THAT(cut.refused.issues, SizeIs(whole.refused.issues.size()));
      ASSERT_EQ(cut.open.has_value(), whole.open.has_value());
      for (size_t i = 0; i < cut.operations.size(); ++i) {
        ASSERT_EQ(cut.operations[i].op.index(), whole.operations[i].op.index());
        const auto* a = std::get_if<Upsert>(&cut.operations[i].op);
        const auto* b = std::get_if<Upsert>(&whole.operations[i].op);
        if (a == nullptr || !std::holds_alternative<GeometryPtr>(a->entity.content)) continue;
        const GeometryData& x = *std::get<GeometryPtr>(a->entity.content);
        const GeometryData& y = *std::get<GeometryPtr>(b->entity.content);
        ASSERT_THAT(x.arrays.positions(), ElementsAreArray(y.arrays.positions()));
        ASSERT_THAT(x.arrays.indices(), ElementsAreArray(y.arrays.indices()));
        ASSERT_THAT(x.arrays.colors(), ElementsAreArray(y.arrays.colors()));
      }
    }
  }
}

TEST(Slices, StreamGivesBackAndSkips) {
  const std::string_view slices[] = {"abc", "", "defg", "h"};
  SliceStream stream(slices);
  const void* data = nullptr;
  int size = 0;
  ASSERT_TRUE(stream.Next(&data, &size));
  EXPECT_EQ(std::string_view(static_cast<const char*>(data), size), "abc");
  stream.BackUp(1);
  EXPECT_EQ(stream.ByteCount(), 2);
  EXPECT_TRUE(stream.Skip(2));
  ASSERT_TRUE(stream.Next(&data, &size));
  EXPECT_EQ(std::string_view(static_cast<const char*>(data), size), "efg");
  EXPECT_TRUE(stream.Skip(1));
  EXPECT_FALSE(stream.Next(&data, &size));
  EXPECT_FALSE(stream.Skip(1));
  EXPECT_EQ(stream.ByteCount(), 8);
}

void Mutate(std::string& bytes, std::mt19937& random) {
  for (unsigned n = 1 + random() % 2; n > 0 && !bytes.empty(); --n) {
    const size_t at = random() % bytes.size();
    switch (random() % 5) {
      case 0:
        bytes[at] = static_cast<char>(random());
        break;
      case 1:
        bytes[at] = static_cast<char>(bytes[at] ^ (1 << random() % 8));
        break;
      case 2:
        bytes.erase(at, 1 + random() % 8);
        break;
      case 3:
        bytes.insert(at, 1 + random() % 8, static_cast<char>(random()));
        break;
      case 4:
        bytes.insert(at, bytes.substr(random() % bytes.size(), random() % 16));
        break;
    }
  }
}

// Checks, for any input: a status, issues that can be sent, and operations that hold as much as
// they state.
void CheckSound(const Decoded& decoded) {
  if (!decoded.status.ok()) {
    ASSERT_TRUE(decoded.operations.empty() && decoded.refused.issues.empty() && !decoded.open);
    return;
  }
  for (const Issue& issue : decoded.refused.issues) {
    ASSERT_FALSE(issue.field.empty());
    ASSERT_NE(issue.reason, Reason::kUnspecified);
    v1::Issue message;
    Encode(issue, &message);
    ASSERT_TRUE(v1::Issue().ParseFromString(message.SerializeAsString()));
  }
  for (const Operation& operation : decoded.operations) {
    const auto* upsert = std::get_if<Upsert>(&operation.op);
    if (upsert == nullptr || !std::holds_alternative<GeometryPtr>(upsert->entity.content)) continue;
    const GeometryData& data = *std::get<GeometryPtr>(upsert->entity.content);
    ASSERT_EQ(data.arrays.positions().size(), size_t{data.record.vertex_count} * 3);
    ASSERT_EQ(data.arrays.indices().size(), data.record.index_count);
    for (const uint32_t index : data.arrays.indices()) ASSERT_LT(index, data.record.vertex_count);
    for (int axis = 0; axis < 3; ++axis) ASSERT_LE(data.min[axis], data.max[axis]);
    ASSERT_LE(upsert->entity.priority, 126u);
  }
}

TEST(Mutations, NeverBreakTheDecoder) {
  const std::vector<std::string> corpus = Corpus();
  std::mt19937 random(20240607);
  int messages = 0;
  for (int i = 0; i < 50'000; ++i) {
    std::string bytes = corpus[random() % corpus.size()];
    Mutate(bytes, random);
    const Decoded decoded = DecodeStreamRequest(Cut(bytes, random), {}, 0);
    messages += decoded.status.ok();
    ASSERT_NO_FATAL_FAILURE(CheckSound(decoded)) << "mutation " << i;
  }
  // Enough of them passed the parser for the checks to have been exercised.
  EXPECT_GT(messages, 5'000);
}

}  // namespace
}  // namespace voxeld::daemon::wire
