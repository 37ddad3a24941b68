#include "tools/import/rsvg_drawing.h"

#include <cairo.h>
#include <fcntl.h>
#include <fontconfig/fontconfig.h>
#include <librsvg/rsvg.h>
#include <pthread.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "common/text/printable.h"
#include "tools/import/inflate.h"
#include "tools/import/svg_contents.h"
#include "tools/import/volume_samples.h"

namespace voxeld::voxelctl {
namespace {

constexpr size_t kMostBytes = 64 << 20;
constexpr double kDotsPerInch = 96;     // as in CSS
constexpr double kLargest = 1e15;       // coordinates beyond it lose too much precision
constexpr int kMostFontsTried = 16;     // to find a readable one
constexpr uint32_t kInk = 64;           // a brightest channel below this is dark
constexpr uint32_t kPaper = 240;        // a darkest channel from this on is white
constexpr uint32_t kLeastInk = 64;      // of 255: minimum opacity of ink on a sheet
constexpr uint32_t kFinePixels = 1024;  // approximate longer side of what librsvg draws
constexpr uint32_t kMostFine = 8;       // of them along each result pixel
constexpr double kMostLift = 8;         // maximum brightening of thin strokes
constexpr uint64_t kFew = 100;          // one in this many is too few to mention

// librsvg has no switch for these; a user style sheet with !important overrides all others.
constexpr absl::string_view kWithoutFilters = "* { filter: none !important; }";
constexpr absl::string_view kWithoutTexts = "text { display: none !important; }";

template <typename T, void (*kFree)(T*)>
struct Freed {
  void operator()(T* one) const { kFree(one); }
};
using Surface = std::unique_ptr<cairo_surface_t, Freed<cairo_surface_t, cairo_surface_destroy>>;
using Cairo = std::unique_ptr<cairo_t, Freed<cairo_t, cairo_destroy>>;
using Error = std::unique_ptr<GError, Freed<GError, g_error_free>>;
struct Unref {
  void operator()(RsvgHandle* handle) const { g_object_unref(handle); }
};
using Handle = std::unique_ptr<RsvgHandle, Unref>;

// The part of the drawing that is shown, in its own units.
struct Page {
  double x = 0, y = 0, width = 0, height = 0;
  bool has_size = true;  // otherwise it is a part of an unbounded drawing
};

// Premultiplied, row by row from the top.
struct Pixel {
  uint8_t r = 0, g = 0, b = 0, alpha = 0;
};
struct Picture {
  uint32_t width = 0, height = 0;
  std::vector<Pixel> pixels;
};

// Pango finds and loads fonts on threads of its own, and terminates the process if it cannot start
// one.
bool CanStartThreads() {
  pthread_t thread;
  if (::pthread_create(
          &thread, nullptr, [](void*) -> void* { return nullptr; }, nullptr) != 0)
    return false;
  ::pthread_join(thread, nullptr);
  return true;
}

bool HasReadableFont() {
  if (FcInit() == FcFalse) return false;
  const FcFontSet* fonts = FcConfigGetFonts(nullptr, FcSetSystem);
  for (int i = 0; fonts != nullptr && i < std::min(fonts->nfont, kMostFontsTried); ++i) {
    FcChar8* path = nullptr;
    if (FcPatternGetString(fonts->fonts[i], FC_FILE, 0, &path) != FcResultMatch) continue;
    const int file = ::open(reinterpret_cast<const char*>(path), O_RDONLY | O_CLOEXEC);
    if (file < 0) continue;
    ::close(file);
    return true;
  }
  return false;
}

// Returns: the place after "<svg" in well-formed XML, where attributes may be inserted; npos if it
// is not found.
size_t EndOfRootName(absl::string_view xml) {
  const auto skip = [xml](size_t at, absl::string_view end) {
    const size_t found = xml.find(end, at);
    return found == absl::string_view::npos ? xml.size() : found + end.size();
  };
  int brackets = 0;  // of a document type
  bool in_type = false;
  for (size_t at = 0; at < xml.size();) {
    const absl::string_view rest = xml.substr(at);
    if (absl::StartsWith(rest, "<!--")) {
      at = skip(at + 4, "-->");
    } else if (absl::StartsWith(rest, "<?")) {
      at = skip(at + 2, "?>");
    } else if (absl::StartsWith(rest, "<!DOCTYPE")) {
      in_type = true;
      at += 9;
    } else if (in_type) {
      const char c = rest[0];
      if (c == '"' || c == '\'') at = skip(at + 1, rest.substr(0, 1)) - 1;
      brackets += c == '[' ? 1 : c == ']' ? -1 : 0;
      if (c == '>' && brackets == 0) in_type = false;
      ++at;
    } else if (rest[0] == '<') {
      return xml.find_first_of(" \t\r\n/>", at);
    } else {
      ++at;
    }
  }
  return absl::string_view::npos;
}

class Drawing {
 public:
  Drawing(const SourceFile& file, const std::array<uint32_t, 2>& pixels)
      : file_(file),
        across_(std::clamp(pixels[0], uint32_t{1}, kMostDrawingPixels)),
        up_(std::clamp(pixels[1], uint32_t{1}, kMostDrawingPixels)) {}

