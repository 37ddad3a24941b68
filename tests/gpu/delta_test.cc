#include "gpu/delta.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "gpu/bulk/bulk_pool.h"
#include "gpu/geometry_arrays.h"
#include "gpu/primitives/samples.h"

namespace voxeld::gpu {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

// 16-byte aligned memory.
struct Block {
  explicit Block(size_t size) : chunks((size + 15) / 16), size(size) {}
  std::span<std::byte> bytes() { return {reinterpret_cast<std::byte*>(chunks.data()), size}; }
  struct alignas(16) Chunk {
    std::byte bytes[16];
  };
  std::vector<Chunk> chunks;
  size_t size;
};

// Records what it is shown.
struct Recorder final : DeltaVisitor {
  absl::Status OnGeometry(const GeometryView& g) override {
    log.push_back("geometry " + std::to_string(g.record.id));
    positions.assign(g.positions.begin(), g.positions.end());
    indices.assign(g.indices.begin(), g.indices.end());
    colors.assign(g.colors.begin(), g.colors.end());
    return absl::OkStatus();
  }
  absl::Status OnDrawable(const DrawableRecord& d) override {
    log.push_back("drawable " + std::to_string(d.id));
    return absl::OkStatus();
  }
  absl::Status OnLayer(const LayerRecord& l) override {
    log.push_back("layer " + std::to_string(l.id));
    return absl::OkStatus();
  }
  absl::Status OnDrop(Op op, uint64_t id) override {
    log.push_back("drop " + std::to_string(static_cast<int>(op)) + " " + std::to_string(id));
    return absl::OkStatus();
  }
  absl::Status OnReset() override {
    log.push_back("reset");
    return absl::OkStatus();
  }
  std::vector<std::string> log;
  std::vector<float> positions;
  std::vector<uint32_t> indices, colors;
};

GeometryRecord Mesh() {
  GeometryRecord g;
  g.id = 4;
  g.kind = PrimitiveKind::kTriangles;
  g.color_mode = ColorMode::kPerVertex;
  g.vertex_count = 4;
  g.index_count = 6;
  return g;
}
const std::vector<float> kPositions = {0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0};
const std::vector<uint32_t> kIndices = {0, 1, 2, 0, 2, 3};
const std::vector<uint32_t> kColors = {1, 2, 3, 4};

absl::Status Read(std::span<const std::byte> bytes) {
  Recorder recorder;
  return ReadDelta(bytes, recorder);
}

// Reads a delta of one geometry, drawable or layer, which `change` changes before it is written.
absl::Status ReadGeometryWith(const std::function<void(GeometryRecord&)>& change) {
  GeometryRecord g = Mesh();
  const size_t size = DeltaWriter::SizeOf(g);
  change(g);
  Block block(size);
  DeltaWriter writer(block.bytes());
  writer.PutGeometry(g, kPositions, kIndices, kColors);
  // The header states what the changed record would need, as an honest writer would.
  const uint64_t honest = size;
  std::memcpy(block.bytes().data() + offsetof(RecordHeader, size), &honest, sizeof(honest));
  return Read(block.bytes());
}

// A delta that refers to the arrays of its only geometry.
struct BulkDelta {
  BulkDelta() : block(DeltaWriter::kSizeOfBulkGeometry) {
    GeometryArrays arrays = *GeometryArrays::Allocate(Mesh(), nullptr);
    EXPECT_FALSE(arrays.block());  // it is small
    const ArrayLayout layout = ArrayLayout::Of(Mesh());
    BulkPool::Fresh fresh = *pool->Allocate(layout.size);
    const auto put = [&](uint64_t at, const auto& values) {
      std::memcpy(fresh.bytes.data() + at, values.data(), values.size() * 4);
    };
    put(0, kPositions);
    put(layout.indices, kIndices);
    put(layout.colors, kColors);
    DeltaWriter writer(block.bytes());
    writer.PutGeometry(Mesh(), fresh.block);
    EXPECT_EQ(writer.size(), block.size);
    referred = writer.TakeReferred();
  }
  absl::Status Read(Recorder& recorder) {
    BlockSource source(referred);
    return ReadDelta(block.bytes(), recorder, &source);
  }
  BulkRef* ref() {
    return reinterpret_cast<BulkRef*>(block.bytes().data() + block.size - sizeof(BulkRef));
  }

