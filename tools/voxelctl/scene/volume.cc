#include "tools/voxelctl/scene/volume.h"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"

namespace voxeld::voxelctl {
namespace {

constexpr uint64_t kBesideAsset = 64 << 10;  // for the rest of a commit that shows an asset
constexpr uint64_t kMostBytes = 64u << 20;   // if the server gives no limit
constexpr uint32_t kMostAlong = 65536;
constexpr size_t kBins = 1024;
constexpr double kOutliers = 0.001;
constexpr client::Color kSurfaceColor = {150, 200, 255};

using Size = std::array<uint32_t, 3>;

struct Range {
  double least = HUGE_VAL, greatest = -HUGE_VAL;
};

Range RangeOf(const std::vector<float>& samples) {
  Range range;
  for (const float v : samples) {
    if (std::isnan(v)) continue;
    range.least = std::min(range.least, double{v});
    range.greatest = std::max(range.greatest, double{v});
  }
  return range;
}

// Otsu's method: the threshold at which the means of the two sides differ most, weighted by their
// counts.
std::array<double, 2> FindWindow(const std::vector<float>& samples, const Range& range) {
  if (!(range.least < range.greatest)) return {range.least - 1, range.least};
  std::vector<uint64_t> counts(kBins);
  const double per_bin = (range.greatest - range.least) / kBins;
  uint64_t all = 0;
  for (const float v : samples) {
    if (std::isnan(v)) continue;
    ++counts[std::min(kBins - 1, static_cast<size_t>((v - range.least) / per_bin))];
    ++all;
  }
  size_t top = kBins;
  for (double beyond = 0; top > 1; --top) {
    beyond += static_cast<double>(counts[top - 1]);
    if (beyond > kOutliers * static_cast<double>(all)) break;
  }
  double sum = 0, below = 0, below_sum = 0, best = -1;
  for (size_t i = 0; i < kBins; ++i) {
    sum += static_cast<double>(counts[i]) * static_cast<double>(std::min(i, top));
  }
  size_t parting = 1;
  for (size_t i = 0; i + 1 < top; ++i) {
    below += static_cast<double>(counts[i]);
    below_sum += static_cast<double>(counts[i]) * static_cast<double>(i);
    const double above = static_cast<double>(all) - below;
    if (below == 0 || above == 0) continue;
    const double apart = below_sum / below - (sum - below_sum) / above;
    if (below * above * apart * apart > best) best = below * above * apart * apart, parting = i + 1;
  }
  const double low = range.least + static_cast<double>(std::min(parting, top - 1)) * per_bin;
  return {low, std::max(range.least + static_cast<double>(top) * per_bin, low + per_bin)};
}

// Returns the samples of a cell along each axis. The shortest cells grow first, until at most
// `most` remain.
Size Factors(const SampledVolume& volume, uint64_t most) {
  std::array<double, 3> step;
  for (size_t axis = 0; axis < 3; ++axis) {
    const Point3 &from = volume.corners[0], &to = volume.corners[size_t{1} << axis];
    step[axis] = std::hypot(to.x - from.x, to.y - from.y, to.z - from.z) / volume.size[axis];
  }
  Size factors = {1, 1, 1};
  const auto along = [&](size_t axis) -> uint64_t {
    return (volume.size[axis] + factors[axis] - 1) / factors[axis];
  };
  while (along(0) * along(1) * along(2) > std::max<uint64_t>(most, 1)) {
    size_t shortest = 3;
    for (size_t axis = 0; axis < 3; ++axis) {
      if (along(axis) == 1) continue;
      if (shortest == 3 || step[axis] * factors[axis] < step[shortest] * factors[shortest])
        shortest = axis;
    }
    ++factors[shortest];
  }
  for (size_t axis = 0; axis < 3; ++axis) {
    while (along(axis) > kMostAlong) ++factors[axis];
  }
  return factors;
}

// For each cell, calls `begin`, `add` with the index of each of its samples, and `end` with their
// number.
template <typename Begin, typename Add, typename End>
void ForEachCell(const Size& size, const Size& factors, Begin begin, Add add, End end) {
  const auto& [nx, ny, nz] = size;
  for (uint32_t z = 0; z < nz; z += factors[2]) {
    for (uint32_t y = 0; y < ny; y += factors[1]) {
      for (uint32_t x = 0; x < nx; x += factors[0]) {
        const uint32_t r = std::min(nx, x + factors[0]), b = std::min(ny, y + factors[1]),
                       f = std::min(nz, z + factors[2]);
        begin();
        for (uint32_t w = z; w < f; ++w) {
          for (uint32_t v = y; v < b; ++v) {
            for (uint32_t u = x; u < r; ++u) add((uint64_t{w} * ny + v) * nx + u);
          }
        }
        end(uint64_t{r - x} * (b - y) * (f - z));
      }
    }
  }
}

// Returns the mean of each cell's values as integers: 0 at `low` or without values, the maximum at
// `high`.
template <typename T>
std::vector<T> Quantise(const SampledVolume& volume, const Size& factors, uint64_t count,
                        double low, double high) {
  std::vector<T> out;
  out.reserve(count);
  constexpr double kTop = static_cast<T>(~T{0});
  double sum = 0;
  uint32_t numbers = 0;
  ForEachCell(
      volume.size, factors, [&] { sum = 0, numbers = 0; },
      [&](uint64_t i) {
        const float v = volume.samples[i];
        if (!std::isnan(v)) sum += v, ++numbers;
      },
      [&](uint64_t) {
        const double v = numbers > 0 ? sum / numbers : low;
        const double share = std::clamp((v - low) / (high - low), 0.0, 1.0);
        out.push_back(static_cast<T>(std::lround(share * kTop)));
      });
  return out;
}

// Returns four bytes per cell, r g b and 255; 0 if all is black.
std::vector<uint8_t> Colors(const SampledVolume& volume, const Size& factors, uint64_t count) {
  std::vector<uint8_t> out;
  out.reserve(count * 4);
  std::array<double, 3> sum = {};
  ForEachCell(
      volume.size, factors, [&sum] { sum = {}; },
      [&](uint64_t i) {
        const Rgb& c = volume.colors[i];
        sum[0] += c.r, sum[1] += c.g, sum[2] += c.b;
      },
      [&](uint64_t cells) {
        uint8_t brightest = 0;
        for (const double channel : sum) {
          out.push_back(static_cast<uint8_t>(std::lround(channel / static_cast<double>(cells))));
          brightest = std::max(brightest, out.back());
        }
        out.push_back(brightest > 0 ? 255 : 0);
      });
  return out;
}

client::Vec3 ToClient(const Point3& p) { return {p.x, p.y, p.z}; }

bool AreColors(const SampledVolume& volume, const VolumeLook& look) {
  return !volume.colors.empty() && !look.level && !look.window && look.colormap.empty();
}

uint64_t BytesEach(const SampledVolume& volume, const VolumeLook& look) {
  return look.level ? 2 : AreColors(volume, look) ? 4 : 1;
}

// The result of bytes that are sent as an asset.
struct Brought {
  const AssetSink& upload;
  absl::Status status;
};

// Returns the numbers themselves, or the asset that replaces them.
template <typename T>
client::Array<T> ToArray(std::vector<T> numbers, Brought* brought) {
  if (brought == nullptr) return client::Array<T>(std::move(numbers));
  const absl::StatusOr<client::Asset> asset = brought->upload(
      absl::string_view(reinterpret_cast<const char*>(numbers.data()), numbers.size() * sizeof(T)));
  if (asset.ok()) return client::Array<T>(*asset);
  brought->status = asset.status();
  return client::Array<T>();
}

}  // namespace

std::array<double, 2> WindowOf(const SampledVolume& volume) {
  return volume.window ? *volume.window : FindWindow(volume.samples, RangeOf(volume.samples));
}

namespace {

// Packs the volume into at most `bytes`; with `brought`, they are sent as an asset.
absl::StatusOr<PackedVolume> PackWithin(const SampledVolume& volume, const VolumeLook& look,
                                        uint64_t bytes, Brought* brought) {
  const bool colors = AreColors(volume, look);
  const uint64_t each = BytesEach(volume, look);
  const Size factors = Factors(volume, bytes / each);

  client::Grid grid;
  Size size;
  std::array<Point3, 3> edges;
  for (size_t axis = 0; axis < 3; ++axis) {
    size[axis] = (volume.size[axis] + factors[axis] - 1) / factors[axis];
    // The last cell may extend beyond the volume.
    const double stretch =
        static_cast<double>(uint64_t{size[axis]} * factors[axis]) / volume.size[axis];
    const Point3 &from = volume.corners[0], &to = volume.corners[size_t{1} << axis];
    edges[axis] = {(to.x - from.x) * stretch, (to.y - from.y) * stretch, (to.z - from.z) * stretch};
  }
  grid.corner = ToClient(volume.corners[0]);
  grid.edge_a = ToClient(edges[0]);
  grid.edge_b = ToClient(edges[1]);
  grid.edge_c = ToClient(edges[2]);
  grid.size_a = size[0];
  grid.size_b = size[1];
  grid.size_c = size[2];
  PackedVolume packed;
  packed.samples = uint64_t{size[0]} * size[1] * size[2];
  packed.bytes = packed.samples * each;
  if (factors != Size{1, 1, 1}) {
    packed.note = absl::StrFormat(
        "%d by %d by %d samples are more than the server takes; averaged over %d by %d by %d of "
        "them",
        volume.size[0], volume.size[1], volume.size[2], factors[0], factors[1], factors[2]);
  }
  const Range range = RangeOf(volume.samples);
  if (look.level) {
    if (!(*look.level > range.least) || *look.level > range.greatest) {
      return absl::InvalidArgumentError(
          absl::StrCat("--level is ", *look.level, ", and the samples go from ", range.least,
                       " to ", range.greatest, "; a level above ", range.least, " and at most ",
                       range.greatest, " is expected"));
    }
    grid.samples = ToArray(
        Quantise<uint16_t>(volume, factors, packed.samples, range.least, range.greatest), brought);
    packed.part.shape = client::Isosurface{
        .grid = std::move(grid),
        .level = (*look.level - range.least) / (range.greatest - range.least) * 65535};
    packed.part.color = kSurfaceColor;
    if (!look.colormap.empty()) {
      client::ColorScale scale;
      scale.colormap = look.colormap;
      scale.along = client::Vec3{0, 0, 1};
      packed.part.color_scale = std::move(scale);
    }
    return packed;
  }
  if (colors) {
    grid.samples = ToArray(Colors(volume, factors, packed.samples), brought);
    packed.part.shape = client::Volume{.grid = std::move(grid), .colors = true, .transfer = {}};
    return packed;
  }
  const std::array<double, 2> window = look.window ? *look.window : WindowOf(volume);
  grid.samples =
      ToArray(Quantise<uint8_t>(volume, factors, packed.samples, window[0], window[1]), brought);
  client::Transfer transfer;
  transfer.colormap = look.colormap.empty() ? "gray" : look.colormap;
  if (look.colormap.empty()) {
    // Grey maps are already dark at their beginning.
    transfer.values = {0, 1, 255};
    transfer.opacities = {0, 1, 1};
  } else {
    transfer.values = {0, 255};
    transfer.opacities = {0, 1};
  }
  packed.part.shape = client::Volume{.grid = std::move(grid), .transfer = std::move(transfer)};
  return packed;
}

}  // namespace

absl::StatusOr<PackedVolume> PackVolume(const SampledVolume& volume, const VolumeLook& look,
                                        const client::Limits& limits, const AssetSink& upload) {
  const auto within = [](uint64_t most, uint64_t limit) {
    return limit > 0 ? std::min(most, limit) : most;
  };
  const auto beside_all_else = [](uint64_t most) {
    return most - std::min(most / 2, kMessageOverhead);
  };
  const uint64_t samples =
      limits.max_indices_per_entity > 0 ? limits.max_indices_per_entity * 4 : UINT64_MAX;
  const uint64_t message =
      std::min(samples, beside_all_else(within(within(kMostBytes, limits.max_message_bytes),
                                               limits.max_uncommitted_bytes)));
  // Until the commit, a server counts an asset twice: its bytes, and the form that its engines make
  // of it.
  const uint64_t asset =
      std::min(samples, within(limits.max_asset_bytes,
                               limits.max_uncommitted_bytes > 0
                                   ? (limits.max_uncommitted_bytes -
                                      std::min(limits.max_uncommitted_bytes / 2, kBesideAsset)) /
                                         2
                                   : 0));
  const uint64_t wanted = volume.samples.size() * BytesEach(volume, look);
  if (!upload || wanted <= message || asset <= message)
    return PackWithin(volume, look, message, nullptr);
  Brought brought{.upload = upload, .status = {}};
  absl::StatusOr<PackedVolume> packed = PackWithin(volume, look, asset, &brought);
  if (brought.status.ok()) return packed;
  if (absl::IsCancelled(brought.status) || absl::IsUnavailable(brought.status) ||
      absl::IsDeadlineExceeded(brought.status)) {
    return brought.status;
  }
  packed = PackWithin(volume, look, message, nullptr);
  if (packed.ok()) {
    packed->note = absl::StrCat("the server did not take it as an asset (",
                                brought.status.message(), "); ", packed->note);
  }
  return packed;
}

}  // namespace voxeld::voxelctl
