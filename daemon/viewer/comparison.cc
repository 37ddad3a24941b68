#include "daemon/viewer/comparison.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <utility>

#include "absl/strings/str_format.h"

namespace voxeld::daemon::viewer {
namespace {

using Color = std::array<int, 3>;

constexpr int kFull = 255;
constexpr int64_t kSlab = 1 << 21;  // voxels read at once, approximately
constexpr Color kMissing = {64, 128, 255}, kExcess = {255, 128, 32};

int Greatest(const Color& c) { return std::max({c[0], c[1], c[2]}); }

Color Apart(const Color& a, const Color& b) {
  return {std::abs(a[0] - b[0]), std::abs(a[1] - b[1]), std::abs(a[2] - b[2])};
}

Color LightOf(const display::Tone& tone, uint32_t rgb) {
  const auto light = [&](size_t channel, uint32_t c) {
    constexpr int kLight = 65535;
    return (tone.lut[channel][c] * kFull + kLight / 2) / kLight;
  };
  return {light(0, rgb >> 16), light(1, rgb >> 8 & 0xFF), light(2, rgb & 0xFF)};
}

// Returns: the distance of two levels of a channel, of 255, as an eye perceives it in a volume.
Color LevelOf(const display::FrameLayout& layout) {
  const bool planes = layout.format == display::PixelFormat::kPlanes24;
  const int pictures = layout.sub_frames * (planes ? display::kProjectorParts : 1);
  const auto level = [&](int bits) {
    const int step = kFull / ((1 << bits) - 1);
    return std::max(Comparison::kSmall, (step + pictures - 1) / pictures);
  };
  const int bits = layout.bits_per_channel();
  const bool less_blue = layout.format == display::PixelFormat::kRgb332;
  return {level(bits), level(bits), level(less_blue ? bits - 1 : bits)};
}

class Planes {
 public:
  Planes(const display::VoxelGrid& grid, int32_t reach, const ReadPlanes& read)
      : grid_(grid), reach_(reach), read_(read), plane_(int64_t{grid.nx} * grid.ny) {
    slab_ = static_cast<int32_t>(std::clamp<int64_t>(kSlab / plane_, 1, grid.nz));
  }

  // Reads the planes within reach of z. Requires: z ascends.
  absl::Status MoveTo(int32_t z) {
    while (end_ < std::min(z + reach_ + 1, grid_.nz)) {
      const int32_t to = std::min(end_ + slab_, grid_.nz);
      const int32_t keep = std::clamp(z - reach_, begin_, end_);  // planes that are still needed
      std::vector<uint32_t> next(static_cast<size_t>((to - keep) * plane_));
      if (end_ > keep) {
        std::copy(voxels_.begin() + (keep - begin_) * plane_, voxels_.end(), next.begin());
      }
      const auto fresh = static_cast<size_t>((end_ - keep) * plane_);
      if (absl::Status status = read_(end_, to, std::span(next).subspan(fresh)); !status.ok()) {
        return status;
      }
      voxels_ = std::move(next);
      begin_ = keep, end_ = to;
    }
    return absl::OkStatus();
  }

  const uint32_t* Row(int32_t z, int32_t y) const {
    return voxels_.data() + (z - begin_) * plane_ + int64_t{y} * grid_.nx;
  }

 private:
  const display::VoxelGrid& grid_;
  const int32_t reach_;
  const ReadPlanes& read_;
  const int64_t plane_;
  int32_t slab_ = 1;
  int32_t begin_ = 0, end_ = 0;
  std::vector<uint32_t> voxels_;
};

// Points in a box, thinned out evenly if there are too many.
class Thinned {
 public:
  Thinned(const PlaceBox& box, Points& points) : box_(box), points_(points) {}

  void Add(const display::Vec3& mm, const Color& color) {
    if (came_++ % stride_ != 0) return;
    const auto step = [](double at, double low, double high) {
      const double q = high > low ? std::lround((at - low) / (high - low) * kPlaceSteps) : 0;
      return static_cast<uint16_t>(std::clamp(q, 0.0, static_cast<double>(kPlaceSteps)));
    };
    points_.x.push_back(step(mm.x, box_.low_mm.x, box_.high_mm.x));
    points_.y.push_back(step(mm.y, box_.low_mm.y, box_.high_mm.y));
    points_.z.push_back(step(mm.z, box_.low_mm.z, box_.high_mm.z));
    for (const int channel : color) points_.rgb.push_back(static_cast<uint8_t>(channel));
    if (points_.size() < Comparison::kMostPoints) return;
    stride_ *= 2;
    Halve(points_.x, 1), Halve(points_.y, 1), Halve(points_.z, 1), Halve(points_.rgb, 3);
  }

 private:
  template <typename T>
  static void Halve(std::vector<T>& values, size_t each) {
    const size_t left = values.size() / each / 2;
    for (size_t i = 0; i < left * each; ++i) values[i] = values[i / each * 2 * each + i % each];
    values.resize(left * each);
  }

