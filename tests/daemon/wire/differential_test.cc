// Compares the decoder that leaves payloads in place with protobuf's own parser: whatever arrives,
// however it is divided, both must give the same result.
#include <gmock/gmock.h>
#include <google/protobuf/message.h>
#include <google/protobuf/stubs/logging.h>

#include <algorithm>
#include <cstdio>
#include <functional>
#include <limits>
#include <memory>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "daemon/wire/skeleton.h"
#include "gpu/bulk/bulk_pool.h"
#include "tests/daemon/wire/requests.h"

namespace voxeld::daemon::wire {
namespace differential_test {

using google::protobuf::FieldDescriptor;
using google::protobuf::Message;

// ------------------------------------------------------------------------------ results

template <typename T>
std::string Bytes(std::span<const T> values) {
  return std::string(reinterpret_cast<const char*>(values.data()), values.size_bytes());
}

std::string Describe(const gpu::Affine& map) { return Bytes(std::span<const double>(map.m)); }

std::string Describe(const Content& content) {
  if (const auto* instance = std::get_if<InstanceRef>(&content)) return instance->object;
  const GeometryData& g = *std::get<GeometryPtr>(content);
  // -0 and 0 are the same bound.
  std::string bounds;
  for (int axis = 0; axis < 3; ++axis) {
    absl::StrAppend(&bounds, g.min[axis] + 0.0, " ", g.max[axis] + 0.0, " ");
  }
  return absl::StrCat(Bytes(std::span(&g.record, 1)), "|", Bytes(g.arrays.positions()), "|",
                      Bytes(g.arrays.indices()), "|", Bytes(g.arrays.colors()), "|", bounds);
}

std::string Describe(const Operation& operation) {
  std::string text = absl::StrCat(operation.sequence, " ", operation.op.index(), " ");
  if (const auto* upsert = std::get_if<Upsert>(&operation.op)) {
    const EntityData& e = upsert->entity;
    absl::StrAppend(&text, upsert->layer, "/", upsert->id, "/", e.label, "/", e.priority, "/",
                    e.erase, "/", e.lifetime_ns, "/", Describe(e.transform), Describe(e.content));
  } else if (const auto* object = std::get_if<DefineObject>(&operation.op)) {
    absl::StrAppend(&text, object->object);
    for (const ObjectPart& part : object->data->parts) {
      absl::StrAppend(&text, "/", Describe(part.transform), Describe(part.content));
    }
  } else if (const auto* commit = std::get_if<Commit>(&operation.op)) {
    absl::StrAppend(&text, commit->frame_id);
  } else if (const auto* gone = std::get_if<Delete>(&operation.op)) {
    absl::StrAppend(&text, gone->layer, "/", gone->id_or_prefix);
  }
  return text;
}

// Returns everything that a decoder can return, as text.
std::vector<std::string> Describe(const Decoded& decoded) {
  std::vector<std::string> all = {absl::StrCat(static_cast<int>(decoded.status.code()), " ",
                                               std::string(decoded.status.message())),
                                  absl::StrCat("sequence ", decoded.sequence)};
  if (decoded.open) all.push_back("open " + decoded.open->client_name);
  for (const Operation& operation : decoded.operations) all.push_back(Describe(operation));
  for (const Issue& issue : decoded.refused.issues) {
    all.push_back(absl::StrCat("issue ", issue.sequence, " ", issue.layer, " ", issue.id, " ",
                               issue.field, " ", static_cast<int>(issue.reason), " ",
                               issue.message));
  }
  all.push_back(absl::StrCat("more ", decoded.refused.more));
  return all;
}

// ------------------------------------------------------------------------------------- inputs

class Generator {
 public:
  explicit Generator(uint32_t seed) : random_(seed) {}

  bool Chance(double p) { return std::uniform_real_distribution<>()(random_) < p; }
  uint32_t Below(uint32_t n) { return random_() % n; }
  std::mt19937& random() { return random_; }

