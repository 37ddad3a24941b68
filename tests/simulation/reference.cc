#include "tests/simulation/reference.h"

#include <algorithm>
#include <cstdlib>

#include "gpu/cpu/cpu_engine.h"
#include "gpu/delta.h"

namespace voxeld::simulation {
namespace {

using daemon::Content;
using daemon::GeometryData;
using daemon::GeometryPtr;
using daemon::InstanceRef;
using daemon::ObjectPart;
using daemon::model::PlainEntity;
using daemon::model::PlainLayer;
using daemon::model::PlainOwner;
using daemon::model::PlainScene;

struct Piece {
  const GeometryData* geometry;
  gpu::DrawableRecord drawable;
};

gpu::Affine Product(const gpu::Affine& outer, const gpu::Affine& inner) {
  gpu::Affine product;
  for (size_t row = 0; row < 3; ++row) {
    for (size_t col = 0; col < 4; ++col) {
      double sum = col == 3 ? outer.m[4 * row + 3] : 0;
      for (size_t i = 0; i < 3; ++i) sum += outer.m[4 * row + i] * inner.m[4 * i + col];
      product.m[4 * row + col] = sum;
    }
  }
  return product;
}

void Collect(const PlainOwner& owner, const PlainEntity& entity, uint64_t layer,
             const Content& content, const gpu::Affine& map, std::vector<Piece>& out) {
  if (const auto* instance = std::get_if<InstanceRef>(&content)) {
    for (const ObjectPart& part : owner.objects.at(instance->object)) {
      Collect(owner, entity, layer, part.content, Product(map, part.transform), out);
    }
    return;
  }
  Piece piece{std::get<GeometryPtr>(content).get(), {}};
  piece.drawable.id = piece.drawable.geometry = out.size() + 1;
  piece.drawable.layer = layer;
  piece.drawable.priority = entity.data.priority;
  piece.drawable.erase = entity.data.erase ? 1 : 0;
  piece.drawable.transform = map;
  out.push_back(piece);
}

gpu::LayerRecord RecordOf(const PlainLayer& layer, bool hidden) {
  gpu::LayerRecord record;
  record.id = layer.created;
  record.order = layer.order;
  record.visible = layer.visible && !hidden ? 1 : 0;
  record.opacity = layer.opacity;
  record.blend = layer.blend;
  record.transform = layer.transform;
  record.plane_count = layer.clip.count;
  std::copy_n(layer.clip.planes, layer.clip.count, record.planes);
  record.has_region = layer.region.has_value() ? 1 : 0;
  if (layer.region.has_value()) record.region = *layer.region;
  return record;
}

void Must(const absl::Status& status) {
  if (!status.ok()) std::abort();
}

}  // namespace

std::vector<std::byte> DrawPlain(const PlainScene& scene, const display::DisplayInfo& info) {
  std::vector<gpu::LayerRecord> layers;
  std::vector<Piece> pieces;
  for (const auto& [number, owner] : scene.owners) {
    for (const auto& [name, layer] : owner.layers) {
      layers.push_back(RecordOf(layer, owner.hidden));
      for (const auto& [id, entity] : layer.entities) {
        Collect(owner, entity, layer.created, entity.data.content, entity.data.transform, pieces);
      }
    }
  }
  size_t size = 0;
  for (const gpu::LayerRecord& layer : layers) size += gpu::DeltaWriter::SizeOf(layer);
  for (const Piece& piece : pieces) {
    size +=
        gpu::DeltaWriter::SizeOf(piece.geometry->record) + gpu::DeltaWriter::SizeOf(piece.drawable);
  }

  gpu::EngineOptions options;
  options.threads = 1;
  options.inline_execution = true;
  const std::unique_ptr<gpu::Engine> engine = gpu::CreateCpuEngine(options, "a reference");
  engine->SetTarget({info.geometry, info.layout, info.tone, gpu::Affine()}, Must);
  if (size > 0) {
    absl::StatusOr<gpu::StagingBlock> block = engine->AcquireStaging(size);
    Must(block.status());
    gpu::DeltaWriter writer(block->bytes());
    for (const gpu::LayerRecord& layer : layers) writer.PutLayer(layer);
    for (const Piece& piece : pieces) {
      gpu::GeometryRecord record = piece.geometry->record;
      record.id = piece.drawable.geometry;
      const gpu::GeometryArrays& arrays = piece.geometry->arrays;
      writer.PutGeometry(record, arrays.positions(), arrays.indices(), arrays.colors());
      writer.PutDrawable(piece.drawable);
    }
    engine->Apply(*std::move(block), size, Must);
  }
  std::vector<std::byte> bytes(info.layout.bytes());
  std::vector<uint64_t> changed_in(info.layout.pictures());
  engine->SubmitFrame(
      {.frame = 1}, {bytes, changed_in},
      [](const absl::StatusOr<gpu::FrameResult>& result) { Must(result.status()); });
  return bytes;
}

}  // namespace voxeld::simulation