  const PlaceBox& box_;
  Points& points_;
  uint64_t came_ = 0, stride_ = 1;
};

class Comparing {
 public:
  Comparing(const display::VoxelGrid& grid, const display::FrameLayout& layout,
            const display::Tone& tone, const Reach& reach, const PlaceBox& box, const Points& shown,
            const ReadPlanes& read)
      : grid_(grid),
        tone_(tone),
        level_(LevelOf(layout)),
        from_(box),
        shown_(shown),
        reach_(reach),
        planes_(grid, reach.z, read),
        near_(grid, reach) {
    FindBox();
  }

  absl::StatusOr<Comparison> Run() {
    const std::vector<PixelCell> pixels = SortPixels();
    size_t held = 0;
    for (; held < pixels.size() && pixels[held].z == kNowhere; ++held) Stray(pixels[held].point);
    size_t marked = held;
    for (int32_t z = -2 * reach_.z; z < grid_.nz + reach_.z; ++z) {
      // Marks pixels ahead of the voxels that look for them.
      const size_t first = marked;
      while (marked < pixels.size() && pixels[marked].z <= z + reach_.z) ++marked;
      near_.Add(std::span(pixels).subspan(first, marked - first));
      if (z > 0) near_.Drop();
      if (z < -reach_.z) continue;
      if (absl::Status status = planes_.MoveTo(std::clamp(z, 0, grid_.nz - 1)); !status.ok()) {
        return status;
      }
      for (; held < pixels.size() && pixels[held].z == z; ++held) Hold(pixels[held]);
      if (z >= 0 && z < grid_.nz) LookForMissing(z);
    }
    const uint64_t held_up = comparison_.pixels - comparison_.stray;
    if (held_up > 0) comparison_.mean = static_cast<double>(sum_) / static_cast<double>(held_up);
    return std::move(comparison_);
  }

 private:
  static constexpr int16_t kNowhere = INT16_MIN;  // beyond the reach of the grid

  static double At(uint16_t q, double low, double high) {
    return low + q * (high - low) / kPlaceSteps;
  }

  // Computes the box around the pixels' places and all voxels' centres.
  void FindBox() {
    const display::Vec3 &o = grid_.origin_mm, &p = grid_.pitch_mm;
    const auto join = [](double low, double high, double origin, double pitch, int32_t n) {
      return std::pair(std::min(low, origin + pitch / 2),
                       std::max(high, origin + (n - 1) * pitch + pitch / 2));
    };
    PlaceBox& box = comparison_.box;
    const auto [x0, x1] = join(from_.low_mm.x, from_.high_mm.x, o.x, p.x, grid_.nx);
    const auto [y0, y1] = join(from_.low_mm.y, from_.high_mm.y, o.y, p.y, grid_.ny);
    const auto [z0, z1] = join(from_.low_mm.z, from_.high_mm.z, o.z, p.z, grid_.nz);
    box = {{x0, y0, z0}, {x1, y1, z1}};
    comparison_.pitch_mm = std::min({p.x, p.y, p.z});
  }

  display::Vec3 PlaceOf(size_t point) const {
    return {At(shown_.x[point], from_.low_mm.x, from_.high_mm.x),
            At(shown_.y[point], from_.low_mm.y, from_.high_mm.y),
            At(shown_.z[point], from_.low_mm.z, from_.high_mm.z)};
  }

  Color ColorOf(size_t point) const {
    const uint8_t* rgb = &shown_.rgb[point * 3];
    return {rgb[0], rgb[1], rgb[2]};
  }

  void Differs(const display::Vec3& mm, const Color& hue, int by) {
    difference_.Add(mm, {hue[0] * by / kFull, hue[1] * by / kFull, hue[2] * by / kFull});
  }

  void Stray(size_t point) {
    ++comparison_.stray;
    Differs(PlaceOf(point), kExcess, Greatest(ColorOf(point)));
  }

  std::vector<PixelCell> SortPixels() {
    comparison_.pixels = shown_.size();
    std::vector<PixelCell> pixels;
    pixels.reserve(shown_.size());
    const auto cell = [](double mm, double origin, double pitch, int32_t n, int32_t reach) {
      const double at = std::floor((mm - origin) / pitch);
      return at < -reach || at >= n + reach ? kNowhere : static_cast<int16_t>(at);
    };
    const display::Vec3 &o = grid_.origin_mm, &p = grid_.pitch_mm;
    for (size_t point = 0; point < shown_.size(); ++point) {
      const display::Vec3 mm = PlaceOf(point);
      const int16_t x = cell(mm.x, o.x, p.x, grid_.nx, reach_.x);
      const int16_t y = cell(mm.y, o.y, p.y, grid_.ny, reach_.y);
      const int16_t z = cell(mm.z, o.z, p.z, grid_.nz, reach_.z);
      const bool nowhere = x == kNowhere || y == kNowhere || z == kNowhere;
      pixels.push_back({x, y, nowhere ? kNowhere : z, static_cast<uint32_t>(point)});
    }
    std::stable_sort(pixels.begin(), pixels.end(),
                     [](const PixelCell& a, const PixelCell& b) { return a.z < b.z; });
    return pixels;
  }

  struct Nearest {
    int by = kFull + 1;  // above the maximum: no voxel is lit
    Color wanted = {};
  };

