#include "gpu/slice/pictures.h"

#include <algorithm>
#include <atomic>
#include <cstring>
#include <utility>

#include "gpu/slice/pack.h"

namespace voxeld::gpu {

void Pictures::SetPlan(SlicePlan plan) {
  const bool same_pictures =
      plan_ && plan_->layout == plan.layout && plan_->begin == plan.begin && plan_->end == plan.end;
  plan_.emplace(std::move(plan));
  const size_t slices = static_cast<size_t>(plan_->end - plan_->begin);
  const size_t count = slices * static_cast<size_t>(plan_->layout.sub_frames);
  if (!same_pictures) {
    bytes_.assign(count * plan_->layout.bytes_per_slice(), 0);
    changed_in_.assign(count, 0);
    blank_.assign(slices, 1);
  }
  lit_tiles_.assign(slices, 0);
  dirty_.assign(slices, 1);
  scratch_.clear();
  scratch_.resize(static_cast<size_t>(executor_.concurrency()));
}

void Pictures::MarkSlices(const TileStore& tiles, const Volume::Changes& changes) {
  for (size_t i = 0; i < changes.tiles.size(); ++i) {
    const uint32_t tile = changes.tiles[i];
    const uint32_t before = changes.was_lit[i], now = tiles.colors(tile) != nullptr;
    int32_t ijk[3];
    tiles.grid().Coordinates(tile, ijk);
    for (int32_t slice : plan_->tile_to_slices.Slices(ijk[0], ijk[1], ijk[2])) {
      if (slice < plan_->begin || slice >= plan_->end) continue;
      const size_t s = static_cast<size_t>(slice - plan_->begin);
      dirty_[s] = 1;
      lit_tiles_[s] = lit_tiles_[s] - before + now;
    }
  }
}

template <display::PixelFormat kFormat>
void Pictures::PackAs(const SlicePixels& pixels, uint32_t sub, uint8_t* picture) const {
  const display::FrameLayout& layout = plan_->layout;
  const display::Tone& tone = plan_->tone;
  const uint32_t width = static_cast<uint32_t>(layout.width);
  const uint32_t height = static_cast<uint32_t>(layout.height);
  constexpr Levels kLevels = LevelsOf(kFormat);
  uint32_t thresholds[8][8];  // they repeat every 8 pixels
  for (uint32_t v = 0; v < 8; ++v) {
    for (uint32_t u = 0; u < 8; ++u) {
      thresholds[v][u] =
          Threshold(tone.dither, u, v, sub, static_cast<uint32_t>(layout.sub_frames));
    }
  }
  for (const auto& [index, u, v] : pixels.lit) {
    const uint32_t rgb = pixels.rgb[index];
    const uint32_t threshold = thresholds[v % 8][u % 8];
    const Levels q = {Quantize(tone.lut[rgb >> 16], kLevels.r, threshold),
                      Quantize(tone.lut[(rgb >> 8) & 0xFF], kLevels.g, threshold),
                      Quantize(tone.lut[rgb & 0xFF], kLevels.b, threshold)};
    PackPixel(kFormat, width, height, u, v, q, picture);
  }
}

void Pictures::Pack(const SlicePixels& pixels, uint32_t sub, uint8_t* picture) const {
  switch (plan_->layout.format) {
    case display::PixelFormat::kRgb888:
      return PackAs<display::PixelFormat::kRgb888>(pixels, sub, picture);
    case display::PixelFormat::kRgb332:
      return PackAs<display::PixelFormat::kRgb332>(pixels, sub, picture);
    case display::PixelFormat::kBitPlanes3:
      return PackAs<display::PixelFormat::kBitPlanes3>(pixels, sub, picture);
  }
}

// True if some picture of the slice is not what it was.
bool Pictures::DrawSlice(const TileStore& tiles, int32_t slice, uint64_t frame, Scratch& scratch) {
  const display::FrameLayout& layout = plan_->layout;
  const size_t s = static_cast<size_t>(slice - plan_->begin);
  const size_t sub_frames = static_cast<size_t>(layout.sub_frames);
  const bool blank = lit_tiles_[s] == 0;
  scratch.pixels.Clear(static_cast<size_t>(layout.width) * static_cast<size_t>(layout.height));
  if (!blank) plan_->sampler.Sample(tiles, slice, scratch.pixels);
  bool changed = false;
  for (size_t sub = 0; sub < sub_frames; ++sub) {
    const size_t index = s * sub_frames + sub;
    bool differs = changed_in_[index] == 0;
    if (!blank || blank_[s] == 0) {
      scratch.picture.assign(layout.bytes_per_slice(), 0);
      Pack(scratch.pixels, static_cast<uint32_t>(sub), scratch.picture.data());
      if (std::memcmp(picture(index), scratch.picture.data(), scratch.picture.size()) != 0) {
        std::memcpy(picture(index), scratch.picture.data(), scratch.picture.size());
        differs = true;
      }
    }
    if (differs) changed_in_[index] = frame;
    changed |= differs;
  }
  blank_[s] = blank;
  return changed;
}

Pictures::Result Pictures::Update(const TileStore& tiles, const Volume::Changes& changes,
                                  uint64_t frame) {
  MarkSlices(tiles, changes);
  std::vector<int32_t> slices;
  for (size_t s = 0; s < dirty_.size(); ++s) {
    if (dirty_[s] != 0) slices.push_back(plan_->begin + static_cast<int32_t>(s));
    dirty_[s] = 0;
  }
  std::vector<uint8_t> changed(slices.size());
  executor_.For(slices.size(), 1, [&](size_t i, int worker) {
    changed[i] = DrawSlice(tiles, slices[i], frame, scratch_[static_cast<size_t>(worker)]);
  });
  Result result;
  result.pictures_drawn =
      static_cast<uint32_t>(slices.size()) * static_cast<uint32_t>(plan_->layout.sub_frames);
  result.changed = std::find(changed.begin(), changed.end(), 1) != changed.end();
  return result;
}

void Pictures::CopyTo(FrameBuffer buffer, uint64_t buffer_holds) const {
  const size_t size = plan_->layout.bytes_per_slice();
  const size_t first =
      static_cast<size_t>(plan_->begin) * static_cast<size_t>(plan_->layout.sub_frames);
  executor_.For(changed_in_.size(), 16, [&](size_t i, int) {
    buffer.changed_in[first + i] = changed_in_[i];
    if (changed_in_[i] <= buffer_holds) return;
    std::memcpy(buffer.bytes.data() + (first + i) * size, bytes_.data() + i * size, size);
  });
}

}  // namespace voxeld::gpu