  std::shared_ptr<BulkPool> pool = BulkPool::Create();
  Block block;
  std::vector<BulkBlock> referred;
};

TEST(Delta, ArraysMayLieInBulkMemory) {
  BulkDelta delta;
  Recorder recorder;
  ASSERT_TRUE(delta.Read(recorder).ok());
  EXPECT_EQ(recorder.positions, kPositions);
  EXPECT_EQ(recorder.indices, kIndices);
  EXPECT_EQ(recorder.colors, kColors);
}

TEST(Delta, BulkMemoryMustBeThereAndLargeEnough) {
  const auto refusal = [](const std::function<void(BulkDelta&)>& spoil) {
    BulkDelta delta;
    spoil(delta);
    Recorder recorder;
    const absl::Status status = delta.Read(recorder);
    EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument);
    EXPECT_TRUE(recorder.log.empty());
    return std::string(status.message());
  };
  EXPECT_THAT(refusal([](BulkDelta& d) { d.referred.clear(); }), HasSubstr("no block"));
  EXPECT_THAT(refusal([](BulkDelta& d) { ++d.ref()->segment; }), HasSubstr("no block"));
  EXPECT_THAT(refusal([](BulkDelta& d) { d.ref()->offset += 64; }), HasSubstr("no block"));
  EXPECT_THAT(refusal([](BulkDelta& d) { d.ref()->offset += 8; }), HasSubstr("multiple of 16"));
  EXPECT_THAT(refusal([](BulkDelta& d) { d.ref()->size = 80; }), HasSubstr("bulk.size is 80"));
  EXPECT_THAT(refusal([](BulkDelta& d) { d.ref()->size = 1 << 20; }), HasSubstr("has 128 bytes"));
  BulkDelta delta;
  EXPECT_THAT(std::string(Read(delta.block.bytes()).message()), HasSubstr("there is none"));
}

TEST(GeometryArrays, LargeOnesLieInBulkMemory) {
  const auto pool = BulkPool::Create({.limit_bytes = 4096, .segment_bytes = 4096});
  GeometryRecord record;
  record.vertex_count = 100;
  GeometryArrays arrays = *GeometryArrays::Allocate(record, pool.get());
  ASSERT_TRUE(arrays.block());
  EXPECT_EQ(static_cast<const void*>(arrays.positions().data()),
            static_cast<const void*>(arrays.block().bytes().data()));
  EXPECT_EQ(arrays.positions().size(), 300u);
  EXPECT_TRUE(arrays.indices().empty() && arrays.colors().empty());
  record.vertex_count = 1000;
  EXPECT_EQ(GeometryArrays::Allocate(record, pool.get()).status().code(),
            absl::StatusCode::kResourceExhausted);
  record.vertex_count = 2;
  record.color_mode = ColorMode::kPerVertex;
  arrays = *GeometryArrays::Allocate(record, pool.get());
  EXPECT_FALSE(arrays.block());
  EXPECT_EQ(arrays.colors().size(), 2u);
}

TEST(Delta, WritesEveryRecordAndReadsItBack) {
  const GeometryRecord mesh = Mesh();
  const DrawableRecord drawable{.id = 5, .geometry = 4, .layer = 6};
  const LayerRecord layer{.id = 6};
  Block block(DeltaWriter::kSizeOfReset + DeltaWriter::SizeOf(mesh) +
              DeltaWriter::SizeOf(drawable) + DeltaWriter::SizeOf(layer) +
              3 * DeltaWriter::kSizeOfId);
  DeltaWriter writer(block.bytes());
  writer.Reset();
  writer.PutLayer(layer);
  writer.PutGeometry(mesh, kPositions, kIndices, kColors);
  writer.PutDrawable(drawable);
  writer.Drop(Op::kDropDrawable, 5);
  writer.Drop(Op::kDropGeometry, 4);
  writer.Drop(Op::kDropLayer, 6);
  EXPECT_FALSE(writer.overrun());
  EXPECT_EQ(writer.size(), block.size);
  Recorder recorder;
  ASSERT_TRUE(ReadDelta(block.bytes(), recorder).ok());
  EXPECT_THAT(recorder.log, ElementsAre("reset", "layer 6", "geometry 4", "drawable 5", "drop 4 5",
                                        "drop 2 4", "drop 6 6"));
  EXPECT_EQ(recorder.positions, kPositions);
  EXPECT_EQ(recorder.indices, kIndices);
  EXPECT_EQ(recorder.colors, kColors);
}