  v1::StreamRequest Request() {
    v1::StreamRequest request;
    if (Chance(0.5)) request.set_sequence(Below(5));
    switch (Below(10)) {
      case 0: {
        request.mutable_define_object()->set_object("object");
        v1::Object* object = request.mutable_define_object()->mutable_definition();
        for (uint32_t n = Below(4); n > 0; --n) Fill(object->add_parts()->mutable_primitive());
        break;
      }
      case 1:
        request.mutable_commit()->set_frame_id(Below(100));
        break;
      case 2:
        request.mutable_delete_()->set_layer("layer");
        request.mutable_delete_()->set_prefix("p");
        break;
      case 3:
      case 4:
        Fill(request.mutable_upsert());
        break;
      default:
        for (uint32_t n = Below(6); n > 0; --n) Fill(request.mutable_batch()->add_upserts());
        break;
    }
    return request;
  }

  // Writes the same message in other forms that protobuf allows: fields in any order, some of them
  // twice, the first time with another value, and unknown fields.
  std::string Scramble(const Message& message) {
    std::vector<const FieldDescriptor*> fields;
    const google::protobuf::Reflection& reflection = *message.GetReflection();
    reflection.ListFields(message, &fields);
    std::vector<std::string> parts;
    for (const FieldDescriptor* field : fields) {
      if (field->cpp_type() == FieldDescriptor::CPPTYPE_MESSAGE) {
        const int count = field->is_repeated() ? reflection.FieldSize(message, field) : 1;
        std::string part;  // repeated fields keep their order
        for (int i = 0; i < count; ++i) {
          const Message& sub = field->is_repeated()
                                   ? reflection.GetRepeatedMessage(message, field, i)
                                   : reflection.GetMessage(message, field);
          part += Delimited(field->number(), Scramble(sub));
        }
        parts.push_back(part);
      } else {
        std::unique_ptr<Message> one(message.New());
        reflection.SwapFields(one.get(), const_cast<Message*>(&message), {field});
        parts.push_back(one->SerializeAsString());
        reflection.SwapFields(one.get(), const_cast<Message*>(&message), {field});
        if (field->type() == FieldDescriptor::TYPE_BYTES && Chance(0.1)) {
          parts.back() = Delimited(field->number(), std::string(Below(30), 'x')) + parts.back();
        }
      }
      if (Chance(0.05)) parts.push_back(parts.back());
    }
    if (Chance(0.1)) parts.push_back(Unknown());
    std::shuffle(parts.begin(), parts.end(), random_);
    return absl::StrJoin(parts, "");
  }

  void Mutate(std::string& bytes) {
    if (bytes.empty()) return;
    const size_t at = Below(static_cast<uint32_t>(bytes.size()));
    switch (Below(5)) {
      case 0:
        bytes[at] = static_cast<char>(random_());
        break;
      case 1:
        bytes[at] = static_cast<char>(bytes[at] ^ (1 << Below(8)));
        break;
      case 2:
        bytes.erase(at, 1 + Below(8));
        break;
      case 3:
        bytes.insert(at, 1 + Below(8), static_cast<char>(random_()));
        break;
      default:
        bytes.resize(at);
        break;
    }
  }

  std::vector<std::string_view> Cut(std::string_view bytes) {
    std::vector<std::string_view> slices;
    const uint32_t most = Chance(0.5) ? 20 : 2000;
    while (!bytes.empty()) {
      const size_t size = std::min<size_t>(bytes.size(), Below(most));
      slices.push_back(bytes.substr(0, size));
      bytes.remove_prefix(size);
    }
    return slices;
  }

 private:
  static std::string Varint(uint64_t value) {
    std::string out;
    for (; value >= 0x80; value >>= 7) out += static_cast<char>(value | 0x80);
    return out + static_cast<char>(value);
  }
  std::string Delimited(int field, const std::string& body) {
    std::string size = Varint(body.size());
    if (Chance(0.05)) {  // longer than necessary
      size.back() = static_cast<char>(size.back() | 0x80);
      size += std::string(Below(3), '\x80') + '\0';
    }
    return Varint(static_cast<uint64_t>(field) << 3 | 2) + size + body;
  }
  std::string Unknown() {
    const uint64_t field = Chance(0.5) ? 1 + Below(20) : 1 + Below(1u << 29);
    switch (Below(6)) {
      case 0:
        return Varint(field << 3) + Varint(random_());
      case 1:
        return Varint(field << 3 | 1) + std::string(8, 'a');
      case 2:
        return Varint(field << 3 | 5) + std::string(4, 'a');
      case 3:
        return Varint(field << 3 | 3) + Varint(8) + Varint(5) + Varint(field << 3 | 4);  // a group
      case 4:
        return Varint(field << 3 | 4);  // the end of a group that was not begun
      default:
        return Varint(field << 3 | 2) + Varint(3) + "abc";
    }
  }