  absl::StatusOr<Model> Read() {
    std::string inflated;
    absl::string_view xml = file_.bytes;
    if (absl::StartsWith(xml, "\x1f\x8b")) {
      absl::StatusOr<std::string> text = Inflate(file_, xml, kMostBytes + 1);
      if (!text.ok()) return text.status();
      inflated = std::move(*text);
      xml = inflated;
    }
    if (xml.size() > kMostBytes) {
      return FileError(file_, absl::StrCat("has more than ", kMostBytes, " bytes of text"),
                       "smaller drawings are read");
    }
    absl::StatusOr<SvgContents> contents = ScanSvg(file_, xml);
    if (!contents.ok()) return contents.status();
    model_.path = file_.path;
    model_.format = "SVG";
    model_.up = Up::kY;
    model_.lit_already = true;
    for (const LeftOut& one : contents->left_out) AddLeftOut(one.kind, one.count, &model_);
    std::string style(kWithoutFilters);
    if (contents->texts > 0 &&
        !(contents->can_draw_texts && CanStartThreads() && HasReadableFont())) {
      absl::StrAppend(&style, kWithoutTexts);
      AddLeftOut("texts", contents->texts, &model_);
    }
    if (absl::Status status = Load(xml, style); !status.ok()) return status;
    absl::StatusOr<Page> page = FindPage();
    if (!page.ok()) return page.status();
    SetViewBox(xml, style, &*page);
    absl::StatusOr<Picture> picture = Render(*page);
    if (!picture.ok()) return picture.status();
    if (std::none_of(picture->pixels.begin(), picture->pixels.end(),
                     [](const Pixel& p) { return p.alpha > 0; }))
      return Empty();
    model_.note = ShowInLight(&*picture);
    absl::StatusOr<SampledVolume> volume = ToVolume(*page, Reduced(*picture, Fine()));
    if (!volume.ok()) return volume.status();
    model_.volumes.push_back(std::move(*volume));
    return std::move(model_);
  }

 private:
  absl::Status Empty() const {
    std::string found = "has nothing that is to be seen";
    if (!model_.left_out.empty())
      absl::StrAppend(&found, " (", NoteOf({.left_out = model_.left_out}).substr(2), ")");
    return FileError(file_, found, "at least one path, shape or text is expected");
  }

  absl::Status Refused(GError* error) const {
    const Error owned(error);
    const std::string reason =
        error == nullptr || error->message == nullptr ? "no reason" : error->message;
    return FileError(
        file_,
        absl::StrCat("cannot be drawn by librsvg (",
                     EscapeForTerminal(absl::StripAsciiWhitespace(reason).substr(0, 200)), ")"),
        "a valid SVG drawing is expected");
  }

  absl::Status Load(absl::string_view xml, absl::string_view style) {
    GError* error = nullptr;
    // Without a base URI, librsvg opens no other file.
    handle_.reset(
        rsvg_handle_new_from_data(reinterpret_cast<const guint8*>(xml.data()), xml.size(), &error));
    if (handle_ == nullptr) return Refused(error);
    rsvg_handle_set_dpi(handle_.get(), kDotsPerInch);
    if (rsvg_handle_set_stylesheet(handle_.get(), reinterpret_cast<const guint8*>(style.data()),
                                   style.size(), &error) == FALSE) {
      return Refused(error);
    }
    return absl::OkStatus();
  }