// Header 16, record 96, positions 48, indices 24 padded to 32, colours 16.
TEST(Delta, SizesAreAsCountedByHand) {
  EXPECT_EQ(DeltaWriter::SizeOf(Mesh()), 208u);
  EXPECT_EQ(DeltaWriter::SizeOf(GeometryRecord{}), 112u);
  EXPECT_EQ(DeltaWriter::SizeOf(DrawableRecord{}), 160u);
  EXPECT_EQ(DeltaWriter::SizeOf(LayerRecord{}), 1232u);
  EXPECT_EQ(DeltaWriter::kSizeOfId, 32u);
  EXPECT_EQ(DeltaWriter::kSizeOfReset, 16u);
}

TEST(Delta, CurvesHaveAsManyPointsAsTheyNeed) {
  const auto read = [](PrimitiveKind kind, Topology topology, uint32_t points) {
    GeometryRecord g;
    g.id = 1;
    g.kind = kind;
    g.topology = topology;
    g.vertex_count = points;
    const std::vector<float> positions(size_t{points} * 3);
    Block block(DeltaWriter::SizeOf(g));
    DeltaWriter writer(block.bytes());
    writer.PutGeometry(g, positions, {}, {});
    return Read(block.bytes());
  };
  EXPECT_TRUE(read(PrimitiveKind::kCurves, Topology::kList, 8).ok());
  EXPECT_TRUE(read(PrimitiveKind::kCurves, Topology::kStrip, 7).ok());
  EXPECT_TRUE(read(PrimitiveKind::kPatches, Topology::kList, 32).ok());
  EXPECT_THAT(std::string(read(PrimitiveKind::kCurves, Topology::kList, 7).message()),
              HasSubstr("vertex_count is 7, must be a multiple of 4"));
  EXPECT_THAT(std::string(read(PrimitiveKind::kCurves, Topology::kStrip, 8).message()),
              HasSubstr("vertex_count is 8, must be 3 a curve and 1"));
  EXPECT_THAT(std::string(read(PrimitiveKind::kCurves, Topology::kLoop, 4).message()),
              HasSubstr("topology is 2"));
  EXPECT_THAT(std::string(read(PrimitiveKind::kPatches, Topology::kList, 17).message()),
              HasSubstr("vertex_count is 17, must be a multiple of 16"));
}

TEST(Delta, SamplesAreLookedAt) {
  SampleHead head = {};
  head.size[0] = 3, head.size[1] = 2, head.size[2] = 1;
  head.format = SampleFormat::kU16;
  head.bricks = 1;
  std::vector<uint32_t> words(12 + 256 + 1 + 3);
  const auto message = [&](auto spoil) {
    SampleHead spoilt = head;
    spoil(spoilt);
    std::memcpy(words.data(), &spoilt, sizeof(spoilt));
    GeometryRecord g;
    g.id = 1;
    g.kind = PrimitiveKind::kSamples;
    g.index_count = static_cast<uint32_t>(words.size());
    Block block(DeltaWriter::SizeOf(g));
    DeltaWriter writer(block.bytes());
    writer.PutGeometry(g, {}, words, {});
    return std::string(Read(block.bytes()).message());
  };
  EXPECT_EQ(message([](SampleHead&) {}), "");
  EXPECT_THAT(message([](SampleHead& h) { h.size[1] = 0; }),
              HasSubstr("samples.size is 0, must be 1 to"));
  EXPECT_THAT(message([](SampleHead& h) { h.size[0] = 4; }),
              HasSubstr("samples.words is 272, must be 273"));
  EXPECT_THAT(message([](SampleHead& h) { h.size[2] = 65536; }), HasSubstr("samples.bricks is 1"));
  EXPECT_THAT(message([](SampleHead& h) { h.format = static_cast<SampleFormat>(4); }),
              HasSubstr("samples.format is 4"));
  EXPECT_THAT(message([](SampleHead& h) { h.filter = static_cast<SampleFilter>(2); }),
              HasSubstr("samples.filter is 2"));
  EXPECT_THAT(message([](SampleHead& h) {
                h.by_level = 1;
                h.format = SampleFormat::kRgba8;
              }),
              HasSubstr("samples.by_level is 1, must be 0 for colours"));
  EXPECT_THAT(message([](SampleHead& h) { h.by_level = 3; }),
              HasSubstr("samples.by_level is 3, must be 0 to 2"));
  EXPECT_THAT(message([](SampleHead& h) { h.scale = 1.0f / 0.0f; }), HasSubstr("finite"));
  words.resize(5);
  GeometryRecord g;
  g.id = 1;
  g.kind = PrimitiveKind::kSamples;
  g.index_count = 5;
  Block block(DeltaWriter::SizeOf(g));
  DeltaWriter writer(block.bytes());
  writer.PutGeometry(g, {}, words, {});
  EXPECT_THAT(std::string(Read(block.bytes()).message()),
              HasSubstr("samples.words is 5, must be 12 at least"));
}