  template <typename T>
  std::string Values(size_t count, uint32_t below) {
    std::vector<T> values(count);
    for (T& v : values) v = static_cast<T>(Below(below));
    return Packed(values);
  }

  void Fill(v1::Vertices* out) {
    const uint32_t count = Chance(0.1) ? Below(400) : Below(12);
    const uint32_t indices = Chance(0.5) ? 3 * Below(5) : 0;
    out->set_count(Chance(0.03) ? Below(100) : count);
    switch (Below(4)) {
      case 0:
        out->set_position_type(v1::ELEMENT_TYPE_I16);
        out->set_positions(Values<int16_t>(3 * count, 65536));
        break;
      case 1:
        out->set_position_type(v1::ELEMENT_TYPE_I32);
        out->set_positions(Values<int32_t>(3 * count, Chance(0.05) ? 1u << 31 : 1u << 24));
        break;
      default: {
        std::vector<float> values(3 * count);
        std::uniform_real_distribution<float> any(-100, 100);
        for (float& v : values) v = Chance(0.05) ? -0.0f : any(random_);
        if (count > 0 && Chance(0.05)) {
          values[Below(3 * count)] = Chance(0.5) ? std::numeric_limits<float>::infinity()
                                                 : std::numeric_limits<float>::quiet_NaN();
        }
        out->set_positions(Packed(values));
      }
    }
    if (indices > 0) {
      out->set_index_count(indices);
      const uint32_t below = std::max(1u, count) + (Chance(0.05) ? 2 : 0);
      if (Chance(0.5)) {
        out->set_index_type(v1::ELEMENT_TYPE_U16);
        out->set_indices(Values<uint16_t>(indices, below));
      } else {
        out->set_indices(Values<uint32_t>(indices, below));
      }
    }
    if (Chance(0.5)) {
      const bool four = Chance(0.5);
      if (four) out->set_color_type(v1::ELEMENT_TYPE_RGBX8);
      uint32_t colors = count;
      if (Chance(0.3)) {  // of triangles, of pairs, of all but one: valid for some
        out->set_colors_of(Chance(0.05) ? static_cast<v1::Vertices::ColorsOf>(Below(9))
                                        : v1::Vertices::ELEMENTS);
        const uint32_t corners = indices > 0 ? indices : count;
        const uint32_t elements[] = {corners / 3, corners / 2, corners > 0 ? corners - 1 : 0};
        colors = elements[Below(3)];
      }
      out->set_colors(Values<uint8_t>(size_t{four ? 4u : 3u} * colors, 256));
    }
  }

  void Fill(v1::Thickness* out) {
    out->set_value(Chance(0.1)   ? std::numeric_limits<float>::quiet_NaN()
                   : Chance(0.1) ? -1.5f
                                 : static_cast<float>(Below(6000)));
    out->set_unit(static_cast<v1::Thickness::Unit>(Below(Chance(0.05) ? 9 : 3)));
  }

  // Makes curves of any form, sometimes with too few points, or with ends that do not ascend.
  void Fill(v1::Boundary* out) {
    out->set_form(static_cast<v1::Boundary::Form>(Below(Chance(0.05) ? 9 : 4)));
    out->set_axis(static_cast<v1::Boundary::Axis>(Below(Chance(0.05) ? 9 : 4)));
    const uint32_t count = Below(20);
    std::uniform_real_distribution<double> any(-3, 3);
    for (uint32_t i = 0; i < 3 * count; ++i) {
      out->add_points(Chance(0.01) ? std::numeric_limits<double>::infinity() : any(random_));
    }
    if (Chance(0.3)) out->mutable_points()->Truncate(static_cast<int>(Below(3 * count + 1)));
    for (uint32_t end = Below(8); end <= count && Chance(0.7); end += Below(8)) out->add_ends(end);
  }

