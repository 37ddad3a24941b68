// Deltas according to a script: valid in form, with any contents.
#pragma once

#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "gpu/delta.h"
#include "tests/fuzz/script.h"

namespace voxeld::fuzz {

// Returns mostly a small number, otherwise any bits of a float.
inline float Coordinate(Script& script) {
  const uint8_t byte = script.Byte();
  if (byte < 250) return static_cast<float>(byte) / 32 - 2;
  return std::bit_cast<float>(static_cast<uint32_t>(script.Number(4)));
}

inline gpu::Affine Map(Script& script) {
  gpu::Affine map;
  for (int i = script.Byte() % 4; i > 0; --i) {
    const size_t at = script.Byte() % 12;
    map.m[at] = Coordinate(script);
  }
  return map;
}

inline void PutGeometry(Script& script, gpu::DeltaWriter& writer) {
  gpu::GeometryRecord g;
  g.id = script.Byte() % 8;
  g.kind = static_cast<gpu::PrimitiveKind>(script.Byte() % 13);
  const uint8_t flags = script.Byte();
  g.color_mode = static_cast<gpu::ColorMode>(flags & 3);
  g.topology = static_cast<gpu::Topology>(flags >> 2 & 3);
  g.rule = static_cast<gpu::SurfaceRule>(flags >> 4 & 3);
  g.fill = static_cast<gpu::Fill>(flags >> 6);
  const uint8_t more = script.Byte();
  g.thickness_unit = static_cast<gpu::ThicknessUnit>(more & 3);
  g.sampling = static_cast<gpu::LineSampling>(more >> 2 & 3);
  g.drawn_by = static_cast<gpu::DrawnBy>(more >> 4 & 3);
  g.splat = static_cast<gpu::Splat>(more >> 6);
  g.thickness = Coordinate(script);
  for (float& parameter : g.params) parameter = Coordinate(script);
  g.vertex_count = script.Byte() % 33;
  const std::string words = script.Text();
  g.index_count = static_cast<uint32_t>(words.size() / 4);
  if ((flags & 1) != 0 && g.kind == gpu::PrimitiveKind::kTriangles) {
    g.texture_width = script.Byte() % 5;
    g.texture_height = script.Byte() % 5;
  }
  std::vector<float> positions(3 * size_t{g.vertex_count});
  for (float& position : positions) position = Coordinate(script);
  std::vector<uint32_t> indices(g.index_count);
  for (size_t i = 0; i < indices.size(); ++i) {
    // Mostly points; programs and samples have arbitrary words.
    for (size_t byte = 0; byte < 4; ++byte) {
      indices[i] |= uint32_t{static_cast<uint8_t>(words[4 * i + byte])} << 8 * byte;
    }
    if (g.kind != gpu::PrimitiveKind::kImplicit && g.kind != gpu::PrimitiveKind::kSamples) {
      indices[i] %= g.vertex_count + 1;
    }
  }
  std::vector<uint32_t> colors;
  // A texture has many more.
  const uint64_t colored = gpu::ColorCount(g);
  if (colored != 0) colors.assign(colored, script.Byte());
  writer.PutGeometry(g, positions, indices, colors);
}

inline void PutLayer(Script& script, gpu::DeltaWriter& writer) {
  gpu::LayerRecord l;
  l.id = script.Byte() % 4;
  l.order = static_cast<int8_t>(script.Byte());
  l.visible = script.Byte() % 3;
  l.opacity = script.Below(260);
  l.blend = static_cast<gpu::BlendMode>(script.Byte() % 5);
  l.plane_count = script.Byte() % 8;
  l.cylinder_count = script.Byte() % 4;
  l.has_mask = script.Byte() % 3;
  l.mask = script.Byte() % 4;
  l.has_region = script.Byte() % 3;
  l.transform = Map(script);
  for (gpu::ClipPlane& plane : l.planes) {
    plane = {Coordinate(script), Coordinate(script), Coordinate(script), Coordinate(script)};
  }
  writer.PutLayer(l);
}

inline std::vector<std::byte> SoundDelta(Script& script) {
  std::vector<std::byte> bytes(16 << 10);
  gpu::DeltaWriter writer(bytes);
  for (int i = script.Byte() % 8; i >= 0; --i) {
    switch (script.Byte() % 8) {
      case 0:
      case 1:
      case 2:
        PutGeometry(script, writer);
        break;
      case 3:
      case 4: {
        gpu::DrawableRecord d;
        d.id = script.Byte() % 8;
        d.geometry = script.Byte() % 8;
        d.layer = script.Byte() % 4;
        d.priority = script.Byte();
        d.erase = script.Byte() % 3;
        d.transform = Map(script);
        writer.PutDrawable(d);
        break;
      }
      case 5:
        PutLayer(script, writer);
        break;
      case 6: {
        const auto op = static_cast<gpu::Op>(script.Byte() % 10);
        writer.Drop(op, script.Byte() % 8);
        break;
      }
      default:
        writer.Reset();
        break;
    }
  }
  bytes.resize(writer.overrun() ? 0 : writer.size());
  return bytes;
}

}  // namespace voxeld::fuzz
