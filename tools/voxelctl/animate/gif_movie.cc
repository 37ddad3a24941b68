// The only file that uses giflib.
#include <gif_lib.h>
#include <zlib.h>

#include <cmath>
#include <cstring>
#include <string>
#include <utility>
#include <vector>

#include "absl/cleanup/cleanup.h"
#include "absl/strings/str_cat.h"
#include "common/text/printable.h"
#include "tools/voxelctl/animate/dither.h"
#include "tools/voxelctl/animate/moving_picture.h"
#include "tools/voxelctl/files/whole_file.h"
#include "tools/voxelctl/render/palette.h"

namespace voxeld::voxelctl {
namespace {

constexpr int kGifColors = 255;      // one of 256 marks pixels that do not change
constexpr int kGifMostSide = 65535;  // the format's limit

struct Rows {
  int top = 0, bottom = 0, left = 0, right = 0;  // the ends are exclusive
};

// Returns the smallest rectangle that contains all differences; one pixel if there are none.
Rows Changed(const std::vector<uint8_t>& before, const std::vector<uint8_t>& now, int width,
             int height) {
  Rows rows{height, 0, width, 0};
  for (int y = 0; y < height; ++y) {
    const size_t row = static_cast<size_t>(y) * static_cast<size_t>(width);
    if (std::memcmp(&before[row], &now[row], static_cast<size_t>(width)) == 0) continue;
    rows.top = std::min(rows.top, y);
    rows.bottom = y + 1;
    int left = 0, right = width;
    while (before[row + static_cast<size_t>(left)] == now[row + static_cast<size_t>(left)]) ++left;
    while (before[row + static_cast<size_t>(right) - 1] ==
           now[row + static_cast<size_t>(right) - 1])
      --right;
    rows.left = std::min(rows.left, left);
    rows.right = std::max(rows.right, right);
  }
  return rows.bottom == 0 ? Rows{0, 1, 0, 1} : rows;
}

class Gif : public MovingPicture {
 public:
  Gif(std::string path, double fps, std::unique_ptr<WholeFile> file)
      : path_(std::move(path)), fps_(fps), file_(std::move(file)) {}

  absl::Status Add(const Image& image) override {
    if (image.width > kGifMostSide || image.height > kGifMostSide) {
      return Error(absl::StrCat("the picture is ", image.width, "x", image.height,
                                "; a GIF is at most ", kGifMostSide, "x", kGifMostSide));
    }
    width_ = image.width;
    height_ = image.height;
    colors_.Add(image);
    uLongf size = ::compressBound(static_cast<uLong>(image.rgb.size()));
    std::string packed(size, '\0');
    if (::compress2(reinterpret_cast<Bytef*>(packed.data()), &size, image.rgb.data(),
                    static_cast<uLong>(image.rgb.size()), 1) != Z_OK) {
      return Error("a picture could not be kept");
    }
    packed.resize(size);
    packed.shrink_to_fit();
    packed_.push_back(std::move(packed));
    return absl::OkStatus();
  }

  absl::Status Finish() override {
    if (packed_.empty()) return Error("it has no picture");
    std::vector<Color8> palette = colors_.Cut(kGifColors);
    ColorMapObject* map = ::GifMakeMapObject(256, nullptr);
    if (map == nullptr) return Error("there is no memory for its palette");
    const absl::Cleanup free_map = [map] { ::GifFreeMapObject(map); };
    for (size_t i = 0; i < palette.size(); ++i) {
      map->Colors[i] = {palette[i][0], palette[i][1], palette[i][2]};
    }
    int error = 0;
    GifFileType* gif = ::EGifOpen(this, &Gif::Output, &error);
    if (gif == nullptr) return GifError(error);
    absl::Status status = WriteAll(gif, map, std::move(palette));
    if (::EGifCloseFile(gif, &error) != GIF_OK && status.ok()) status = GifError(error);
    if (!written_.ok()) return written_;
    return status.ok() ? file_->Commit() : status;
  }

 private:
  static int Output(GifFileType* gif, const GifByteType* bytes, int size) {
    auto* self = static_cast<Gif*>(gif->UserData);
    if (self->written_.ok()) {
      self->written_ =
          self->file_->Write({reinterpret_cast<const char*>(bytes), static_cast<size_t>(size)});
    }
    return self->written_.ok() ? size : 0;
  }