  void Fill(v1::Primitive* out) {
    switch (Below(7)) {
      case 0:
        Fill(out->mutable_points()->mutable_vertices());
        break;
      case 1:
      case 2:
        Fill(out->mutable_segments()->mutable_vertices());
        if (Chance(0.5)) out->mutable_segments()->set_topology(v1::Segments::STRIP);
        break;
      case 3:
      case 4:
        Fill(out->mutable_mesh()->mutable_vertices());
        if (Chance(0.3)) Fill(out->mutable_mesh()->mutable_shell());
        if (Chance(0.3)) out->mutable_mesh()->set_fill(static_cast<v1::Fill>(Below(6)));
        break;
      case 5:
        out->mutable_implicit()->mutable_surface()->set_text("z = sin(x)");
        Fill(out->mutable_implicit()->mutable_boundary());
        break;
      default:
        out->mutable_sphere()->set_radius(1);
        break;
    }
    if (Chance(0.2)) out->mutable_color()->set_rgb(Below(1u << 25));
  }

  void Fill(v1::Upsert* out) {
    out->set_layer("layer");
    out->set_id(absl::StrCat("id", Below(10)));
    v1::Entity* entity = out->mutable_entity();
    if (Chance(0.9)) Fill(entity->mutable_primitive());
    entity->set_priority(Below(130));
    if (Chance(0.2)) entity->set_label("a label");
    if (Chance(0.2)) {
      for (int i = 0; i < 12; ++i) entity->mutable_transform()->add_m(i % 5 == 0 ? 1.5 : 0);
    }
  }

