// Tests grids of samples with one error each: they are refused with a message that names it.
#include "gpu/samples_check.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>
#include <string>
#include <vector>

namespace voxeld::gpu {
namespace {

using ::testing::HasSubstr;

// Places in the head, according to the layout in gpu/primitives/samples.h.
enum Place : size_t { kSize = 0, kFormat = 3, kFilter, kByLevel, kLow, kScale, kLevel, kBricks };
constexpr size_t kHead = 12, kTable = 256;

// A grid of 9 x 8 x 1: 2 x 1 x 1 bricks of 8 along an edge, a bit each, in one word.
std::vector<uint32_t> Grid(uint32_t format) {
  const size_t per_word = format == 0 ? 4 : format == 1 ? 2 : 1;
  std::vector<uint32_t> words(kHead + kTable + 1 + (9 * 8 + per_word - 1) / per_word);
  words[kSize] = 9, words[kSize + 1] = 8, words[kSize + 2] = 1;
  words[kFormat] = format;
  words[kBricks] = 1;
  return words;
}

std::string Why(const std::vector<uint32_t>& words) {
  return std::string(CheckSamples(words).message());
}

TEST(SamplesCheck, EveryFormatIsOfItsOwnSize) {
  for (uint32_t format = 0; format < 4; ++format) {
    std::vector<uint32_t> words = Grid(format);
    EXPECT_EQ(Why(words), "") << format;
    words.push_back(0);
    EXPECT_THAT(Why(words), HasSubstr("words is")) << format;
    for (size_t cut = 0; cut < words.size() - 1; ++cut) {
      EXPECT_FALSE(CheckSamples({words.data(), cut}).ok()) << format << " " << cut;
    }
  }
}

TEST(SamplesCheck, EachFaultIsNamed) {
  struct Case {
    size_t place;
    uint32_t value;
    const char* words;
  };
  const Case cases[] = {{kSize, 0, "size is 0, must be 1 to 65536"},
                        {kSize + 1, 65537, "size is 65537, must be 1 to 65536"},
                        {kSize + 2, 0xFFFFFFFF, "size is 4294967295"},
                        {kSize, 8, "words is"},
                        {kFormat, 4, "format is 4, must be 0 to 3"},
                        {kFilter, 2, "filter is 2, must be 0 or 1"},
                        {kByLevel, 3, "by_level is 3, must be 0 to 2"},
                        {kBricks, 0, "bricks is 0, must be 1"},
                        {kBricks, 2, "bricks is 2, must be 1"}};
  for (const Case& one : cases) {
    std::vector<uint32_t> words = Grid(2);
    words[one.place] = one.value;
    EXPECT_THAT(Why(words), HasSubstr(one.words));
  }
  for (const size_t place : {kLow, kScale, kLevel}) {
    for (const float wrong : {std::numeric_limits<float>::infinity(), std::nanf("")}) {
      std::vector<uint32_t> words = Grid(2);
      words[place] = std::bit_cast<uint32_t>(wrong);
      EXPECT_THAT(Why(words), HasSubstr("finite, as scale and level")) << place;
    }
  }
}

TEST(SamplesCheck, ColoursHaveNoLevel) {
  for (const uint32_t by_level : {0u, 1u, 2u}) {
    for (const uint32_t filter : {0u, 1u}) {
      std::vector<uint32_t> words = Grid(2);
      words[kByLevel] = by_level;
      words[kFilter] = filter;
      EXPECT_EQ(Why(words), "");
      words = Grid(3);
      words[kByLevel] = by_level;
      EXPECT_EQ(Why(words), by_level == 0 ? ""
                                          : "samples.by_level is " + std::to_string(by_level) +
                                                ", must be 0 for colours");
    }
  }
}

TEST(SamplesCheck, AllTogetherAreLimited) {
  std::vector<uint32_t> words = Grid(2);
  words[kSize] = words[kSize + 1] = 65536;
  words[kSize + 2] = 257;
  EXPECT_THAT(Why(words), HasSubstr("2⁴⁰ at most"));
  words[kSize + 2] = 256;
  EXPECT_THAT(Why(words), HasSubstr("bricks is 1")) << "the greatest number allowed";
}

}  // namespace
}  // namespace voxeld::gpu