  absl::Status Error(absl::string_view what) const {
    return absl::InternalError(absl::StrCat(EscapeForTerminal(path_), ": ", what));
  }
  absl::Status GifError(int code) const {
    const char* text = ::GifErrorString(code);
    return Error(absl::StrCat("the GIF could not be written: ",
                              text == nullptr ? "no reason is told" : text));
  }

  absl::Status WriteAll(GifFileType* gif, ColorMapObject* map, std::vector<Color8> palette) {
    ::EGifSetGifVersion(gif, true);
    if (::EGifPutScreenDesc(gif, width_, height_, 8, 0, map) != GIF_OK) return GifError(gif->Error);
    // Repeats for ever: an extension of Netscape's that every program supports.
    const GifByteType loop[3] = {1, 0, 0};
    if (::EGifPutExtensionLeader(gif, APPLICATION_EXT_FUNC_CODE) != GIF_OK ||
        ::EGifPutExtensionBlock(gif, 11, "NETSCAPE2.0") != GIF_OK ||
        ::EGifPutExtensionBlock(gif, sizeof(loop), loop) != GIF_OK ||
        ::EGifPutExtensionTrailer(gif) != GIF_OK) {
      return GifError(gif->Error);
    }
    OrderedDither dither(std::move(palette));
    std::vector<uint8_t> before;
    Image image{width_, height_, {}};
    image.rgb.resize(static_cast<size_t>(width_) * static_cast<size_t>(height_) * 3);
    for (size_t i = 0; i < packed_.size(); ++i) {
      uLongf size = static_cast<uLongf>(image.rgb.size());
      if (::uncompress(image.rgb.data(), &size, reinterpret_cast<const Bytef*>(packed_[i].data()),
                       static_cast<uLong>(packed_[i].size())) != Z_OK ||
          size != image.rgb.size()) {
        return Error("the pictures are not of one size");
      }
      std::vector<uint8_t> now = dither.Apply(image);
      if (absl::Status status = WriteOne(gif, i, before, now); !status.ok()) return status;
      before = std::move(now);
    }
    return absl::OkStatus();
  }

  // Returns when picture `i` begins, in hundredths of a second; rounding moves no picture by more
  // than half of one.
  int Time(size_t i) const {
    return static_cast<int>(std::lround(static_cast<double>(i) * 100 / fps_));
  }

  absl::Status WriteOne(GifFileType* gif, size_t i, const std::vector<uint8_t>& before,
                        std::vector<uint8_t> now) {
    const Rows rows =
        before.empty() ? Rows{0, height_, 0, width_} : Changed(before, now, width_, height_);
    const GraphicsControlBlock control = {DISPOSE_DO_NOT, false, Time(i + 1) - Time(i),
                                          before.empty() ? NO_TRANSPARENT_COLOR : kGifColors};
    GifByteType block[4];
    const size_t size = ::EGifGCBToExtension(&control, block);
    if (::EGifPutExtension(gif, GRAPHICS_EXT_FUNC_CODE, static_cast<int>(size), block) != GIF_OK ||
        ::EGifPutImageDesc(gif, rows.left, rows.top, rows.right - rows.left, rows.bottom - rows.top,
                           false, nullptr) != GIF_OK) {
      return GifError(gif->Error);
    }
    for (int y = rows.top; y < rows.bottom; ++y) {
      const size_t row = static_cast<size_t>(y) * static_cast<size_t>(width_);
      for (int x = rows.left; !before.empty() && x < rows.right; ++x) {
        uint8_t& index = now[row + static_cast<size_t>(x)];
        if (index == before[row + static_cast<size_t>(x)]) index = kGifColors;
      }
      if (::EGifPutLine(gif, now.data() + row + rows.left, rows.right - rows.left) != GIF_OK)
        return GifError(gif->Error);
    }
    return absl::OkStatus();
  }

  const std::string path_;
  const double fps_;
  const std::unique_ptr<WholeFile> file_;
  absl::Status written_;  // the status of giflib's output
  int width_ = 0, height_ = 0;
  ColorCount colors_;
  std::vector<std::string> packed_;
};

}  // namespace

absl::StatusOr<std::unique_ptr<MovingPicture>> GifMovie(const std::string& path, double fps) {
  absl::StatusOr<std::unique_ptr<WholeFile>> file = WholeFile::Create(path);
  if (!file.ok()) return file.status();
  return std::make_unique<Gif>(path, fps, *std::move(file));
}

}  // namespace voxeld::voxelctl
