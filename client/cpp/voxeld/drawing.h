// The shapes that can be drawn, and how they look. Data only: nothing here talks to a server.
//
// Coordinates are in the entity's own space: its transform, its layer's and the display's view
// follow. Everything must be finite.
#pragma once

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <initializer_list>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "voxeld/basics.h"
#include "voxeld/shapes.h"

namespace voxeld::client {

// Content that the server stores by its SHA-256 (UploadAsset, voxeld/assets.h).
struct Asset {
  std::string sha256;  // 32 bytes
  uint64_t size = 0;   // in bytes
};

// A packed array of numbers. Constructed from an lvalue or a span it is a view, which must stay
// valid until the call that takes it returns; that call copies it once. Constructed from an rvalue
// vector or a list it owns its elements, and large ones are sent without another copy. Constructed
// from an asset it is that asset's content, little-endian, and only its name is sent.
template <typename T>
class Array {
 public:
  Array() = default;
  Array(std::span<const T> view) : view_(view) {}                         // NOLINT: implicit
  Array(std::span<T> view) : view_(view) {}                               // NOLINT: implicit
  Array(const std::vector<T>& view) : view_(view.data(), view.size()) {}  // NOLINT: implicit
  template <size_t n>
  Array(const std::array<T, n>& view) : view_(view.data(), n) {}  // NOLINT: implicit
  Array(std::vector<T>&& whole)                                   // NOLINT: implicit
      : owner_(std::make_shared<const std::vector<T>>(std::move(whole))), view_(*owner_) {}
  Array(std::initializer_list<T> list) : Array(std::vector<T>(list)) {}
  Array(Asset asset) : asset_(std::move(asset)) {}  // NOLINT: implicit

  size_t size() const { return asset_.has_value() ? asset_->size / sizeof(T) : view_.size(); }
  bool empty() const { return asset_.has_value() ? asset_->size == 0 : view_.empty(); }
  std::span<const T> view() const { return view_; }  // empty for an asset
  // Null for a view.
  const std::shared_ptr<const std::vector<T>>& owner() const { return owner_; }
  const std::optional<Asset>& asset() const { return asset_; }

