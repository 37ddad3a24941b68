#include "tests/conformance/oracle.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "gpu/curves/cut.h"
#include "tests/conformance/oracle_clip.h"
#include "tests/conformance/oracle_footprints.h"
#include "tests/conformance/oracle_shapes.h"

namespace voxeld::gpu::conformance {
namespace {

// A voxel of one layer.
struct LayerVoxel {
  bool covered = false, erased = false;
  uint32_t priority = 0, rgb = 0;

  // The higher priority wins; at one priority an erase, then the greater colour word.
  void Add(uint32_t p, bool erase, uint32_t color) {
    const bool none = !covered && !erased;
    if (!none && p < priority) return;
    if (none || p > priority) {
      priority = p;
      covered = !erase;
      erased = erase;
      rgb = color;
    } else if (erase) {
      covered = false;
      erased = true;
    } else if (!erased && Interleaved(color) > Interleaved(rgb)) {
      rgb = color;
    }
  }
};

// Plots the point's own voxel, and those with centres within a ball, fading, or within a cube.
void PlotSplat(const Units& at, uint32_t rgb, int64_t radius, Splat splat, const DenseVolume& grid,
               const Plot& plot) {
  PlotLine({at, at, rgb, rgb, LineSampling::kThin}, grid, plot);
  if (radius == 0) return;
  const double r2 = static_cast<double>(radius) * static_cast<double>(radius);
  for (int64_t z = 0; z < grid.nz; ++z) {
    for (int64_t y = 0; y < grid.ny; ++y) {
      for (int64_t x = 0; x < grid.nx; ++x) {
        double square = 0;
        bool within = true;
        const int64_t voxel[3] = {x, y, z};
        for (int a = 0; a < 3; ++a) {
          const int64_t d = std::abs(256 * voxel[a] + 128 - at.v[a]);
          square += static_cast<double>(d) * static_cast<double>(d);
          within = within && d <= radius;
        }
        if (splat == Splat::kCube && within) plot(x, y, z, rgb);
        if (splat == Splat::kCube || square > r2) continue;
        const auto left = static_cast<uint32_t>(std::floor((r2 - square) * 255 / r2));
        const uint32_t faded = OracleTint(rgb, left * 0x010101);
        if (faded != 0) plot(x, y, z, faded);
      }
    }
  }
}

// Plots the voxel of the middle of the cell in which a point lies, and those with centres in the
// cell.
void PlotCell(const float* position, uint32_t rgb, const Affine& map, const DenseVolume& grid,
              const Plot& plot) {
  float middle[3], lower[3];
  for (int a = 0; a < 3; ++a) {
    lower[a] = std::floor(position[a]);
    middle[a] = lower[a] + 0.5f;
  }
  const Units at = OracleSnap(map, middle);
  PlotLine({at, at, rgb, rgb, LineSampling::kThin}, grid, plot);
  OracleFrame frame;
  if (!SetOracleFrame(map, /*keep_thin=*/false, frame)) return;
  for (int64_t z = 0; z < grid.nz; ++z) {
    for (int64_t y = 0; y < grid.ny; ++y) {
      for (int64_t x = 0; x < grid.nx; ++x) {
        float q[3];
        frame.Coordinates(x, y, z, q);
        bool within = true;
        for (int a = 0; a < 3; ++a) within = within && std::floor(q[a]) == lower[a];
        if (within) plot(x, y, z, rgb);
      }
    }
  }
}

// Plots the segments and triangles into which a curve is divided. Separate tests judge the
// division.
void PlotCurved(const ModelGeometry& g, const Affine& map, const DenseVolume& grid, uint32_t tint,
                const Plot& plot) {
  GeometryView view;
  view.record = g.record;
  view.positions = g.positions;
  view.colors = g.colors;
  TileGrid tiles;
  tiles.voxels[0] = grid.nx, tiles.voxels[1] = grid.ny, tiles.voxels[2] = grid.nz;
  const Cut cut = CutCurved(view, map, tiles);
  const bool colored = !cut.colors.empty();
  const auto color = [&](size_t i) {
    return OracleTint(colored ? cut.colors[i] : g.record.color, tint);
  };
  const auto at = [&](size_t i) {
    return Units{{cut.vertices[i].v[0], cut.vertices[i].v[1], cut.vertices[i].v[2]}};
  };
  const int64_t radius = OracleRadius(g.record, map);
  for (size_t i = 0; g.record.kind == PrimitiveKind::kCurves && i < cut.vertices.size(); i += 2) {
    const OracleLine line{at(i), at(i + 1), color(i), color(i + 1), g.record.sampling};
    PlotLine(line, grid, plot);
    if (radius > 0) PlotCapsule(line, radius, grid, plot);
  }
  for (size_t i = 0; i < cut.indices.size(); i += 3) {
    OracleTriangle t;
    for (size_t c = 0; c < 3; ++c) {
      t.v[c] = at(cut.indices[i + c]);
      t.color[c] = color(cut.indices[i + c]);
    }
    t.rule = g.record.rule;
    PlotTriangle(t, grid, plot);
    if (radius > 0) PlotThick(t, radius, grid, plot);
  }
}

uint32_t Blended(uint32_t below, uint32_t rgb, const LayerRecord& layer) {
  uint32_t result = 0;
  for (int shift = 0; shift < 24; shift += 8) {
    const uint32_t b = below >> shift & 255, c = rgb >> shift & 255, o = layer.opacity;
    uint32_t r = 0;
    if (layer.blend == BlendMode::kOver) r = (c * o + 127) / 255;
    if (layer.blend == BlendMode::kAdd) r = std::min<uint32_t>(255, b + (c * o + 127) / 255);
    if (layer.blend == BlendMode::kErase) r = (b * (255 - o) + 127) / 255;
    result |= r << shift;
  }
  return result;
}

}  // namespace

uint32_t Interleaved(uint32_t rgb) {
  uint32_t word = 0;
  for (int bit = 7; bit >= 0; --bit) {
    word = word << 1 | (rgb >> (8 + bit) & 1);
    word = word << 1 | (rgb >> (16 + bit) & 1);
    word = word << 1 | (rgb >> bit & 1);
  }
  return word;
}

uint32_t OracleTint(uint32_t rgb, uint32_t tint) {
  uint32_t result = 0;
  for (int shift = 0; shift < 24; shift += 8) {
    const double product = (rgb >> shift & 255) * static_cast<double>(tint >> shift & 255);
    result |= static_cast<uint32_t>(std::lround(product / 255)) << shift;
  }
  return result;
}

int64_t OracleRadius(const GeometryRecord& g, const Affine& map) {
  double thickness = g.thickness;
  if (g.thickness_unit == ThicknessUnit::kUnits) thickness *= OracleScale(map);
  return static_cast<int64_t>(std::min(std::floor(thickness / 2 * 256 + 0.5), 0x1p38));
}

void PlotGeometry(const ModelGeometry& g, const Affine& map, const DenseVolume& grid,
                  const Plot& plot, uint32_t tint) {
  const GeometryRecord& record = g.record;
  const Plot tinted = [&](int64_t x, int64_t y, int64_t z, uint32_t rgb) {
    plot(x, y, z, OracleTint(rgb, tint));
  };
  if (record.kind == PrimitiveKind::kBox || record.kind == PrimitiveKind::kSphere ||
      record.kind == PrimitiveKind::kCylinder) {
    return PlotSolid(record, map, grid, tinted);
  }
  if (record.kind == PrimitiveKind::kImplicit) return PlotImplicit(g, map, grid, tinted);
  if (record.kind == PrimitiveKind::kSamples) return PlotSamples(g, map, grid, tinted);
  if (IsCurved(record.kind)) return PlotCurved(g, map, grid, tint, plot);
  std::vector<Units> at;
  std::vector<uint32_t> colors;
  // The texture follows the vertices' colours, if they have any: first the coordinates, then the
  // texture itself.
  const bool colored = record.color_mode == ColorMode::kPerVertex;
  const size_t places = colored ? record.vertex_count : 0;
  const auto on_texture = [&](size_t first) {
    OracleTexture texture;
    if (record.texture_width == 0) return texture;
    texture.texels = g.colors.data() + places + 2 * size_t{record.vertex_count};
    texture.width = record.texture_width;
    texture.height = record.texture_height;
    for (size_t i = 0; i < 3; ++i) {
      const size_t vertex = record.index_count ? g.indices[first + i] : first + i;
      std::memcpy(texture.at[i], &g.colors[places + 2 * vertex], sizeof(texture.at[i]));
    }
    return texture;
  };
  const size_t corners = record.index_count ? record.index_count : record.vertex_count;
  for (size_t corner = 0; corner < corners; ++corner) {
    const size_t vertex = record.index_count ? g.indices[corner] : corner;
    at.push_back(OracleSnap(map, &g.positions[vertex * 3]));
    // Vertices are tinted first; the colours between them are mixed from the results.
    colors.push_back(OracleTint(colored ? g.colors[vertex] : record.color, tint));
  }
  const int64_t radius = OracleRadius(record, map);
  const auto segment = [&](size_t a, size_t b) {
    const OracleLine line{at[a], at[b], colors[a], colors[b], record.sampling};
    PlotLine(line, grid, plot);
    if (radius > 0) PlotCapsule(line, radius, grid, plot);
  };
  if (record.kind == PrimitiveKind::kPoints && record.splat == Splat::kCell) {
    for (size_t i = 0; i < corners; ++i) {
      const size_t vertex = record.index_count ? g.indices[i] : i;
      PlotCell(&g.positions[vertex * 3], colors[i], map, grid, plot);
    }
  } else if (record.kind == PrimitiveKind::kPoints && record.splat != Splat::kBall) {
    for (size_t i = 0; i < corners; ++i) {
      PlotSplat(at[i], colors[i], radius, record.splat, grid, plot);
    }
  } else if (record.kind == PrimitiveKind::kPoints) {
    for (size_t i = 0; i < corners; ++i) segment(i, i);
  } else if (record.kind == PrimitiveKind::kTriangles) {
    for (size_t i = 0; i < corners; i += 3) {
      const OracleTriangle triangle{{at[i], at[i + 1], at[i + 2]},
                                    {colors[i], colors[i + 1], colors[i + 2]},
                                    record.rule,
                                    on_texture(i)};
      PlotTriangle(triangle, grid, plot);
      if (radius > 0) PlotThick(triangle, radius, grid, plot);
    }
  } else if (record.kind == PrimitiveKind::kFilled) {
    std::vector<OracleTriangle> triangles;
    for (size_t i = 0; i < corners; i += 3) {
      triangles.push_back({{at[i], at[i + 1], at[i + 2]}, {colors[i], colors[i], colors[i]}, {}});
    }
    PlotFilled(triangles, grid, plot);
  } else if (record.topology == Topology::kList) {
    for (size_t i = 0; i < corners; i += 2) segment(i, i + 1);
  } else {
    for (size_t i = 0; i + 1 < corners; ++i) segment(i, i + 1);
    if (record.topology == Topology::kLoop && corners >= 2) segment(corners - 1, 0);
  }
}

namespace {

// Returns the voxels that a layer covers after clipping, whether it is visible or not.
std::vector<LayerVoxel> CoveredBy(const LayerRecord& layer, const SceneModel& scene,
                                  const Target& target, const DenseVolume& volume) {
  std::vector<LayerVoxel> voxels(volume.rgb.size());
  for (const auto& [id, drawable] : scene.drawables) {
    if (drawable.layer != layer.id) continue;
    const Affine map =
        OracleCompose(OracleCompose(target.view, layer.transform), drawable.transform);
    PlotGeometry(
        scene.geometries.at(drawable.geometry), map, volume,
        [&](int64_t x, int64_t y, int64_t z, uint32_t rgb) {
          voxels.at(volume.Index(x, y, z)).Add(drawable.priority, drawable.erase != 0, rgb);
        },
        drawable.tint);
  }
  const OracleClip clip(layer, target);
  for (int32_t z = 0; z < volume.nz; ++z) {
    for (int32_t y = 0; y < volume.ny; ++y) {
      for (int32_t x = 0; x < volume.nx; ++x) {
        LayerVoxel& voxel = voxels[volume.Index(x, y, z)];
        voxel.covered = voxel.covered && clip.Has(x, y, z);
      }
    }
  }
  return voxels;
}

}  // namespace

DenseVolume OracleVoxels(const SceneModel& scene, const Target& target) {
  DenseVolume volume;
  volume.nx = target.geometry.grid.nx;
  volume.ny = target.geometry.grid.ny;
  volume.nz = target.geometry.grid.nz;
  volume.rgb.assign(static_cast<size_t>(volume.nx) * static_cast<size_t>(volume.ny) *
                        static_cast<size_t>(volume.nz),
                    0);
  std::vector<const LayerRecord*> order;
  order.reserve(scene.layers.size());
  for (const auto& [id, layer] : scene.layers) order.push_back(&layer);
  std::stable_sort(order.begin(), order.end(), [](const LayerRecord* a, const LayerRecord* b) {
    return a->order < b->order;  // ids already ascend
  });
  for (const LayerRecord* layer : order) {
    if (!layer->visible || (layer->has_mask && !scene.layers.contains(layer->mask))) continue;
    const std::vector<LayerVoxel> voxels = CoveredBy(*layer, scene, target, volume);
    std::vector<LayerVoxel> mask;
    if (layer->has_mask) mask = CoveredBy(scene.layers.at(layer->mask), scene, target, volume);
    for (size_t i = 0; i < voxels.size(); ++i) {
      if (!voxels[i].covered || (layer->has_mask && !mask[i].covered)) continue;
      volume.rgb[i] = Blended(volume.rgb[i], voxels[i].rgb, *layer);
    }
  }
  return volume;
}

std::vector<uint8_t> OracleSeen(const DenseVolume& volume, const Target& target) {
  const OracleFootprints footprints(target);
  const display::FrameLayout& layout = target.layout;
  std::vector<uint8_t> seen(volume.rgb.size());
  for (int32_t slice = 0; slice < layout.slices; ++slice) {
    for (int32_t pixel = 0; pixel < layout.width * layout.height; ++pixel) {
      for (const OracleVoxel& voxel :
           footprints.Of(slice, pixel % layout.width, pixel / layout.width)) {
        seen[volume.Index(voxel.x, voxel.y, voxel.z)] = 1;
      }
    }
  }
  return seen;
}

}  // namespace voxeld::gpu::conformance
