#include "gpu/assemble/blend.h"

#include <gtest/gtest.h>

namespace voxeld::gpu {
namespace {

uint32_t Blend(uint32_t below, uint32_t color, BlendMode mode, uint32_t opacity) {
  return Deinterleave(BlendLayer(Interleave(below), MakeWord(3, false, color), mode, opacity));
}

// (200·128 + 127)/255 = 100, (100·128 + 127)/255 = 50, (1·128 + 127)/255 = 1.
TEST(Blend, OverScalesByOpacity) {
  EXPECT_EQ(Blend(0x123456, 0xC86401, BlendMode::kOver, 128), 0x643201u);
  EXPECT_EQ(Blend(0x123456, 0xC86401, BlendMode::kOver, 255), 0xC86401u);
  EXPECT_EQ(Blend(0x123456, 0xC86401, BlendMode::kOver, 0), 0x000000u);
  EXPECT_EQ(Blend(0x123456, 0x000000, BlendMode::kOver, 255), 0x000000u);  // black covers
}

// 0x12 + 0x64 = 0x76, 0x34 + 0x32 = 0x66; 0xF0 + 0x64 saturates.
TEST(Blend, AddSaturates) {
  EXPECT_EQ(Blend(0x1234FE, 0xC86401, BlendMode::kAdd, 128), 0x7666FFu);
  EXPECT_EQ(Blend(0xF0F0FF, 0xC80001, BlendMode::kAdd, 128), 0xFFF0FFu);
}

// (255·127 + 127)/255 = 127, (100·127 + 127)/255 = 50, (1·127 + 127)/255 = 0.
TEST(Blend, EraseScalesWhatIsBelow) {
  EXPECT_EQ(Blend(0xFF6401, 0xFFFFFF, BlendMode::kErase, 128), 0x7F3200u);
  EXPECT_EQ(Blend(0xFF6401, 0xFFFFFF, BlendMode::kErase, 255), 0x000000u);
  EXPECT_EQ(Blend(0xFF6401, 0xFFFFFF, BlendMode::kErase, 0), 0xFF6401u);
}

TEST(Blend, WhatIsNotCoveredStays) {
  for (BlendMode mode : {BlendMode::kOver, BlendMode::kAdd, BlendMode::kErase}) {
    EXPECT_EQ(BlendLayer(Interleave(0x123456), 0, mode, 255), Interleave(0x123456));
    EXPECT_EQ(BlendLayer(Interleave(0x123456), MakeWord(9, true, 0), mode, 255),
              Interleave(0x123456));
  }
}

}  // namespace
}  // namespace voxeld::gpu
