#include "gpu/slice/pictures.h"

#include <algorithm>
#include <atomic>
#include <cstring>
#include <utility>

#include "gpu/slice/pack.h"

namespace voxeld::gpu {
namespace {

template <display::PixelFormat kFormat>
PictureShape ShapeOf(const display::FrameLayout& layout) {
  return {kFormat, static_cast<uint32_t>(layout.bits_per_channel()),
          static_cast<uint32_t>(layout.width), static_cast<uint32_t>(layout.height)};
}

}  // namespace

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
  columns_.reset();
  packer_.reset();
  if (plan_->light->plain(plan_->layout)) {
    levels_ = LevelTables::Of(plan_->layout, plan_->tone);
    columns_ = LevelColumns::Create(plan_->sampler.table(), plan_->sampler.grid(), plan_->layout,
                                    plan_->tone, plan_->begin, plan_->end);
    packer_ =
        PlanePacker::Create(plan_->sampler, plan_->layout, plan_->tone, plan_->begin, plan_->end);
  }
  if (packer_) {
    before_ = std::exchange(bytes_, std::vector<uint8_t>(bytes_.size()));
    packer_->SetPictures(bytes_);
    blank_.assign(slices, 0);  // the packer does not report which of its slice images are blank
  } else {
    before_ = {};
  }
  lit_tiles_.assign(slices, 0);
  dirty_.assign(slices, 1);
  scratch_.clear();
  scratch_.resize(static_cast<size_t>(executor_.concurrency()));
}

void Pictures::MarkSlices(const TileStore& tiles, const Volume::Changes& changes) {
  const display::TileToSlices::Tables look = plan_->tile_to_slices.tables();
  size_t left = dirty_.size() - static_cast<size_t>(std::count(dirty_.begin(), dirty_.end(), 1));
  for (size_t i = 0; i < changes.tiles.size(); ++i) {
    const uint32_t tile = changes.tiles[i];
    const uint32_t before = changes.was_lit[i], now = tiles.colors(tile) != nullptr;
    if (left == 0 && before == now) continue;
    int32_t ijk[3];
    tiles.grid().Coordinates(tile, ijk);
    size_t place = 0;
    for (int a = 0; a < 3; ++a) {
      place += static_cast<size_t>(look.stride[a]) * static_cast<size_t>(ijk[a]);
    }
    const auto inner = static_cast<size_t>(ijk[static_cast<int>(look.inner_axis)]);
    for (uint32_t n = look.begin[place]; n < look.begin[place + 1]; ++n) {
      const int32_t slice = look.slices[n];
      if (slice < plan_->begin || slice >= plan_->end) continue;
      const auto set = static_cast<size_t>(slice % look.inner_sets);
      if (look.seen[set * static_cast<size_t>(look.inner_tiles) + inner] == 0) {
        continue;
      }
      const size_t s = static_cast<size_t>(slice - plan_->begin);
      left -= dirty_[s] == 0;
      dirty_[s] = 1;
      lit_tiles_[s] = lit_tiles_[s] - before + now;
    }
  }
}

template <display::PixelFormat kFormat>
void Pictures::PackAs(const SlicePixels& pixels, uint32_t sub, uint8_t* picture) const {
  const display::FrameLayout& layout = plan_->layout;
  const PictureShape shape = ShapeOf<kFormat>(layout);
  uint64_t below[8];  // repeats every 8 pixels
  for (uint32_t u = 0; u < 8; ++u) {
    below[u] = DitherColumn(u, sub, static_cast<uint32_t>(layout.sub_frames));
  }
  for (const auto& [rgb, u, v] : pixels.lit) {
    const uint32_t least = below[u % 8] >> (v % 8 * 8) & 0xFF;
    const auto level = [&](int channel, uint32_t c) {
      return levels_.base[channel][c] + static_cast<uint32_t>(levels_.rise[channel][c] > least);
    };
    const Levels q = {level(LevelTables::kRed, rgb >> 16),
                      level(LevelTables::kGreen, (rgb >> 8) & 0xFF),
                      level(LevelTables::kBlue, rgb & 0xFF)};
    PackPixel(shape, u, v, q, picture);
  }
}

// Follows the definition, pixel by pixel.
template <display::PixelFormat kFormat>
void Pictures::FinishAs(const SlicePixels& pixels, int32_t slice, uint32_t sub,
                        uint8_t* picture) const {
  const PictureShape shape = ShapeOf<kFormat>(plan_->layout);
  const display::FootprintTable& table = plan_->sampler.table();
  Finish finish = plan_->light->finish(plan_->layout, plan_->tone);
  finish.format = kFormat;
  const size_t first = static_cast<size_t>(slice) * static_cast<size_t>(table.width);
  const auto row = static_cast<uint32_t>(table.flat_row);
  for (const auto& [rgb, u, v] : pixels.lit) {
    const Light light = finish.LightAt(rgb, first + v * row + u);
    PackPixel(shape, u, v, finish.LevelsAt(light, static_cast<uint32_t>(slice), u, v, sub),
              picture);
  }
}