TEST(Delta, ProgramsAreLookedAt) {
  // P = x, in slot 0.
  std::vector<uint32_t> words(14);
  words[0] = 1;   // instructions of the surface
  words[12] = 1;  // x
  const auto read = [&] {
    GeometryRecord g;
    g.id = 1;
    g.kind = PrimitiveKind::kImplicit;
    g.index_count = static_cast<uint32_t>(words.size());
    Block block(DeltaWriter::SizeOf(g));
    DeltaWriter writer(block.bytes());
    writer.PutGeometry(g, {}, words, {});
    return Read(block.bytes());
  };
  EXPECT_TRUE(read().ok()) << read();
  words[12] = 200;
  EXPECT_THAT(std::string(read().message()),
              HasSubstr("record at byte 0: program: surface, instruction 0: op is 200"));
  words[12] = 1 | 99 << 8;
  EXPECT_THAT(std::string(read().message()), HasSubstr("slot is 99"));
  words.pop_back();
  EXPECT_THAT(std::string(read().message()), HasSubstr("size is 13, must be 14 words"));
}

TEST(Delta, AnOverrunIsCountedAndNotWritten) {
  Block block(48);
  std::fill(block.bytes().begin(), block.bytes().end(), std::byte{0xEE});
  DeltaWriter writer(block.bytes().first(32));
  writer.PutLayer({.id = 1});
  EXPECT_TRUE(writer.overrun());
  EXPECT_EQ(writer.size(), 1232u);
  for (std::byte b : block.bytes().last(16)) EXPECT_EQ(b, std::byte{0xEE});
}

TEST(Delta, EmptyIsNothing) { EXPECT_TRUE(Read({}).ok()); }

TEST(Delta, RefusesBrokenHeadersWithOffsetAndValue) {
  Block block(48);
  DeltaWriter writer(block.bytes());
  writer.Reset();
  writer.Drop(Op::kDropLayer, 1);
  const auto with = [&](size_t at, auto value) {
    Block copy = block;
    std::memcpy(copy.bytes().data() + at, &value, sizeof(value));
    return std::string(Read(copy.bytes()).message());
  };
  EXPECT_THAT(with(16, uint32_t{9}), HasSubstr("record at byte 16: header.op is 9"));
  EXPECT_THAT(with(24, uint64_t{0}), HasSubstr("record at byte 16: header.size is 0"));
  EXPECT_THAT(with(24, uint64_t{24}), HasSubstr("header.size is 24"));
  EXPECT_THAT(with(24, uint64_t{48}), HasSubstr("header.size is 48, must be a multiple of 16 from "
                                                "16 to 32"));
  EXPECT_THAT(with(24, std::numeric_limits<uint64_t>::max() - 15), HasSubstr("byte 16"));
  EXPECT_THAT(with(8, uint64_t{32}), HasSubstr("reset.size is 32, must be 16"));
  EXPECT_THAT(with(24, uint64_t{16}), HasSubstr("drop.size is 16, must be 32"));
  EXPECT_THAT(std::string(Read(block.bytes().first(40)).message()), HasSubstr("header.size is 32"));
  EXPECT_THAT(std::string(Read(block.bytes().first(20)).message()), HasSubstr("cut off"));
  EXPECT_THAT(std::string(Read(block.bytes().subspan(8, 16)).message()), HasSubstr("aligned"));
}