  absl::StatusOr<Page> FindPage() {
    Page page;
    gboolean has_width = FALSE, has_height = FALSE, has_view_box = FALSE;
    RsvgLength width = {}, height = {};
    RsvgRectangle box = {};
    rsvg_handle_get_intrinsic_dimensions(handle_.get(), &has_width, &width, &has_height, &height,
                                         &has_view_box, &box);
    if (rsvg_handle_get_intrinsic_size_in_pixels(handle_.get(), &page.width, &page.height) ==
        FALSE) {
      // The drawing takes the size of the page around it, which does not exist here. So its shape
      // is that of the view box, or otherwise of its ink.
      page.width = box.width;
      page.height = box.height;
      if (has_view_box == FALSE) {
        absl::StatusOr<Page> ink = FindInk();
        if (!ink.ok()) return ink.status();
        page = *ink;
      }
    }
    const bool is_finite = std::abs(page.x) <= kLargest && std::abs(page.y) <= kLargest &&
                           page.width <= kLargest && page.height <= kLargest;
    if (is_finite && page.width > 0 && page.height > 0) return page;
    return FileError(file_, absl::StrCat("is ", page.width, " wide and ", page.height, " high"),
                     absl::StrCat("both must be positive, and at most ", kLargest));
  }

  // Returns the part of an unbounded drawing that has ink.
  absl::StatusOr<Page> FindInk() const {
    GError* error = nullptr;
    const RsvgRectangle viewport = {0, 0, kDrawingPixels, kDrawingPixels};
    RsvgRectangle ink = {}, logical = {};
    if (rsvg_handle_get_geometry_for_layer(handle_.get(), nullptr, &viewport, &ink, &logical,
                                           &error) == FALSE)
      return Refused(error);
    // Ink without an area is still shown.
    const double least = std::max(ink.width, ink.height) / kMostDrawingPixels;
    if (least == 0) return Empty();
    return Page{ink.x, ink.y, std::max(ink.width, least), std::max(ink.height, least), false};
  }

  // Loads the drawing again with a view box around its ink: without one, librsvg clips
  // half-transparent parts outside its viewport. Does nothing if lengths are percentages of the
  // viewport, because the view box would change them.
  void SetViewBox(absl::string_view xml, absl::string_view style, Page* page) {
    const size_t at = EndOfRootName(xml);
    if (page->has_size || at == absl::string_view::npos || absl::StrContains(xml, '%')) return;
    Handle before = std::move(handle_);
    const std::string box = absl::StrFormat(" viewBox='%.17g %.17g %.17g %.17g'", page->x, page->y,
                                            page->width, page->height);
    if (Load(absl::StrCat(xml.substr(0, at), box, xml.substr(at)), style).ok()) {
      page->has_size = true;
    } else {
      handle_ = std::move(before);
    }
  }

  // Returns how many pixels of the rendered picture there are along one result pixel.
  uint32_t Fine() const {
    return std::clamp(kFinePixels / std::max(across_, up_), uint32_t{1}, kMostFine);
  }