 private:
  std::optional<Asset> asset_;
  std::shared_ptr<const std::vector<T>> owner_;
  std::span<const T> view_;
};

// Vertices as they lie in memory. At most one of the two index arrays may be set.
struct Vertices {
  // kElements: one colour per segment or triangle, in their order; only for segments and meshes.
  enum class ColorsOf : uint8_t { kVertices, kElements };
  Array<float> positions;         // x y z per vertex
  Array<uint8_t> colors;          // r g b per vertex, or as colors_of says; empty: Look::color
  Array<uint32_t> indices;        // empty: vertices are used as they stand
  Array<uint16_t> short_indices;  // the same, in half the space
  ColorsOf colors_of = ColorsOf::kVertices;
};

struct Points {
  // Shape of thick points; kSoft fades out. kCell: sparse voxels, each point is the cell (1 unit
  // wide) that contains it.
  enum class Splat : uint8_t { kBall, kSoft, kCube, kCell };
  Vertices vertices;  // without indices
  Thickness thickness;
  Splat splat = Splat::kBall;
};

struct Segments {
  enum class Topology : uint8_t { kList, kStrip, kLoop };
  Vertices vertices;
  Topology topology = Topology::kList;
  LineSampling sampling = LineSampling::kThin;
  Thickness thickness;
};

// An image on a mesh; colours are multiplied by it.
struct Texture {
  Array<uint8_t> picture;  // a PNG or JPEG file
  // Two per vertex: how far right and how far down. (0, 0) is the image's upper left corner, (1, 1)
  // its lower right one; beyond them it repeats.
  Array<float> coordinates;
};

// Indexed triangles, or vertices three by three.
struct Mesh {
  Vertices vertices;
  SurfaceRule rule = SurfaceRule::kThin;
  Fill fill = Fill::kSurface;
  std::optional<Texture> texture;  // only with Fill::kSurface
  Thickness shell;                 // only with Fill::kSurface, which lies in its middle
};

// A smooth line along points: through all of them (Catmull–Rom), near them (B-spline), or as
// Béziers: an end, two handles (quadratic ones: one), an end, and so on.
struct Curve {
  enum class Form : uint8_t { kCatmullRom, kBSpline, kBezier, kQuadratic };
  Vertices vertices;  // without indices
  Form form = Form::kCatmullRom;
  bool closed = false;
  LineSampling sampling = LineSampling::kThin;
  Thickness thickness;
};

// Bicubic Bézier patches: 16 control points each, four by four, or as many indices.
struct BezierSurface {
  Vertices vertices;
  SurfaceRule rule = SurfaceRule::kThin;
  Fill fill = Fill::kSurface;  // or lines, the edges of each patch, or dots, their corners
  Thickness shell;             // only with Fill::kSurface
};

// A surface over a grid of heights, row by row.
struct HeightMap {
  Vec3 corner;
  Vec3 edge_a = {1, 0, 0};  // from the first to the last sample of a row
  Vec3 edge_b = {0, 1, 0};  // from the first to the last row
  Vec3 up = {0, 0, 1};      // displacement of a sample of height 1
  uint32_t columns = 0, rows = 0;
  Array<float> heights;
  Array<uint8_t> colors;  // r g b per sample; empty: Look::color
  SurfaceRule rule = SurfaceRule::kThin;
  Fill fill = Fill::kSurface;  // or lines, which are rows and columns, or dots
  // A PNG or JPEG file over the whole surface, from the first sample on; empty: none.
  Array<uint8_t> picture;
  Thickness shell;  // only with Fill::kSurface
};

// Samples in the middles of equal cells that fill the volume spanned by three edges from a corner.
struct Grid {
  enum class Filter : uint8_t { kLinear, kNearest };
  Vec3 corner = {-1, -1, -1};
  Vec3 edge_a = {2, 0, 0}, edge_b = {0, 2, 0}, edge_c = {0, 0, 2};
  uint32_t size_a = 0, size_b = 0, size_c = 0;  // samples along each
  // Samples along edge_a first, then rows along edge_b. All in one message, whose size the server
  // limits.
  std::variant<Array<float>, Array<uint16_t>, Array<uint8_t>> samples;
  Filter filter = Filter::kLinear;
};

// Maps numbers to colours and opacities, in 256 steps from the first value to the last.
struct Transfer {
  std::vector<double> values;     // 2 to 256, not descending
  std::vector<Color> colors;      // one per value; or
  std::string colormap;           // matplotlib's name of a colour map
  std::vector<double> opacities;  // 0 to 1 per value, 0: nothing is drawn; empty: 1
};

// Numbers mapped by a transfer function (without one: those above their middle are drawn), or
// colours.
struct Volume {
  Grid grid;
  bool colors = false;  // the samples are bytes, r g b a each
  std::optional<Transfer> transfer;
};

// The surface where numbers reach a level; inside is where they are at least the level.
struct Isosurface {
  Grid grid;
  double level = 0;
  Fill fill = Fill::kSurface;  // or solid
  SurfaceRule rule = SurfaceRule::kThin;
  Thickness shell;
};

// Boxes, spheres and cylinders with a shell or a colour scale are drawn as parallelepipeds,
// ellipsoids and cones.
struct Box {
  Vec3 center;
  Vec3 size = {1, 1, 1};  // full edge lengths
  Fill fill = Fill::kSurface;
  SurfaceRule rule = SurfaceRule::kThin;
  Thickness shell;
};

struct Sphere {
  Vec3 center;
  double radius = 1;
  Fill fill = Fill::kSurface;
  SurfaceRule rule = SurfaceRule::kThin;
  Thickness shell;
};

// A cylinder along its own z axis, centred.
struct Cylinder {
  Vec3 center;
  double radius = 1;
  double height = 1;
  Fill fill = Fill::kSurface;
  SurfaceRule rule = SurfaceRule::kThin;
  Thickness shell;
};

// Draws an object that Session::DefineObject defined.
struct Instance {
  std::string object;
  Color tint;  // all its colours are multiplied by this one; 255 is 1
};

// Colours by numbers, from one end of a colour map to the other. `along` works for all shapes but
// Implicit, which has a level, volumes and instances; `scalars` for shapes that have vertices, and
// for the samples of height maps.
struct ColorScale {
  std::string colormap;       // matplotlib's name, such as "viridis", or "viridis_r": reversed;
  std::vector<Color> colors;  // or 2 to 256 colours, evenly spaced
  double low = 0,
         high = 0;  // the numbers at the two ends; both 0: the least and the greatest present
  // Where the numbers come from: the position along this vector, (p · along) / |along|²;
  std::optional<Vec3> along;
  Array<float> scalars;  // or one per vertex
};

using Shape =
    std::variant<Points, Segments, Mesh, Box, Sphere, Cylinder, Instance, Implicit, Ellipsoid,
                 Torus, Cone, Parallelepiped, Disc, Patch, Polygon, HeightMap, Curve, Arc, Ellipse,
                 Helix, BezierSurface, Arrow, Text, Volume, Isosurface>;

// Everything about an entity except its shape.
struct Look {
  // for shapes without colours of their own; black covers. Instances use their object's colours
  Color color;
  std::optional<ColorScale> color_scale;  // in place of colours
  Affine transform;
  uint32_t priority = 0;  // 0 to 126: within its layer the higher priority wins
  bool erase = false;     // removes content of lower or equal priority within its layer
  std::chrono::nanoseconds lifetime{0};  // removed that long after it was applied; 0: it stays
  std::string label;                     // for people to read
};

// A piece of an object.
struct Part {
  Shape shape;
  Color color;
  Affine transform;  // part → object
  std::optional<ColorScale> color_scale;
};

enum class Blend : uint8_t { kOver, kAdd, kErase };

// A half-space of scene space: a·x + b·y + c·z + d ≥ 0.
struct HalfSpace {
  double a = 0, b = 0, c = 0, d = 0;
};

// A box under a transform (box → scene); all sizes are greater than 0.
struct ClipBox {
  Vec3 center, size;
  Affine transform;
};

// A cylinder from one point to another, with flat ends.
struct ClipCylinder {
  Vec3 start, end;
  double radius = 0;  // greater than 0
};

using ClipPart = std::variant<HalfSpace, ClipBox, ClipCylinder>;

// Fields that are set change the layer; the others stay unchanged.
struct LayerLook {
  std::optional<bool> visible;
  std::optional<uint8_t> opacity;
  std::optional<int32_t> order;  // layers combine in ascending (order, creation)
  std::optional<Blend> blend;
  std::optional<Affine> transform;
  // Only content inside all of these and the region is drawn. An empty list removes the former
  // clip.
  std::optional<std::vector<ClipPart>> clip;
  std::optional<Region> region;
  // A layer of this client: content is visible only where that layer covers. Empty: removes the
  // mask.
  std::optional<std::string> mask;
};

}  // namespace voxeld::client