TEST(Delta, RefusesGeometriesThatDoNotHoldTogether) {
  const auto message = [](const std::function<void(GeometryRecord&)>& change) {
    const absl::Status status = ReadGeometryWith(change);
    EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument);
    return std::string(status.message());
  };
  EXPECT_TRUE(ReadGeometryWith([](GeometryRecord&) {}).ok());
  using G = GeometryRecord;
  EXPECT_THAT(message([](G& g) { g.kind = static_cast<PrimitiveKind>(12); }),
              HasSubstr("record at byte 0: geometry.kind is 12, must be 1 to 11"));
  EXPECT_THAT(message([](G& g) { g.kind = PrimitiveKind::kCurves; }),
              HasSubstr("index_count is 6, must be 0 for curves"));
  EXPECT_THAT(message([](G& g) { g.kind = PrimitiveKind::kSamples; }),
              HasSubstr("must be 0 for samples"));
  EXPECT_THAT(message([](G& g) { g.kind = PrimitiveKind::kFilled; }),
              HasSubstr("color_mode is 1, must be 0 for a filled mesh"));
  EXPECT_THAT(message([](G& g) { g.texture_width = 5; }),
              HasSubstr("geometry.texture_height is 0, must be 1 to 8192"));
  EXPECT_THAT(message([](G& g) { g.texture_width = 8193, g.texture_height = 1; }),
              HasSubstr("geometry.texture_width is 8193, must be 1 to 8192"));
  EXPECT_THAT(message([](G& g) {
                g.kind = PrimitiveKind::kSegments;
                g.texture_width = g.texture_height = 1;
              }),
              HasSubstr("texture_width is 1, must be 0 for what is no triangles"));
  EXPECT_THAT(message([](G& g) { g.splat = static_cast<Splat>(4); }),
              HasSubstr("splat is 4, must be 0 to 3"));
  EXPECT_THAT(message([](G& g) { g.kind = PrimitiveKind::kImplicit; }),
              HasSubstr("geometry.color_mode is 1, must be 0 for a program"));
  EXPECT_THAT(message([](G& g) { g.kind = static_cast<PrimitiveKind>(0); }),
              HasSubstr("kind is 0"));
  EXPECT_THAT(message([](G& g) { g.color_mode = static_cast<ColorMode>(2); }),
              HasSubstr("color_mode is 2"));
  EXPECT_THAT(message([](G& g) { g.sampling = static_cast<LineSampling>(3); }),
              HasSubstr("sampling is 3"));
  EXPECT_THAT(message([](G& g) { g.rule = static_cast<SurfaceRule>(2); }), HasSubstr("rule is 2"));
  EXPECT_THAT(message([](G& g) { g.fill = static_cast<Fill>(2); }), HasSubstr("fill is 2"));
  EXPECT_THAT(message([](G& g) { g.topology = static_cast<Topology>(3); }),
              HasSubstr("topology is 3"));
  EXPECT_THAT(message([](G& g) { g.thickness_unit = static_cast<ThicknessUnit>(2); }),
              HasSubstr("thickness_unit is 2"));
  EXPECT_THAT(message([](G& g) { g.thickness = -1; }), HasSubstr("thickness is -1"));
  EXPECT_THAT(message([](G& g) { g.thickness = NAN; }), HasSubstr("thickness[0] is nan"));
  EXPECT_THAT(message([](G& g) { g.params[2] = INFINITY; }), HasSubstr("params[2] is inf"));
  EXPECT_THAT(message([](G& g) { g.index_count = 5; }),
              HasSubstr("index_count is 5, must be a multiple of 3"));
  EXPECT_THAT(
      message([](G& g) { g.vertex_count = 2; }),
      HasSubstr("geometry.size is 208, must be 192 for 2 vertices, 6 indices and 2 colours"));
  EXPECT_THAT(message([](G& g) { g.vertex_count = 0xFFFFFFFF; }),
              HasSubstr("4294967295 vertices, 6 indices and 4294967295 colours"));
  EXPECT_THAT(message([](G& g) {
                g.kind = PrimitiveKind::kSegments;
                g.index_count = 5;
              }),
              HasSubstr("index_count is 5, must be even"));
  EXPECT_THAT(message([](G& g) { g.kind = PrimitiveKind::kBox; }),
              HasSubstr("vertex_count is 4, must be 0 for a solid"));
}

