// Tests animated pictures by reading them back with common libraries and programs.
#include <fcntl.h>
#include <gif_lib.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <string>
#include <vector>

#include "tests/tools/voxelctl/status_matchers.h"
#include "tests/tools/voxelctl/temp_folder.h"
#include "tools/child/child_process.h"
#include "tools/voxelctl/animate/dither.h"
#include "tools/voxelctl/animate/moving_picture.h"
#include "tools/voxelctl/files/whole_file.h"

namespace voxeld::voxelctl {
namespace {

// A dark background, a ramp of the most saturated colours across it, and a white square that moves.
Image Frame(int number) {
  Image image{96, 64, {}};
  image.rgb.resize(96 * 64 * 3);
  for (int y = 0; y < 64; ++y) {
    for (int x = 0; x < 96; ++x) {
      uint8_t* p = &image.rgb[static_cast<size_t>(y * 96 + x) * 3];
      if (y < 16) {
        p[0] = static_cast<uint8_t>(x * 255 / 95);
        p[1] = static_cast<uint8_t>(255 - p[0]);
        p[2] = static_cast<uint8_t>(y * 16);
      }
      const bool square = y >= 32 && y < 48 && x >= number * 4 && x < number * 4 + 16;
      if (square) p[0] = p[1] = p[2] = 255;
    }
  }
  return image;
}

size_t FilesIn(const TempFolder& folder) {
  size_t count = 0;
  for ([[maybe_unused]] const auto& entry :
       std::filesystem::directory_iterator(std::filesystem::path(folder.Path("x")).parent_path())) {
    ++count;
  }
  return count;
}

TEST(NumberedName, IsOfTheFileNotOfItsFolder) {
  EXPECT_EQ(NumberedName("a####.png", 7), "a0007.png");
  EXPECT_EQ(NumberedName("#.png", 123), "123.png");
  EXPECT_EQ(NumberedName("x#y/##b.png", 3), "x#y/03b.png");
  EXPECT_EQ(NumberedName("x#/plain.png", 3), "x#/plain.png");
}

TEST(WholeFile, IsThereWholeOrNotAtAll) {
  TempFolder folder;
  const std::string path = folder.Write("a", "old");
  {
    auto file = WholeFile::Create(path);
    ASSERT_THAT(file, IsOk());
    ASSERT_THAT((*file)->Write("new"), IsOk());
    EXPECT_EQ(ReadAll(path), "old");
    EXPECT_EQ(FilesIn(folder), 2u);
  }
  EXPECT_EQ(ReadAll(path), "old");
  EXPECT_EQ(FilesIn(folder), 1u);
  ASSERT_THAT(WriteWholeFile(path, "new"), IsOk());
  EXPECT_EQ(ReadAll(path), "new");
  EXPECT_EQ(FilesIn(folder), 1u);
  EXPECT_THAT(WriteWholeFile(folder.Path("none\x1b/a"), ""),
              Fails(Words{"none\\u{1b}/a", "cannot be written", "No such file"}));
}

TEST(WholeFile, ReplacesRegularFilesAlone) {
  TempFolder folder;
  const std::string fifo = folder.Path("fifo"), link = folder.Path("link"),
                    file = folder.Write("file", "old");
  ASSERT_EQ(::mkfifo(fifo.c_str(), 0600), 0);
  const int reader = ::open(fifo.c_str(), O_RDONLY | O_NONBLOCK);
  ASSERT_THAT(WriteWholeFile(fifo, "new"), IsOk());
  char bytes[4] = {};
  EXPECT_EQ(::read(reader, bytes, sizeof(bytes)), 3);
  ::close(reader);
  EXPECT_TRUE(std::filesystem::is_fifo(fifo));
  ASSERT_EQ(::symlink("/dev/full", link.c_str()), 0);
  EXPECT_THAT(std::string(WriteWholeFile(link, "new").message()),
              testing::HasSubstr("could not be written"));
  EXPECT_TRUE(std::filesystem::is_symlink(link));
  EXPECT_TRUE(std::filesystem::is_character_file("/dev/full"));
  ASSERT_EQ(::unlink(link.c_str()), 0);
  ASSERT_EQ(::symlink("file", link.c_str()), 0);
  ASSERT_THAT(WriteWholeFile(link, "new"), IsOk());
  EXPECT_TRUE(std::filesystem::is_symlink(link));
  EXPECT_EQ(ReadAll(file), "new");
}

TEST(OrderedDither, KeepsThePalettesColoursAndTheMeanOfOthers) {
  const std::vector<Color8> palette = {{0, 0, 0}, {200, 100, 40}, {255, 255, 255}};
  OrderedDither dither(palette);
  for (size_t i = 0; i < palette.size(); ++i) {
    Image image{8, 8, {}};
    for (int n = 0; n < 64; ++n)
      image.rgb.insert(image.rgb.end(), palette[i].begin(), palette[i].end());
    EXPECT_THAT(dither.Apply(image), testing::Each(i)) << i;
  }
  for (const int share : {1, 8, 16, 31, 48, 63}) {
    Image image{8, 8, {}};
    for (int n = 0; n < 64; ++n) {
      for (const int c : palette[1])
        image.rgb.push_back(static_cast<uint8_t>((c * share + 32) / 64));
    }
    const std::vector<uint8_t> places = dither.Apply(image);
    EXPECT_NEAR(static_cast<double>(std::count(places.begin(), places.end(), 1)), share, 1.0);
    EXPECT_EQ(std::count(places.begin(), places.end(), 2), 0);
  }
}

// The pictures of a GIF, composed as a reader shows them.
struct Shown {
  std::vector<Image> images;
  std::vector<int> delays;
  bool loops = false;
};

Shown ReadGif(const std::string& path) {
  Shown shown;
  int error = 0;
  GifFileType* gif = DGifOpenFileName(path.c_str(), &error);
  if (gif == nullptr || DGifSlurp(gif) != GIF_OK) {
    ADD_FAILURE() << path << " is not a GIF: " << error;
    return shown;
  }
  Image canvas{gif->SWidth, gif->SHeight, {}};
  canvas.rgb.resize(static_cast<size_t>(gif->SWidth) * static_cast<size_t>(gif->SHeight) * 3, 99);
  for (int i = 0; i < gif->ImageCount; ++i) {
    const SavedImage& saved = gif->SavedImages[i];
    for (int e = 0; e < saved.ExtensionBlockCount; ++e) {
      const ExtensionBlock& block = saved.ExtensionBlocks[e];
      if (block.Function == APPLICATION_EXT_FUNC_CODE)
        shown.loops = std::string(reinterpret_cast<char*>(block.Bytes), 11) == "NETSCAPE2.0";
    }
    GraphicsControlBlock control;
    EXPECT_EQ(DGifSavedExtensionToGCB(gif, i, &control), GIF_OK);
    shown.delays.push_back(control.DelayTime);
    const GifImageDesc& d = saved.ImageDesc;
    for (int y = 0; y < d.Height; ++y) {
      for (int x = 0; x < d.Width; ++x) {
        const int index = saved.RasterBits[y * d.Width + x];
        if (index == control.TransparentColor) continue;
        const GifColorType& color = gif->SColorMap->Colors[index];
        uint8_t* p = &canvas.rgb[static_cast<size_t>((d.Top + y) * canvas.width + d.Left + x) * 3];
        p[0] = color.Red, p[1] = color.Green, p[2] = color.Blue;
      }
    }
    shown.images.push_back(canvas);
  }
  DGifCloseFile(gif, &error);
  return shown;
}

TEST(GifMovie, IsReadAsItWasDrawn) {
  TempFolder folder;
  const std::string path = folder.Path("a.gif");
  auto movie = GifMovie(path, 24);
  ASSERT_THAT(movie, IsOk());
  for (int i = 0; i < 12; ++i) ASSERT_THAT((*movie)->Add(Frame(i)), IsOk());
  EXPECT_FALSE(std::filesystem::exists(path));
  ASSERT_THAT((*movie)->Finish(), IsOk());
  const Shown shown = ReadGif(path);
  ASSERT_EQ(shown.images.size(), 12u);
  EXPECT_TRUE(shown.loops);
  EXPECT_THAT(shown.delays, testing::Each(testing::AnyOf(4, 5)));
  int sum = 0;
  for (const int delay : shown.delays) sum += delay;
  EXPECT_EQ(sum, 50) << "half a second, though no picture lasts 1/24 s";
  for (int i = 0; i < 12; ++i) {
    const Image wanted = Frame(i);
    const Image& got = shown.images[static_cast<size_t>(i)];
    double off = 0;
    int most = 0;
    for (size_t at = 0; at < wanted.rgb.size(); ++at) {
      const int d = std::abs(wanted.rgb[at] - got.rgb[at]);
      off += d;
      if (at >= 16 * 96 * 3) most = std::max(most, d);
    }
    EXPECT_EQ(most, 0) << "flat ground and the square are of the palette, in picture " << i;
    EXPECT_LT(off / static_cast<double>(wanted.rgb.size()), 2.0) << i;
  }
}

TEST(GifMovie, OneThatIsNotFinishedLeavesNothing) {
  TempFolder folder;
  {
    auto movie = GifMovie(folder.Path("a.gif"), 10);
    ASSERT_THAT(movie, IsOk());
    ASSERT_THAT((*movie)->Add(Frame(0)), IsOk());
  }
  EXPECT_EQ(FilesIn(folder), 0u);
  EXPECT_THAT(GifMovie(folder.Path("none/a.gif"), 10),
              Fails(Words{"none/a.gif", "cannot be written"}));
}

class Mp4Test : public testing::Test {
 protected:
  ~Mp4Test() override { ::setenv("PATH", path_.c_str(), 1); }
  const std::string path_ = std::getenv("PATH");
  TempFolder folder_;
};

TEST_F(Mp4Test, SaysHowToGetFfmpegWhereItIsNot) {
  ::setenv("PATH", folder_.Path("").c_str(), 1);
  EXPECT_THAT(Mp4Movie(folder_.Path("a.mp4"), 24, 96, 64),
              Fails(Words{"a.mp4", "ffmpeg", "apt install ffmpeg", ".gif"}));
  EXPECT_EQ(FilesIn(folder_), 0u);
}

TEST_F(Mp4Test, SaysWhatFfmpegSaysWhenItFails) {
  std::filesystem::permissions(
      folder_.Write("ffmpeg", "#!/bin/sh\necho one\necho 'no such\033 encoder' >&2\nexit 1\n"),
      std::filesystem::perms::owner_all);
  ::setenv("PATH", (folder_.Path("") + ":/bin").c_str(), 1);
  auto movie = Mp4Movie(folder_.Path("a.mp4"), 24, 96, 64);
  ASSERT_THAT(movie, IsOk());
  absl::Status status;
  for (int i = 0; i < 1000 && status.ok(); ++i) status = (*movie)->Add(Frame(i % 20));
  if (status.ok()) status = (*movie)->Finish();
  EXPECT_THAT(status, Fails(Words{"a.mp4", "no such\\u{1b} encoder"}));
  movie->reset();
  EXPECT_EQ(FilesIn(folder_), 1u);
}

TEST_F(Mp4Test, IsReadAsItWasDrawn) {
  ASSERT_EQ(std::system("ffmpeg -version >/dev/null 2>&1"), 0) << "run tools/setup --dev";
  const std::string path = folder_.Path("a: b.mp4");
  auto movie = Mp4Movie(path, 24, 96, 64);
  ASSERT_THAT(movie, IsOk());
  for (int i = 0; i < 12; ++i) ASSERT_THAT((*movie)->Add(Frame(i)), IsOk());
  EXPECT_FALSE(std::filesystem::exists(path));
  ASSERT_THAT((*movie)->Finish(), IsOk());
  EXPECT_EQ(FilesIn(folder_), 1u);
  const std::string raw = folder_.Path("raw");
  ASSERT_EQ(std::system(
                ("ffmpeg -v error -i 'file:" + path + "' -f rawvideo -pix_fmt rgb24 '" + raw + "'")
                    .c_str()),
            0);
  const std::string bytes = ReadAll(raw);
  ASSERT_EQ(bytes.size(), 12u * 96 * 64 * 3);
  for (int i = 0; i < 12; ++i) {
    const auto at = [&](int x, int y) {
      return static_cast<uint8_t>(bytes[(static_cast<size_t>(i) * 96 * 64 +
                                         static_cast<size_t>(y) * 96 + static_cast<size_t>(x)) *
                                            3 +
                                        1]);
    };
    EXPECT_GT(at(i * 4 + 8, 40), 220) << "the square is where it was, in picture " << i;
    EXPECT_LT(at(i * 4 + 26, 40), 30) << i;
  }
}

}  // namespace
}  // namespace voxeld::voxelctl