  std::mt19937 random_;
};

struct Tally {
  int good = 0, refused = 0, bare = 0;
};

// Decodes `bytes` in both ways; the second does not use skeletons or slices.
void ExpectAlike(const std::string& bytes, Generator& generator, gpu::BulkPool* pool,
                 Tally* tally) {
  const std::vector<std::string_view> slices = generator.Cut(bytes);
  const Decoded decoded = DecodeStreamRequest(slices, {}, 2, pool);
  const google::protobuf::LogSilencer silence;  // of refused messages
  v1::StreamRequest request;
  Skeleton skeleton;
  tally->bare += MakeSkeleton(slices, Root::kStreamRequest, &skeleton);
  if (!request.ParseFromString(bytes)) {
    ASSERT_EQ(decoded.status.code(), absl::StatusCode::kInvalidArgument);
    ASSERT_THAT(std::string(decoded.status.message()), testing::HasSubstr("malformed protobuf"));
    ++tally->refused;
    return;
  }
  ASSERT_THAT(Describe(decoded),
              testing::ElementsAreArray(Describe(DecodeStreamRequest(request, {}, 2))));
  ++tally->good;
}

TEST(Differential, AnyWayToWriteAMessageMeansTheSame) {
  const auto pool = gpu::BulkPool::Create();
  Tally tally;
  for (uint32_t seed = 1; seed <= 4000; ++seed) {
    SCOPED_TRACE(seed);
    Generator generator(seed);
    std::string bytes;
    // Adjacent ranges are merged.
    for (uint32_t n = 1 + generator.Below(3); n > 0; --n) {
      bytes += generator.Scramble(generator.Request());
    }
    ASSERT_NO_FATAL_FAILURE(ExpectAlike(bytes, generator, pool.get(), &tally));
  }
  std::printf("%d messages, %d refused, %d without their payloads\n", tally.good, tally.refused,
              tally.bare);
  EXPECT_GT(tally.good, 2500);
  EXPECT_GT(tally.bare, 2000);
  EXPECT_EQ(pool->used_bytes(), 0u);
}

TEST(Differential, WhatIsDamagedIsRefusedAlikeOrMeansTheSame) {
  const auto pool = gpu::BulkPool::Create();
  Tally tally;
  for (uint32_t seed = 1; seed <= 12000; ++seed) {
    SCOPED_TRACE(seed);
    Generator generator(seed);
    std::string bytes = generator.Scramble(generator.Request());
    for (uint32_t n = 1 + generator.Below(3); n > 0; --n) generator.Mutate(bytes);
    ASSERT_NO_FATAL_FAILURE(ExpectAlike(bytes, generator, pool.get(), &tally));
  }
  std::printf("%d messages, %d refused, %d without their payloads\n", tally.good, tally.refused,
              tally.bare);
  EXPECT_GT(tally.good, 2000);
  EXPECT_GT(tally.refused, 2000);
}

TEST(Differential, UpdatesToo) {
  for (uint32_t seed = 1; seed <= 500; ++seed) {
    SCOPED_TRACE(seed);
    Generator generator(seed);
    v1::ApplyUpdateRequest update;
    for (uint32_t n = generator.Below(4); n > 0; --n) {
      *update.add_operations() = generator.Request();
    }
    const std::string bytes = generator.Scramble(update);
    const google::protobuf::LogSilencer silence;
    v1::ApplyUpdateRequest parsed;
    if (!parsed.ParseFromString(bytes)) continue;
    ASSERT_THAT(Describe(DecodeUpdate(generator.Cut(bytes), {})),
                testing::ElementsAreArray(Describe(DecodeUpdate(parsed, {}))));
  }
}

// Calls `found` for each path from a message to a bytes field of Vertices.
using Way = std::vector<const FieldDescriptor*>;
void ForEachWay(const google::protobuf::Descriptor& from, Way& way,
                const std::function<void(const Way&)>& found) {
  for (int i = 0; i < from.field_count(); ++i) {
    way.push_back(from.field(i));
    if (from.field(i)->message_type() != nullptr) {
      ForEachWay(*from.field(i)->message_type(), way, found);
    } else if (&from == v1::Vertices::descriptor() &&
               from.field(i)->type() == FieldDescriptor::TYPE_BYTES) {
      found(way);
    }
    way.pop_back();
  }
}

// A new path to a payload needs a line there: otherwise the decoder takes every payload for a
// token.
TEST(Skeleton, KnowsEveryWayToAPayload) {
  int ways = 0;
  const auto check = [&](const Message& root, Root kind) {
    Way way;
    ForEachWay(*root.GetDescriptor(), way, [&](const Way& steps) {
      ++ways;
      const std::string payload(5000, 'p');
      std::unique_ptr<Message> message(root.New());
      Message* at = message.get();
      for (const FieldDescriptor* step : steps) {
        const google::protobuf::Reflection& reflection = *at->GetReflection();
        if (step->message_type() == nullptr) {
          reflection.SetString(at, step, payload);
        } else {
          at = step->is_repeated() ? reflection.AddMessage(at, step)
                                   : reflection.MutableMessage(at, step);
        }
      }
      const std::string bytes = message->SerializeAsString();
      const std::string_view view = bytes;
      Skeleton skeleton;
      ASSERT_TRUE(MakeSkeleton(std::span(&view, 1), kind, &skeleton));
      EXPECT_LT(skeleton.bytes.size(), 100u) << steps.front()->full_name();
    });
  };
  check(v1::StreamRequest(), Root::kStreamRequest);
  EXPECT_EQ(ways, 3 * 5 * 3) << "requests, primitives, arrays";
  check(v1::ApplyUpdateRequest(), Root::kApplyUpdateRequest);
  EXPECT_EQ(ways, 2 * 3 * 5 * 3);
}

TEST(Skeleton, IsNotWorthWhileForSmallThings) {
  v1::StreamRequest request;
  for (int i = 0; i < 20'000; ++i) {
    v1::Upsert* upsert = request.mutable_batch()->add_upserts();
    upsert->set_layer("layer");
    upsert->set_id(absl::StrCat("id", i));
    *upsert->mutable_entity()->mutable_primitive()->mutable_mesh()->mutable_vertices() = Triangle();
  }
  const std::string bytes = request.SerializeAsString();
  const std::string_view view = bytes;
  Skeleton skeleton;
  EXPECT_FALSE(MakeSkeleton(std::span(&view, 1), Root::kStreamRequest, &skeleton));
  EXPECT_LT(skeleton.bytes.size(), bytes.size() / 2);
  EXPECT_EQ(DecodeBytes(bytes).operations.size(), 20'000u);
}

}  // namespace differential_test
}  // namespace voxeld::daemon::wire