TEST(Delta, RefusesBadArraysAndSolids) {
  const auto message = [](const GeometryRecord& g, std::vector<float> positions,
                          std::vector<uint32_t> indices) {
    Block block(DeltaWriter::SizeOf(g));
    DeltaWriter writer(block.bytes());
    writer.PutGeometry(g, positions, indices, {});
    return std::string(Read(block.bytes()).message());
  };
  GeometryRecord points;
  points.vertex_count = 1;
  EXPECT_EQ(message(points, {1, 2, 3}, {}), "");
  EXPECT_THAT(message(points, {1, NAN, 3}, {}), HasSubstr("positions[1] is nan, must be finite"));
  points.index_count = 2;
  EXPECT_THAT(message(points, {1, 2, 3}, {0, 1}),
              HasSubstr("indices[1] is 1, must be less than vertex_count 1"));
  GeometryRecord box;
  box.kind = PrimitiveKind::kBox;
  EXPECT_EQ(message(box, {}, {}), "");
  box.params[5] = -1;
  EXPECT_THAT(message(box, {}, {}), HasSubstr("params[5] is -1, must be 0 or greater"));
  GeometryRecord strip;
  strip.kind = PrimitiveKind::kSegments;
  strip.topology = Topology::kStrip;
  strip.vertex_count = 1;
  EXPECT_EQ(message(strip, {1, 2, 3}, {}), "");
}

TEST(Delta, RefusesBadDrawablesAndLayers) {
  const auto drawable = [](DrawableRecord d) {
    Block block(DeltaWriter::SizeOf(d));
    DeltaWriter writer(block.bytes());
    writer.PutDrawable(d);
    return std::string(Read(block.bytes()).message());
  };
  EXPECT_EQ(drawable({}), "");
  EXPECT_THAT(drawable({.priority = 127}), HasSubstr("drawable.priority is 127, must be 0 to 126"));
  EXPECT_THAT(drawable({.erase = 2}), HasSubstr("drawable.erase is 2"));
  DrawableRecord lost;
  lost.transform.m[7] = INFINITY;
  EXPECT_THAT(drawable(lost), HasSubstr("drawable.transform[7] is inf"));
  const auto layer = [](LayerRecord l) {
    Block block(DeltaWriter::SizeOf(l));
    DeltaWriter writer(block.bytes());
    writer.PutLayer(l);
    return std::string(Read(block.bytes()).message());
  };
  EXPECT_EQ(layer({}), "");
  EXPECT_THAT(layer({.visible = 2}), HasSubstr("layer.visible is 2"));
  EXPECT_THAT(layer({.opacity = 256}), HasSubstr("layer.opacity is 256, must be 0 to 255"));
  EXPECT_THAT(layer({.blend = static_cast<BlendMode>(3)}), HasSubstr("layer.blend is 3"));
  EXPECT_THAT(layer({.plane_count = 21}), HasSubstr("layer.plane_count is 21, must be 0 to 20"));
  EXPECT_THAT(layer({.cylinder_count = 5}), HasSubstr("layer.cylinder_count is 5, must be 0 to 4"));
  EXPECT_THAT(layer({.has_region = 2}), HasSubstr("layer.has_region is 2, must be 0 to 1"));
  EXPECT_THAT(layer({.has_mask = 2}), HasSubstr("layer.has_mask is 2, must be 0 to 1"));
  EXPECT_EQ(layer({.has_mask = 1, .mask = 77}), "");  // which need not exist
  LayerRecord clipped{.plane_count = 2};
  clipped.planes[0] = {0, 0, 1, -7};
  EXPECT_THAT(layer(clipped),
              HasSubstr("layer.planes[1] is (0, 0, 0), must be a plane with a normal"));
  clipped.planes[1] = {1, 0, 0, INFINITY};
  EXPECT_THAT(layer(clipped), HasSubstr("layer.planes[1][3] is inf, must be finite"));
  clipped.planes[1].d = 0;
  clipped.planes[2].a = NAN;  // beyond plane_count
  EXPECT_EQ(layer(clipped), "");
  clipped.region = {{0, 0, 5}, {1, 1, 5}};
  EXPECT_EQ(layer(clipped), "");
  clipped.has_region = 1;
  EXPECT_THAT(layer(clipped), HasSubstr("layer.region.max[2] is 5, must be greater than min's 5"));
  clipped.region.max[2] = NAN;
  EXPECT_THAT(layer(clipped), HasSubstr("layer.region.max[2] is nan, must be finite"));
  clipped.region.max[2] = 6;
  EXPECT_EQ(layer(clipped), "");
}

}  // namespace
}  // namespace voxeld::gpu
