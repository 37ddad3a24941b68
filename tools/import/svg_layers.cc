#include "tools/import/svg_layers.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <map>
#include <utility>

#include "absl/strings/str_cat.h"

namespace voxeld::voxelctl {
namespace {

constexpr int kInk = 40;     // of the brightest channel: at most that is dark
constexpr int kPaper = 240;  // of the darkest channel: at least that is white
constexpr size_t kCells = 64;
constexpr size_t kMostPieces = 4096;  // of a layer, that are looked at one by one

struct Box {
  double left = HUGE_VAL, right = -HUGE_VAL, top = HUGE_VAL, bottom = -HUGE_VAL;

  void Add(const Point2& p) {
    left = std::min(left, p.x), right = std::max(right, p.x);
    top = std::min(top, p.y), bottom = std::max(bottom, p.y);
  }
  bool Holds(const Box& other) const {
    return left <= other.left && right >= other.right && top <= other.top && bottom >= other.bottom;
  }
};

Box BoxOf(const std::vector<Point2>& points) {
  Box box;
  for (const Point2& p : points) box.Add(p);
  return box;
}

bool IsDark(const Rgb& c) { return std::max({c.r, c.g, c.b}) < kInk; }

// Whether it is a white rectangle behind all the others.
bool IsSheet(const std::vector<SvgLayer>& layers) {
  const SvgLayer& first = layers[0];
  if (first.stroke || first.triangles.size() != 6 || first.opacity < 1) return false;
  if (std::min({first.color.r, first.color.g, first.color.b}) < kPaper) return false;
  const Box box = BoxOf(first.points);
  for (const Point2& p : first.points) {
    if ((p.x != box.left && p.x != box.right) || (p.y != box.top && p.y != box.bottom))
      return false;
  }
  return std::all_of(layers.begin() + 1, layers.end(),
                     [&box](const SvgLayer& layer) { return box.Holds(BoxOf(layer.points)); });
}

// What is seen of each cell so far.
class Levels {
 public:
  explicit Levels(const Box& all) : all_(all), seen_(kCells * kCells) {}

  // The level of a layer of that colour, with a box for each of its pieces, which counts as one box if it is cheaper.
  uint8_t Take(std::vector<Box> boxes, const Rgb& color) {
    size_t cells = 0;
    for (const Box& box : boxes) cells += Across(box) * Down(box);
    if (cells > kCells * kCells) {
      Box whole;
      for (const Box& box : boxes)
        whole.Add({box.left, box.top}), whole.Add({box.right, box.bottom});
      boxes = {whole};
    }
    int level = 0;
    ForEach(boxes, [&](const Seen& seen) {
      if (seen.level >= 0) level = std::max(level, seen.level + (seen.color == color ? 0 : 1));
    });
    crowded_ |= level > kMostLevel;
    level = std::min<int>(level, kMostLevel);
    ForEach(boxes, [&](Seen& seen) { seen = {level, color}; });
    return static_cast<uint8_t>(level);
  }
  bool crowded() const { return crowded_; }

 private:
  struct Seen {
    int level = -1;
    Rgb color;
  };

  static size_t Cell(double at, double from, double to) {
    if (!(to > from)) return 0;
    return static_cast<size_t>(
        std::clamp((at - from) / (to - from) * kCells, 0.0, static_cast<double>(kCells - 1)));
  }

  size_t Across(const Box& box) const {
    return Cell(box.right, all_.left, all_.right) - Cell(box.left, all_.left, all_.right) + 1;
  }
  size_t Down(const Box& box) const {
    return Cell(box.bottom, all_.top, all_.bottom) - Cell(box.top, all_.top, all_.bottom) + 1;
  }

  template <typename Each>
  void ForEach(const std::vector<Box>& boxes, Each each) {
    for (const Box& box : boxes) {
      const size_t right = Cell(box.right, all_.left, all_.right),
                   bottom = Cell(box.bottom, all_.top, all_.bottom);
      for (size_t y = Cell(box.top, all_.top, all_.bottom); y <= bottom; ++y) {
        for (size_t x = Cell(box.left, all_.left, all_.right); x <= right; ++x)
          each(seen_[y * kCells + x]);
      }
    }
  }

  const Box all_;
  std::vector<Seen> seen_;
  bool crowded_ = false;
};

std::vector<Box> Boxes(const SvgLayer& layer) {
  if (layer.triangles.size() / 3 + layer.segments.size() / 2 > kMostPieces)
    return {BoxOf(layer.points)};
  std::vector<Box> boxes;
  const auto add = [&](const std::vector<uint32_t>& indices, size_t corners) {
    for (size_t i = 0; i + corners <= indices.size(); i += corners) {
      Box& box = boxes.emplace_back();
      for (size_t c = 0; c < corners; ++c) box.Add(layer.points[indices[i + c]]);
    }
  };
  add(layer.triangles, 3);
  add(layer.segments, 2);
  return boxes;
}

Rgb Seen(const SvgLayer& layer, bool all_dark) {
  const bool white = IsDark(layer.color) && (layer.stroke || all_dark);
  const Rgb color = white ? Rgb{255, 255, 255} : layer.color;
  const auto dimmed = [&layer](uint8_t v) {
    return static_cast<uint8_t>(std::lround(v * layer.opacity));
  };
  return {dimmed(color.r), dimmed(color.g), dimmed(color.b)};
}

void Append(const SvgLayer& layer, const std::vector<uint32_t>& indices, const Rgb& color,
            Part* part) {
  if (indices.empty()) return;
  std::vector<uint32_t> in_part(layer.points.size(), UINT32_MAX);
  for (const uint32_t index : indices) {
    if (in_part[index] == UINT32_MAX) {
      in_part[index] = static_cast<uint32_t>(part->positions.size());
      part->positions.push_back({layer.points[index].x, -layer.points[index].y, 0});
      part->colors.push_back(color);
    }
    part->indices.push_back(in_part[index]);
  }
}

}  // namespace

LayeredParts ToParts(std::vector<SvgLayer> layers) {
  LayeredParts out;
  const auto dark = [](const SvgLayer& layer) { return IsDark(layer.color); };
  if (std::any_of(layers.begin(), layers.end(), dark) && IsSheet(layers)) {
    layers.erase(layers.begin());
    out.note = "the white sheet behind all is left out";
  }
  const bool all_dark = std::all_of(layers.begin(), layers.end(), [&](const SvgLayer& layer) {
    return layer.stroke || IsDark(layer.color);
  });
  Box all;
  for (const SvgLayer& layer : layers) {
    for (const Point2& p : layer.points) all.Add(p);
  }
  Levels levels(all);
  std::map<std::pair<uint8_t, Kind>, Part> parts;
  for (SvgLayer& layer : layers) {
    const Rgb color = Seen(layer, all_dark);
    const uint8_t level = levels.Take(Boxes(layer), color);
    Append(layer, layer.triangles, color, &parts[{level, Kind::kTriangles}]);
    Append(layer, layer.segments, color, &parts[{level, Kind::kSegments}]);
    layer = {};
  }
  for (auto& [key, part] : parts) {
    if (part.indices.empty()) continue;
    part.level = key.first;
    part.kind = key.second;
    out.parts.push_back(std::move(part));
  }
  if (levels.crowded()) {
    absl::StrAppend(&out.note, out.note.empty() ? "" : "; ", "more than ", kMostLevel + 1,
                    " layers lie upon each other; of the upper ones the brighter is seen");
  }
  return out;
}

}  // namespace voxeld::voxelctl