  absl::StatusOr<Picture> Render(const Page& page) const {
    const uint32_t fine = Fine();
    double scale = std::min(across_ / page.width, up_ / page.height);
    const auto along = [&](double length) {
      return static_cast<uint32_t>(
          std::clamp(std::lround(length * scale), 1L, static_cast<long>(std::max(across_, up_))));
    };
    Picture picture;
    picture.width = along(page.width) * fine;
    picture.height = along(page.height) * fine;
    scale *= fine;
    const Surface surface(cairo_image_surface_create(
        CAIRO_FORMAT_ARGB32, static_cast<int>(picture.width), static_cast<int>(picture.height)));
    const Cairo cairo(cairo_create(surface.get()));
    RsvgRectangle viewport = {0, 0, page.width * scale, page.height * scale};
    if (!page.has_size) {
      cairo_scale(cairo.get(), scale, scale);
      cairo_translate(cairo.get(), -page.x, -page.y);
      viewport = {0, 0, kDrawingPixels, kDrawingPixels};
    }
    GError* error = nullptr;
    if (rsvg_handle_render_document(handle_.get(), cairo.get(), &viewport, &error) == FALSE)
      return Refused(error);
    cairo_surface_flush(surface.get());
    const cairo_status_t status = cairo_surface_status(surface.get());
    if (status != CAIRO_STATUS_SUCCESS) {
      return FileError(file_,
                       absl::StrCat("cannot be drawn (", cairo_status_to_string(status), ")"),
                       "a smaller drawing is expected");
    }
    const unsigned char* bytes = cairo_image_surface_get_data(surface.get());
    const auto stride = static_cast<size_t>(cairo_image_surface_get_stride(surface.get()));
    picture.pixels.reserve(size_t{picture.width} * picture.height);
    for (uint32_t y = 0; y < picture.height; ++y) {
      for (uint32_t x = 0; x < picture.width; ++x) {
        const unsigned char* p = bytes + y * stride + size_t{x} * 4;  // little-endian
        picture.pixels.push_back({p[2], p[1], p[0], p[3]});
      }
    }
    return picture;
  }

  // Channels were rounded after the multiplication by alpha.
  static bool IsDark(const Pixel& p) {
    const uint32_t brightest = std::max({p.r, p.g, p.b, uint8_t{1}}) - 1u;
    return p.alpha > 0 && brightest * 255 < kInk * p.alpha;
  }

  // Returns the least opaque paint that gives this colour on a white sheet.
  static Pixel InkOf(const Pixel& p) {
    const uint8_t white = std::min({p.r, p.g, p.b});
    const auto less = [white](uint8_t channel) { return static_cast<uint8_t>(channel - white); };
    return {less(p.r), less(p.g), less(p.b), static_cast<uint8_t>(255 - white)};
  }

  // Returns whether a mostly empty white sheet is behind everything that is drawn, with something
  // dark on it.
  static bool HasSheet(const Picture& picture) {
    uint32_t left = picture.width, right = 0, top = picture.height, bottom = 0;
    for (uint32_t y = 0; y < picture.height; ++y) {
      for (uint32_t x = 0; x < picture.width; ++x) {
        if (picture.pixels[size_t{y} * picture.width + x].alpha == 0) continue;
        left = std::min(left, x), right = std::max(right, x);
        top = std::min(top, y), bottom = std::max(bottom, y);
      }
    }
    uint64_t all = 0, white = 0;
    bool has_ink = false;
    // The outermost pixels may be partly covered.
    for (uint32_t y = top + 1; y < bottom; ++y) {
      for (uint32_t x = left + 1; x < right; ++x) {
        const Pixel& p = picture.pixels[size_t{y} * picture.width + x];
        if (p.alpha < 255) return false;
        const Pixel ink = InkOf(p);
        ++all;
        white += ink.alpha <= 255 - kPaper ? 1 : 0;
        has_ink |= ink.alpha >= kLeastInk && IsDark(ink);
      }
    }
    return has_ink && white > all / 2;
  }

  // A display cannot show black, so dark ink becomes light. Returns: a note for people about this;
  // usually empty.
  static std::string ShowInLight(Picture* picture) {
    uint64_t painted = 0, dark = 0;
    for (const Pixel& p : picture->pixels) {
      painted += p.alpha;
      dark += IsDark(p) ? p.alpha : 0;
    }
    const bool all_dark = (painted - dark) * kFew <= painted;
    if (all_dark || HasSheet(*picture)) {
      for (Pixel& p : picture->pixels) {
        // The edge of a sheet, which is partly covered, is white too.
        if (!all_dark) p = p.alpha < 255 ? Pixel() : InkOf(p);
        if (IsDark(p)) p = {p.alpha, p.alpha, p.alpha, p.alpha};
      }
      return all_dark ? "all of it is dark, so it is shown in white"
                      : "the white sheet behind all is left out, and what is dark on it is shown "
                        "in white";
    }
    if (dark * kFew < painted) return "";
    return absl::StrFormat("%.0f %% of what is painted is dark, which a display does not show",
                           100.0 * static_cast<double>(dark) / static_cast<double>(painted));
  }