void Pictures::Pack(const SlicePixels& pixels, int32_t slice, uint32_t sub,
                    uint8_t* picture) const {
  const bool plain = plan_->light->plain(plan_->layout);
  const auto as = [&]<display::PixelFormat kFormat>() {
    plain ? PackAs<kFormat>(pixels, sub, picture) : FinishAs<kFormat>(pixels, slice, sub, picture);
  };
  switch (plan_->layout.format) {
    case display::PixelFormat::kRgb888:
      return as.template operator()<display::PixelFormat::kRgb888>();
    case display::PixelFormat::kRgb332:
      return as.template operator()<display::PixelFormat::kRgb332>();
    case display::PixelFormat::kBitPlanes:
      return as.template operator()<display::PixelFormat::kBitPlanes>();
    case display::PixelFormat::kHub75:
      return as.template operator()<display::PixelFormat::kHub75>();
    case display::PixelFormat::kPlanes24:
      return as.template operator()<display::PixelFormat::kPlanes24>();
  }
}

// Stores a slice image's new bytes; returns true if they changed.
bool Pictures::Keep(size_t index, std::span<const uint8_t> drawn, uint64_t frame) {
  const bool differs = std::memcmp(picture(index), drawn.data(), drawn.size()) != 0;
  if (differs) std::memcpy(picture(index), drawn.data(), drawn.size());
  if (differs || changed_in_[index] == 0) {
    changed_in_[index] = frame;
    return true;
  }
  return false;
}

// Draws the slices; returns true if a slice image changed.
bool Pictures::DrawSlices(const TileStore& tiles, std::span<const int32_t> slices, uint64_t frame,
                          Scratch& scratch) {
  const display::FrameLayout& layout = plan_->layout;
  const size_t sub_frames = static_cast<size_t>(layout.sub_frames);
  const auto index_of = [&](int32_t slice, size_t sub) {
    return static_cast<size_t>(slice - plan_->begin) * sub_frames + sub;
  };
  bool changed = false;
  scratch.lit.clear();
  for (const int32_t slice : slices) {
    const size_t s = static_cast<size_t>(slice - plan_->begin);
    const bool blank = lit_tiles_[s] == 0, was_blank = blank_[s] != 0;
    blank_[s] = blank;
    if (!blank && columns_) {
      scratch.lit.push_back(slice);
      continue;
    }
    scratch.pixels.lit.clear();
    if (!blank) plan_->sampler.Sample(tiles, slice, scratch.pixels);
    for (size_t sub = 0; sub < sub_frames; ++sub) {
      if (!blank || !was_blank) {
        scratch.picture.assign(layout.bytes_per_slice(), 0);
        Pack(scratch.pixels, slice, static_cast<uint32_t>(sub), scratch.picture.data());
        changed |= Keep(index_of(slice, sub), scratch.picture, frame);
      } else if (uint64_t& in = changed_in_[index_of(slice, sub)]; in == 0) {
        in = frame;
        changed = true;
      }
    }
  }
  for (size_t sub = 0; sub < sub_frames && !scratch.lit.empty(); ++sub) {
    columns_->Draw(scratch.lit, static_cast<uint32_t>(sub), scratch.columns);
    for (size_t i = 0; i < scratch.lit.size(); ++i) {
      changed |= Keep(index_of(scratch.lit[i], sub), columns_->picture(i, scratch.columns), frame);
    }
  }
  return changed;
}

// Takes over the packer's results; returns true if a slice image changed.
bool Pictures::TakePacked(const TileStore& tiles, std::span<const uint32_t> unobserved,
                          uint64_t frame) {
  executor_.For(unobserved.size(), 1, [&](size_t i, int) {
    constexpr TileWords kDark = {};
    const uint32_t tile = unobserved[i];
    const bool lit = tiles.colors(tile) != nullptr;
    packer_->OnTile(tile, lit ? tiles.colors(tile) : kDark.at, lit ? tiles.rows(tile) : TileRows());
  });
  const size_t size = plan_->layout.bytes_per_slice();
  bool changed = false;
  for (size_t i = 0; i < changed_in_.size(); ++i) {
    bool differs = packer_->TakeDiffers(i);
    if (!before_.empty()) {
      differs = std::memcmp(&bytes_[i * size], &before_[i * size], size) != 0;
    }
    if (!differs && changed_in_[i] != 0) continue;
    changed_in_[i] = frame;
    changed = true;
  }
  before_ = {};
  return changed;
}

Pictures::Result Pictures::Update(const TileStore& tiles, const Volume::Changes& changes,
                                  std::span<const uint32_t> unobserved, uint64_t frame) {
  MarkSlices(tiles, changes);
  std::vector<int32_t> slices;
  for (size_t s = 0; s < dirty_.size(); ++s) {
    if (dirty_[s] != 0) slices.push_back(plan_->begin + static_cast<int32_t>(s));
    dirty_[s] = 0;
  }
  Result result;
  result.pictures_drawn =
      static_cast<uint32_t>(slices.size()) * static_cast<uint32_t>(plan_->layout.sub_frames);
  if (packer_) {
    result.changed = TakePacked(tiles, unobserved, frame);
    return result;
  }
  if (columns_) columns_->Update(tiles, changes.tiles, executor_);
  // Data that neighbours have in common is fetched once for all of them.
  const size_t together = columns_ ? LevelColumns::kSlicesTogether : 1;
  std::vector<uint8_t> changed((slices.size() + together - 1) / together);
  executor_.For(changed.size(), 1, [&](size_t i, int worker) {
    const size_t at = i * together;
    changed[i] =
        DrawSlices(tiles, std::span(slices).subspan(at, std::min(together, slices.size() - at)),
                   frame, scratch_[static_cast<size_t>(worker)]);
  });
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
