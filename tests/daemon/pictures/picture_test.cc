#include "daemon/pictures/picture.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <malloc.h>

#include <cmath>
#include <string>
#include <vector>

#include "absl/strings/match.h"
#include "tests/daemon/pictures/files.h"

namespace voxeld::pictures {
namespace {

using ::testing::ElementsAre;
using ::testing::ElementsAreArray;
using ::testing::HasSubstr;

absl::StatusOr<std::vector<uint32_t>> Read(const std::string& bytes) {
  const absl::StatusOr<PictureFile> file = PictureFile::Open(bytes);
  if (!file.ok()) return file.status();
  return file->Read();
}

std::string MessageOf(const std::string& bytes) {
  const absl::Status status = Read(bytes).status();
  EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument);
  return std::string(status.message());
}

TEST(Picture, APngIsReadAsItIs) {
  const std::vector<uint32_t> pixels = {0xFF0000, 0x00FF00, 0x0000FF, 0x123456, 0, 0xFFFFFF};
  const std::string bytes = PngOf(3, 2, pixels);
  const absl::StatusOr<PictureFile> file = PictureFile::Open(bytes);
  ASSERT_TRUE(file.ok()) << file.status();
  EXPECT_EQ(file->size().width, 3u);
  EXPECT_EQ(file->size().height, 2u);
  EXPECT_THAT(*file->Read(), ElementsAreArray(pixels));
  EXPECT_THAT(*file->Read(), ElementsAreArray(pixels));  // can be read any number of times
}

TEST(Picture, WhatIsNotOpaqueLiesOverBlack) {
  const std::vector<uint32_t> pixels =
      *Read(PngOf(3, 1, {0xFFFF8040, 0x00FF8040, 0x80FFFFFF}, true));
  EXPECT_THAT(pixels, ElementsAre(0xFF8040, 0, ::testing::_));
  EXPECT_GT(pixels[2] & 0xFF, 0x40u);
  EXPECT_LT(pixels[2] & 0xFF, 0xFFu);
}

TEST(Picture, AJpegIsReadNearly) {
  std::vector<uint32_t> pixels(16 * 8, 0xC08020);
  for (size_t i = 0; i < pixels.size(); ++i) {
    if (i % 16 < 8) pixels[i] = 0x2040C0;
  }
  const std::string bytes = JpegOf(16, 8, pixels);
  const absl::StatusOr<PictureFile> file = PictureFile::Open(bytes);
  ASSERT_TRUE(file.ok()) << file.status();
  EXPECT_EQ(file->size().width, 16u);
  EXPECT_EQ(file->size().height, 8u);
  const std::vector<uint32_t> read = *file->Read();
  ASSERT_EQ(read.size(), pixels.size());
  for (size_t i = 0; i < read.size(); ++i) {
    for (const int shift : {16, 8, 0}) {
      const int got = static_cast<int>(read[i] >> shift & 0xFF);
      EXPECT_NEAR(got, static_cast<int>(pixels[i] >> shift & 0xFF), 3) << i;
    }
    EXPECT_EQ(read[i] >> 24, 0u);
  }
}

TEST(Picture, SixteenBitsAreOfSrgbToo) {
  const std::string bytes = WideGreyPngOf(3, 1, {0, 0x8080, 0xFFFF});
  EXPECT_FALSE(absl::StrContains(bytes, "gAMA"));
  EXPECT_THAT(*Read(bytes), ElementsAre(0, 0x808080, 0xFFFFFF));
}

TEST(Picture, OneRowOrColumnIsAPicture) {
  for (const int height : {1, 5}) {
    const int width = height == 1 ? 5 : 1;
    const std::string bytes = JpegOf(width, height, std::vector<uint32_t>(5, 0x808080));
    EXPECT_THAT(*Read(bytes), ElementsAreArray(std::vector<uint32_t>(5, 0x808080)));
  }
}

// Neither for reading a file's head alone, nor for reading all of it, successfully or not.
TEST(Picture, NothingOfALibraryIsLeft) {
  const std::vector<uint32_t> pixels(64 * 64, 0x80FF20);
  const std::string png = PngOf(64, 64, pixels), jpeg = JpegOf(64, 64, pixels);
  const auto held = [] {
    const struct mallinfo2 info = mallinfo2();
    return info.uordblks + info.hblkhd;
  };
  const auto read_all = [&] {
    for (const std::string& whole : {png, jpeg}) {
      for (const size_t size : {whole.size(), whole.size() - 20, size_t{9}}) {
        (void)Read(whole.substr(0, size)).ok();
        (void)PictureFile::Open(whole.substr(0, size)).ok();
      }
    }
  };
  for (int i = 0; i < 3; ++i) read_all();
  const size_t before = held();
  for (int i = 0; i < 10; ++i) read_all();
  EXPECT_EQ(held(), before);
}

TEST(Picture, WhatIsNoneIsRefused) {
  EXPECT_THAT(MessageOf(""), HasSubstr("is neither a PNG nor a JPEG file"));
  EXPECT_THAT(MessageOf("GIF89a"), HasSubstr("is neither"));
  EXPECT_THAT(MessageOf("\x89PNG\r\n\x1a\n"), HasSubstr("begins as a PNG file does"));
  EXPECT_THAT(MessageOf("\xFF\xD8\xFF"), HasSubstr("begins as a JPEG file does"));
  EXPECT_FALSE(PictureFile::Open("\x89PNG\r\n\x1a\n").ok());
  EXPECT_FALSE(PictureFile::Open("\xFF\xD8\xFF").ok());
}

// Wherever the file is truncated, and whichever byte is changed: the result is an error or a
// picture of that size.
TEST(Picture, BrokenFilesAreRefused) {
  std::vector<uint32_t> pixels(64);
  for (size_t i = 0; i < pixels.size(); ++i)
    pixels[i] = static_cast<uint32_t>(i * i * 0x9E37) & 0xFFFFFF;
  for (const std::string& whole : {PngOf(8, 8, pixels), JpegOf(8, 8, pixels)}) {
    ASSERT_TRUE(Read(whole).ok());
    for (size_t size = 0; size + 16 < whole.size(); ++size) {
      EXPECT_FALSE(Read(whole.substr(0, size)).ok()) << size;
    }
    for (size_t at = 0; at < whole.size(); ++at) {
      for (const char flip : {'\x01', '\x80', '\xFF'}) {
        std::string broken = whole;
        broken[at] = static_cast<char>(broken[at] ^ flip);
        const absl::StatusOr<PictureFile> file = PictureFile::Open(broken);
        if (!file.ok() || uint64_t{file->size().width} * file->size().height > 1 << 20) continue;
        const auto read = file->Read();
        if (!read.ok()) continue;
        EXPECT_EQ(read->size(), size_t{file->size().width} * file->size().height);
      }
    }
  }
}

}  // namespace
}  // namespace voxeld::pictures