  // Averages blocks of `fine` by `fine` pixels. Strokes so thin that no pixel beside them is fully
  // covered are made as bright as if they covered one result pixel.
  static Picture Reduced(const Picture& from, uint32_t fine) {
    Picture picture;
    picture.width = from.width / fine;
    picture.height = from.height / fine;
    std::vector<float> covered;  // covered share of each pixel
    covered.reserve(size_t{picture.width} * picture.height);
    for (uint32_t y = 0; y < picture.height; ++y) {
      for (uint32_t x = 0; x < picture.width; ++x) {
        uint32_t r = 0, g = 0, b = 0, alpha = 0, opacity = 0;
        for (uint32_t v = y * fine; v < (y + 1) * fine; ++v) {
          for (uint32_t u = x * fine; u < (x + 1) * fine; ++u) {
            const Pixel& p = from.pixels[size_t{v} * from.width + u];
            r += p.r, g += p.g, b += p.b, alpha += p.alpha;
            opacity = std::max(opacity, uint32_t{p.alpha});
          }
        }
        const uint32_t count = fine * fine;
        const auto mean = [count](uint32_t sum) {
          return static_cast<uint8_t>((sum + count / 2) / count);
        };
        picture.pixels.push_back({mean(r), mean(g), mean(b), mean(alpha)});
        covered.push_back(
            opacity == 0 ? 0 : static_cast<float>(alpha) / static_cast<float>(opacity * count));
      }
    }
    for (uint32_t y = 0; y < picture.height; ++y) {
      for (uint32_t x = 0; x < picture.width; ++x) {
        float most = 0;
        for (uint32_t v = std::max(y, 1u) - 1; v <= std::min(y + 1, picture.height - 1); ++v) {
          for (uint32_t u = std::max(x, 1u) - 1; u <= std::min(x + 1, picture.width - 1); ++u)
            most = std::max(most, covered[size_t{v} * picture.width + u]);
        }
        if (most == 0) continue;
        Pixel& p = picture.pixels[size_t{y} * picture.width + x];
        const double lift = std::min(kMostLift, 1.0 / static_cast<double>(most));
        for (uint8_t* channel : {&p.r, &p.g, &p.b, &p.alpha})
          *channel = static_cast<uint8_t>(std::min(255L, std::lround(*channel * lift)));
      }
    }
    return picture;
  }

  absl::StatusOr<SampledVolume> ToVolume(const Page& page, const Picture& picture) const {
    std::string bytes;
    bytes.reserve(picture.pixels.size() * 3);
    for (const Pixel& p : picture.pixels) {
      for (const uint8_t channel : {p.r, p.g, p.b}) bytes.push_back(static_cast<char>(channel));
    }
    SampledVolume volume;
    volume.size = {picture.width, picture.height, 1};
    DecodeColors(bytes, 3, &volume);
    const double x = page.width / picture.width, y = page.height / picture.height;
    const Point3 first = {page.x + x / 2, -page.y - y / 2, 0};
    absl::Status status = PlaceVolume(
        file_, first, {Point3{x, 0, 0}, Point3{0, -y, 0}, Point3{0, 0, -std::min(x, y)}}, &volume);
    if (!status.ok()) return status;
    return volume;
  }

  const SourceFile& file_;
  const uint32_t across_, up_;
  Model model_;
  Handle handle_;
};

}  // namespace

bool IsDrawing(absl::string_view extension) { return extension == "svg" || extension == "svgz"; }

std::vector<std::string> PrepareDrawings() {
  // gdk-pixbuf has PNG and JPEG built in. For other pictures it would load plug-ins from the folder
  // that this list names.
  ::setenv("GDK_PIXBUF_MODULE_FILE", "/dev/null", 1);
  std::vector<std::string> folders;
  FcStrList* list = FcInit() == FcFalse ? nullptr : FcConfigGetFontDirs(nullptr);
  if (list == nullptr) return folders;
  while (const FcChar8* folder = FcStrListNext(list))
    folders.emplace_back(reinterpret_cast<const char*>(folder));
  FcStrListDone(list);
  return folders;
}

absl::StatusOr<Model> ReadSvgDrawing(const SourceFile& file,
                                     const std::array<uint32_t, 2>& pixels) {
  return Drawing(file, pixels).Read();
}

}  // namespace voxeld::voxelctl