  // Returns: the most similar lit voxel within `reach`.
  Nearest Look(const PixelCell& pixel, const Color& shown, const Reach& reach) const {
    Nearest nearest;
    const int32_t x0 = std::max(0, pixel.x - reach.x);
    const int32_t x1 = std::min(grid_.nx - 1, pixel.x + reach.x);
    const int32_t y0 = std::max(0, pixel.y - reach.y);
    const int32_t y1 = std::min(grid_.ny - 1, pixel.y + reach.y);
    const int32_t z0 = std::max(0, pixel.z - reach.z);
    const int32_t z1 = std::min(grid_.nz - 1, pixel.z + reach.z);
    for (int32_t z = z0; z <= z1; ++z) {
      for (int32_t y = y0; y <= y1; ++y) {
        const uint32_t* row = planes_.Row(z, y);
        for (int32_t x = x0; x <= x1; ++x) {
          if (row[x] == 0) continue;  // a lit pixel is not compared with dark voxels
          const Color light = Wanted(row[x], shown);
          const int by = Greatest(Apart(shown, light));
          if (by < nearest.by) nearest = {by, light};
        }
      }
    }
    return nearest;
  }

  bool IsRight(const Color& shown, const Nearest& nearest) const {
    const Color apart = Apart(shown, nearest.wanted);
    return nearest.by <= kFull && apart[0] <= level_[0] && apart[1] <= level_[1] &&
           apart[2] <= level_[2];
  }

  void Hold(const PixelCell& pixel) {
    const Color shown = ColorOf(pixel.point);
    // Most pixels match the voxel at their own place.
    Nearest nearest = Look(pixel, shown, {0, 0, 0});
    if (!IsRight(shown, nearest)) nearest = Look(pixel, shown, reach_);
    if (nearest.by > kFull) {
      Stray(pixel.point);
      return;
    }
    sum_ += nearest.by;
    comparison_.most = std::max(comparison_.most, nearest.by);
    if (IsRight(shown, nearest)) return;
    ++comparison_.off;
    const Color& wanted = nearest.wanted;
    const bool more = shown[0] + shown[1] + shown[2] > wanted[0] + wanted[1] + wanted[2];
    Differs(PlaceOf(pixel.point), more ? kExcess : kMissing, nearest.by);
  }

  Color Wanted(uint32_t rgb, const Color& shown) const {
    Color light = LightOf(tone_, rgb);
    const int has = Greatest(shown), full = Greatest(light);
    const bool dims =
        tone_.density == display::Density::kEven || tone_.sampling == display::Sampling::kWeighted;
    if (dims && full > has) {
      for (int& channel : light) channel = (channel * has + full / 2) / full;
    }
    return light;
  }

  void LookForMissing(int32_t z) {
    for (int32_t y = 0; y < grid_.ny; ++y) {
      const uint32_t* row = planes_.Row(z, y);
      for (int32_t x = 0; x < grid_.nx; ++x) {
        if (row[x] == 0) continue;
        const Color light = LightOf(tone_, row[x]);
        const display::Vec3 mm = CentreOf(x, y, z);
        ++comparison_.voxels;
        sent_.Add(mm, light);
        if (near_.At(x, y)) continue;
        ++comparison_.missing;
        Differs(mm, kMissing, std::max(1, Greatest(light)));
      }
    }
  }

  display::Vec3 CentreOf(int32_t x, int32_t y, int32_t z) const {
    const display::Vec3 &o = grid_.origin_mm, &p = grid_.pitch_mm;
    return {o.x + (x + 0.5) * p.x, o.y + (y + 0.5) * p.y, o.z + (z + 0.5) * p.z};
  }

  const display::VoxelGrid& grid_;
  const display::Tone& tone_;
  const Color level_;
  const PlaceBox& from_;
  const Points& shown_;
  const Reach reach_;
  Planes planes_;
  NearPixels near_;
  int64_t sum_ = 0;
  Comparison comparison_;
  Thinned sent_{comparison_.box, comparison_.sent};
  Thinned difference_{comparison_.box, comparison_.difference};
};

}  // namespace

absl::Status CheckComparable(const display::VoxelGrid& grid, size_t lit_pixels) {
  const int64_t cells = int64_t{grid.nx} * grid.ny * grid.nz;
  if (cells > kMostCells) {
    return absl::InvalidArgumentError(absl::StrFormat(
        "the display has %d voxels; displays of up to %d are compared", cells, kMostCells));
  }
  if (lit_pixels > kMostPixels) {
    return absl::InvalidArgumentError(
        absl::StrFormat("more than %d pixels are lit; with fewer it is compared", kMostPixels));
  }
  return absl::OkStatus();
}

absl::StatusOr<Comparison> Compare(const display::VoxelGrid& grid,
                                   const display::FrameLayout& layout, const display::Tone& tone,
                                   const Reach& reach, const PlaceBox& box, const Points& shown,
                                   const ReadPlanes& read) {
  return Comparing(grid, layout, tone, reach, box, shown, read).Run();
}

}  // namespace voxeld::daemon::viewer
