// Voxels of a tile, one behind the other, before they are drawn. One instruction set's share of the kernels.
#if defined(VOXELD_GPU_ASSEMBLE_DRAW_BLOCK_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef VOXELD_GPU_ASSEMBLE_DRAW_BLOCK_INL_H_
#undef VOXELD_GPU_ASSEMBLE_DRAW_BLOCK_INL_H_
#else
#define VOXELD_GPU_ASSEMBLE_DRAW_BLOCK_INL_H_
#endif

HWY_BEFORE_NAMESPACE();
namespace voxeld::gpu {
namespace HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

using DW = hn::CappedTag<uint32_t, 16>;
using VW = hn::Vec<DW>;

struct DrawBlock {
  static constexpr size_t kSize = 512;
  static constexpr size_t kRoom = 64;  // for what is written behind it before it is drawn

  HWY_ALIGN uint32_t at[kSize + kRoom];  // in the tile
  HWY_ALIGN uint32_t words[kSize + kRoom];
};

HWY_ATTR HWY_INLINE void RaiseBlock(const DrawBlock& block, size_t size, uint32_t* words) {
  const hn::CappedTag<uint32_t, 1> d;  // without a branch that nobody could foresee
  const auto raise = [&](size_t i) HWY_ATTR {
    uint32_t* const at = words + block.at[i];
    hn::StoreU(hn::Max(hn::LoadU(d, at), hn::LoadU(d, block.words + i)), d, at);
  };
  size_t i = 0;
  for (; i + 4 <= size; i += 4) {
    raise(i);
    raise(i + 1);
    raise(i + 2);
    raise(i + 3);
  }
  for (; i < size; ++i) raise(i);
}

// The same of what is left at the end; `all`: not the only one. Says which rows all of them reached: exactly, if that is
// quickly said.
HWY_ATTR HWY_INLINE void RaiseLast(const DrawBlock& block, size_t size, bool all, uint32_t* words,
                                   TileRows& touched) {
  RaiseBlock(block, size, words);
  if (all) {
    touched = TileRows::All();
  } else {
    for (size_t i = 0; i < size; ++i) touched.Add(block.at[i]);
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace voxeld::gpu
HWY_AFTER_NAMESPACE();

#endif
