// Reads TIFF: pages in a stack, with libtiff, which reads them from memory.
#include <tiffio.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdarg>
#include <cstdio>
#include <cstring>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "common/text/printable.h"
#include "tools/import/volume_samples.h"
#include "tools/import/volumes.h"

namespace voxeld::voxelctl {
namespace {

constexpr size_t kMostPages = 65'536;
// Limit of one allocation by the library, in bytes.
constexpr tmsize_t kMostAtOnce = tmsize_t{1} << 30;
constexpr uint32_t kReducedOrMask = FILETYPE_REDUCEDIMAGE | FILETYPE_MASK;

// The file in memory as the library needs it: a position, and the latest error.
struct Source {
  absl::string_view bytes;
  uint64_t at = 0;
  std::string error;
};

Source& SourceOf(thandle_t handle) { return *static_cast<Source*>(handle); }

tmsize_t ReadBytes(thandle_t handle, void* out, tmsize_t size) {
  Source& source = SourceOf(handle);
  if (size <= 0 || source.at >= source.bytes.size()) return 0;
  const uint64_t count =
      std::min<uint64_t>(static_cast<uint64_t>(size), source.bytes.size() - source.at);
  std::memcpy(out, source.bytes.data() + source.at, count);
  source.at += count;
  return static_cast<tmsize_t>(count);
}
tmsize_t WriteNothing(thandle_t, void*, tmsize_t) { return 0; }
toff_t Seek(thandle_t handle, toff_t offset, int whence) {
  Source& source = SourceOf(handle);
  const uint64_t from = whence == SEEK_CUR   ? source.at
                        : whence == SEEK_END ? source.bytes.size()
                                             : 0;
  source.at = from + offset;
  return source.at;
}
int CloseNothing(thandle_t) { return 0; }
toff_t SizeOf(thandle_t handle) { return SourceOf(handle).bytes.size(); }
int Map(thandle_t handle, void** base, toff_t* size) {
  // The library does not write there: the file is opened for reading only.
  *base = const_cast<char*>(SourceOf(handle).bytes.data());
  *size = SourceOf(handle).bytes.size();
  return 1;
}
void Unmap(thandle_t, void*, toff_t) {}

// Keeps the first error, which causes the others.
int KeepError(TIFF*, void* source, const char*, const char* format, va_list values) {
  std::string& error = static_cast<Source*>(source)->error;
  if (!error.empty()) return 1;
  std::array<char, 200> text = {};
  std::vsnprintf(text.data(), text.size(), format, values);
  error = text.data();
  return 1;
}
int IgnoreWarning(TIFF*, void*, const char*, const char*, va_list) { return 1; }

struct CloseTiff {
  void operator()(TIFF* tiff) const { TIFFClose(tiff); }
};

// Pages of one stack have these properties in common.
struct PageKind {
  uint32_t width = 0, height = 0;
  uint16_t channels = 1, bits = 1, format = SAMPLEFORMAT_UINT, photometric = PHOTOMETRIC_MINISBLACK;
  bool operator==(const PageKind&) const = default;
  auto operator<=>(const PageKind&) const = default;
};

// The meaning of the pages, from a description: their counts, the order in which they change, and
// the lengths of a sample.
struct Description {
  uint64_t slices = 0, channels = 1, times = 1;  // 0 slices: the layout is unknown
  std::string order = "CZT";                     // the first one changes from page to page
  std::optional<std::array<double, 3>> spacing;
  std::optional<double> depth;  // in the unit of the resolution
  uint64_t images = 0;          // pages that the description counts; 0: it does not
  // The slice, channel and time of each page that OME's elements TiffData name.
  std::map<uint64_t, std::array<uint64_t, 3>> places;
};

template <typename T>
T TagOf(TIFF* tiff, uint32_t tag, T otherwise) {
  T value = otherwise;
  return TIFFGetFieldDefaulted(tiff, tag, &value) == 1 ? value : otherwise;
}

double LengthOf(absl::string_view text) {
  double length = 0;
  return absl::SimpleAtod(text, &length) && std::isfinite(length) && length > 0 ? length : 0;
}

// Parses ImageJ's lines "name=value".
Description FromImageJ(absl::string_view text) {
  Description found;
  for (const absl::string_view line : absl::StrSplit(text, '\n')) {
    const std::pair<absl::string_view, absl::string_view> field =
        absl::StrSplit(line, absl::MaxSplits('=', 1));
    uint64_t* const number = field.first == "slices"     ? &found.slices
                             : field.first == "channels" ? &found.channels
                             : field.first == "frames"   ? &found.times
                             : field.first == "images"   ? &found.images
                                                         : nullptr;
    if (number != nullptr && (!absl::SimpleAtoi(field.second, number) || *number == 0)) *number = 1;
    // Some stacks have a negative spacing.
    if (field.first == "spacing") found.depth = LengthOf(absl::StripPrefix(field.second, "-"));
  }
  if (found.slices == 0 && (found.channels > 1 || found.times > 1)) found.slices = 1;
  return found;
}

// Returns the value of an attribute of the first element "Pixels".
absl::string_view OmeAttribute(absl::string_view pixels, absl::string_view name) {
  const std::string before = absl::StrCat(" ", name, "=\"");
  const size_t at = pixels.find(before);
  if (at == absl::string_view::npos) return {};
  const absl::string_view value = pixels.substr(at + before.size());
  return value.substr(0, value.find('"'));
}

// Reads the elements TiffData of the first Pixels. Each describes PlaneCount pages from page IFD on, in the order of the dimensions.
void TakeTiffData(absl::string_view text, Description* found) {
  constexpr uint64_t kMostPlaces = 65536;
  uint64_t left = kMostPlaces;  // of all elements, which may name one page again and again
  const std::array<uint64_t, 3> sizes = {found->slices, found->channels, found->times};
  text = text.substr(0, text.find("</Pixels>"));
  constexpr absl::string_view kElement = "<TiffData";
  uint64_t next = 0;
  for (size_t at = text.find(kElement); at != absl::string_view::npos;
       at = text.find(kElement, at + 1)) {
    const absl::string_view element = text.substr(at, text.find('>', at) - at);
    const auto number = [element](absl::string_view name, uint64_t otherwise) {
      uint64_t value = 0;
      return absl::SimpleAtoi(OmeAttribute(element, name), &value) ? value : otherwise;
    };
    std::array<uint64_t, 3> place = {number("FirstZ", 0), number("FirstC", 0), number("FirstT", 0)};
    const bool has_page = !OmeAttribute(element, "IFD").empty();
    const uint64_t page = number("IFD", next);
    // Without a page and a count it describes all pages.
    uint64_t count = number("PlaneCount", has_page ? 1 : kMostPlaces);
    for (next = page; count > 0 && left > 0; --count, --left, ++next) {
      if (place[0] >= sizes[0] || place[1] >= sizes[1] || place[2] >= sizes[2]) break;
      found->places[next] = place;
      for (const char axis : found->order) {
        const size_t i = axis == 'Z' ? 0 : axis == 'C' ? 1 : 2;
        if (++place[i] < sizes[i]) break;
        place[i] = axis == found->order.back() ? sizes[i] : 0;
      }
    }
  }
}

// OME's XML (https://docs.openmicroscopy.org/ome-model).
std::optional<Description> FromOme(absl::string_view text) {
  const size_t from = text.find("<Pixels ");
  if (from == absl::string_view::npos) return std::nullopt;
  const absl::string_view pixels = text.substr(from, text.find('>', from) - from);
  Description found;
  const auto number = [&](absl::string_view name, uint64_t* out) {
    if (!absl::SimpleAtoi(OmeAttribute(pixels, name), out) || *out == 0) *out = 1;
  };
  number("SizeZ", &found.slices);
  number("SizeC", &found.channels);
  number("SizeT", &found.times);
  const absl::string_view order = OmeAttribute(pixels, "DimensionOrder");
  if (order.size() == 5 && absl::StartsWith(order, "XY"))
    found.order = std::string(order.substr(2));
  std::array<double, 3> spacing;
  static constexpr std::pair<absl::string_view, double> kUnits[] = {
      {"nm", 1e-3}, {"\xc2\xb5m", 1}, {"\xce\xbcm", 1}, {"mm", 1e3}, {"cm", 1e4}, {"m", 1e6}};
  for (size_t i = 0; i < 3; ++i) {
    const char axis = static_cast<char>('X' + i);
    spacing[i] = LengthOf(OmeAttribute(pixels, absl::StrCat("PhysicalSize", std::string(1, axis))));
    const absl::string_view unit =
        OmeAttribute(pixels, absl::StrCat("PhysicalSize", std::string(1, axis), "Unit"));
    for (const auto& [name, microns] : kUnits) {
      if (unit == name) spacing[i] *= microns;
    }
  }
  if (spacing[0] > 0 && spacing[1] > 0) {
    if (spacing[2] == 0) spacing[2] = spacing[0];
    found.spacing = spacing;
  }
  TakeTiffData(text.substr(from), &found);
  return found;
}

class TiffReader {
 public:
  explicit TiffReader(const SourceFile& file) : file_(file) { source_.bytes = file.bytes; }

  absl::StatusOr<Model> Read() {
    const absl::string_view head = absl::string_view(file_.bytes).substr(0, 4);
    if (head.substr(0, 3) != absl::string_view("II*", 3) &&
        head.substr(0, 3) != absl::string_view("II+", 3) && head != absl::string_view("MM\0*", 4) &&
        head != absl::string_view("MM\0+", 4)) {
      return FileError(file_, absl::StrCat("is ", DescribeContents(file_.bytes)),
                       "TIFF is expected");
    }
    const std::unique_ptr<TIFFOpenOptions, void (*)(TIFFOpenOptions*)> options(
        TIFFOpenOptionsAlloc(), TIFFOpenOptionsFree);
    if (options == nullptr) return Undecoded("no memory");
    TIFFOpenOptionsSetMaxSingleMemAlloc(options.get(), kMostAtOnce);
    TIFFOpenOptionsSetErrorHandlerExtR(options.get(), KeepError, &source_);
    TIFFOpenOptionsSetWarningHandlerExtR(options.get(), IgnoreWarning, nullptr);
    const std::unique_ptr<TIFF, CloseTiff> tiff(
        TIFFClientOpenExt("file", "r", &source_, ReadBytes, WriteNothing, Seek, CloseNothing,
                          SizeOf, Map, Unmap, options.get()));
    if (tiff == nullptr) return Undecoded("the first page");
    tiff_ = tiff.get();
    return ReadStack();
  }

 private:
  absl::Status Undecoded(absl::string_view what) const {
    return FileError(file_,
                     absl::StrCat("could not be decoded (", what, source_.error.empty() ? "" : ": ",
                                  EscapeForTerminal(source_.error), ")"),
                     "the file is damaged or compressed in a way that is not supported");
  }

  PageKind KindOfPage() const {
    PageKind kind;
    kind.width = TagOf<uint32_t>(tiff_, TIFFTAG_IMAGEWIDTH, 0);
    kind.height = TagOf<uint32_t>(tiff_, TIFFTAG_IMAGELENGTH, 0);
    kind.channels = TagOf<uint16_t>(tiff_, TIFFTAG_SAMPLESPERPIXEL, 1);
    kind.bits = TagOf<uint16_t>(tiff_, TIFFTAG_BITSPERSAMPLE, 1);
    kind.format = TagOf<uint16_t>(tiff_, TIFFTAG_SAMPLEFORMAT, SAMPLEFORMAT_UINT);
    kind.photometric = TagOf<uint16_t>(
        tiff_, TIFFTAG_PHOTOMETRIC,
        kind.channels >= 3 ? uint16_t{PHOTOMETRIC_RGB} : uint16_t{PHOTOMETRIC_MINISBLACK});
    return kind;
  }

  absl::StatusOr<Model> ReadStack() {
    // The kind of each page, and the offset of its directory.
    std::vector<std::pair<PageKind, uint64_t>> pages;
    uint64_t previews = 0;
    do {
      if (pages.size() + previews >= kMostPages) {
        return FileError(file_, absl::StrCat("has more than ", kMostPages, " pages"),
                         "fewer are expected");
      }
      const auto type = TagOf<uint32_t>(tiff_, TIFFTAG_SUBFILETYPE, 0);
      const bool is_preview = (type & kReducedOrMask) != 0 && !pages.empty();
      if (is_preview) {
        ++previews;
      } else {
        pages.emplace_back(KindOfPage(), TIFFCurrentDirOffset(tiff_));
      }
    } while (TIFFReadDirectory(tiff_) == 1);
    // The library stops in the same way at the last page and at a damaged one.
    if (!source_.error.empty())
      return Undecoded(absl::StrCat("page ", pages.size() + previews + 1));

    std::map<PageKind, uint64_t> counts;
    for (const auto& [kind, at] : pages) ++counts[kind];
    PageKind most = pages[0].first;
    for (const auto& [kind, count] : counts) {
      if (count > counts[most]) most = kind;
    }
    Model model;
    model.path = file_.path;
    model.format = "TIFF";
    model.up = Up::kZ;
    AddLeftOut("pages of another size or type", pages.size() - counts[most], &model);
    AddLeftOut("previews and masks", previews, &model);
    std::erase_if(pages, [&](const auto& page) { return page.first != most; });

    if (!SetPage(pages[0].second)) return Undecoded("page 1");
    const Description description = ReadDescription();
    const std::vector<size_t> shown = ChoosePages(description, pages.size(), &model);
    SampledVolume volume;
    const std::array<uint64_t, 3> size = {most.width, most.height, shown.size()};
    if (absl::Status status = CheckVolumeSize(file_, size); !status.ok()) return status;
    for (size_t axis = 0; axis < 3; ++axis) volume.size[axis] = static_cast<uint32_t>(size[axis]);
    if (absl::Status status = Place(description, &volume); !status.ok()) return status;
    const bool grey =
        most.photometric == PHOTOMETRIC_MINISBLACK || most.photometric == PHOTOMETRIC_MINISWHITE;
    if (grey) AddLeftOut("further components", most.channels - 1u, &model);
    // Reserves everything at once, so that nothing is copied while it grows; memory is only used
    // when it is filled.
    volume.samples.reserve(size[0] * size[1] * size[2]);
    for (const size_t page : shown) {
      if (!SetPage(pages[page].second)) return Undecoded(absl::StrCat("page ", page + 1));
      const absl::Status status =
          grey ? ReadGrey(most, page, &volume) : ReadColors(most, page, &volume);
      if (!status.ok()) return status;
    }
    model.volumes.push_back(std::move(volume));
    return model;
  }

  bool SetPage(uint64_t offset) { return TIFFSetSubDirectory(tiff_, offset) == 1; }

  Description ReadDescription() const {
    const char* text = nullptr;
    if (TIFFGetField(tiff_, TIFFTAG_IMAGEDESCRIPTION, &text) != 1 || text == nullptr) return {};
    const absl::string_view description(text);
    if (absl::StartsWith(description, "ImageJ=")) return FromImageJ(description);
    return FromOme(description).value_or(Description());
  }

  // Returns the pages of the first channel and time in the order of their slices; empty unless the description names every page.
  static std::vector<size_t> PlacedPages(const Description& description, size_t pages) {
    if (description.places.size() != pages) return {};
    std::map<uint64_t, size_t> by_slice;
    for (const auto& [page, place] : description.places) {
      if (page < pages && place[1] == 0 && place[2] == 0) by_slice.emplace(place[0], page);
    }
    std::vector<size_t> placed;
    if (by_slice.size() != description.slices) return placed;
    for (const auto& [slice, page] : by_slice) placed.push_back(page);
    return placed;
  }

  // Which of the pages are the slices of the first channel at the first time. All of them if the numbers do not fit.
  static std::vector<size_t> ChoosePages(const Description& description, size_t pages,
                                         Model* model) {
    const uint64_t slices = description.slices, channels = description.channels,
                   times = description.times;
    if (description.images > pages) {
      model->note = absl::StrCat(model->path, ": its description counts ", description.images,
                                 " images, and it has ", pages, " pages, which are shown");
    }
    const auto fits = [pages, slices](uint64_t each, uint64_t others) {
      return slices > 0 && slices <= pages && each <= pages / slices &&
             others <= pages / slices / each && slices * each * others == pages;
    };
    std::vector<size_t> shown;
    if (const std::vector<size_t> placed = PlacedPages(description, pages); !placed.empty()) {
      AddLeftOut("further channels", channels - 1, model);
      AddLeftOut("further times", times - 1, model);
      return placed;
    }
    // A page of colours holds several channels.
    const uint64_t paged = fits(channels, times) ? channels : 1;
    if (!fits(paged, times)) {
      for (size_t i = 0; i < pages; ++i) shown.push_back(i);
      if (slices > 0) {
        model->note = absl::StrCat(model->path, ": its description counts ", slices, " slices, ",
                                   channels, " channels and ", times, " times, and it has ", pages,
                                   " pages; all of them are shown as slices");
      }
      return shown;
    }
    uint64_t step = 1;
    for (const char axis : description.order) {
      if (axis == 'Z') break;
      step *= axis == 'C' ? paged : axis == 'T' ? times : 1;
    }
    for (uint64_t i = 0; i < slices; ++i) shown.push_back(i * step);
    AddLeftOut("further channels", paged - 1, model);
    AddLeftOut("further times", times - 1, model);
    return shown;
  }

  absl::Status Place(const Description& description, SampledVolume* volume) const {
    std::array<double, 3> spacing = {1, 1, 1};
    const double across = double{TagOf<float>(tiff_, TIFFTAG_XRESOLUTION, 0)},
                 down = double{TagOf<float>(tiff_, TIFFTAG_YRESOLUTION, 0)};
    const bool known = across > 0 && down > 0 && std::isfinite(across) && std::isfinite(down);
    if (description.spacing) {
      spacing = *description.spacing;
    } else if (known) {
      // TIFF has no distance between pages; ImageJ adds one.
      spacing = {1 / across, 1 / down, 1 / across};
      if (description.depth.value_or(0) > 0) spacing[2] = *description.depth;
    } else if (description.depth.value_or(0) > 0) {
      spacing[2] = *description.depth;
    }
    // The directions of columns and rows, given the sides of the first row and the first column.
    const Point3 right = {1, 0, 0}, left = {-1, 0, 0}, back = {0, 1, 0}, front = {0, -1, 0};
    static constexpr int kOrientations = 8;
    const std::array<std::pair<Point3, Point3>, kOrientations> directions = {{{right, back},
                                                                              {left, back},
                                                                              {left, front},
                                                                              {right, front},
                                                                              {back, right},
                                                                              {back, left},
                                                                              {front, left},
                                                                              {front, right}}};
    const auto orientation = TagOf<uint16_t>(tiff_, TIFFTAG_ORIENTATION, ORIENTATION_TOPLEFT);
    const auto& [columns, rows] =
        directions[orientation >= 1 && orientation <= kOrientations ? orientation - 1u : 0u];
    const auto times = [](const Point3& p, double by) {
      return Point3{p.x * by, p.y * by, p.z * by};
    };
    return PlaceVolume(
        file_, {}, {times(columns, spacing[0]), times(rows, spacing[1]), Point3{0, 0, spacing[2]}},
        volume);
  }

  // Reads colours of any kind: palettes, YCbCr, CMYK and so on.
  absl::Status ReadColors(const PageKind& kind, size_t page, SampledVolume* volume) {
    const uint64_t count = uint64_t{kind.width} * kind.height;
    std::array<char, 1024> why = {};
    if (TIFFRGBAImageOK(tiff_, why.data()) != 1) {
      return FileError(
          file_,
          absl::StrCat("has colours that are not read (", EscapeForTerminal(why.data()), ")"),
          "grey of 1 to 64 bits, and colours of 8 or 16, are read");
    }
    // The memory is not initialised, so a damaged page uses none.
    const std::unique_ptr<uint32_t[]> colors = std::make_unique_for_overwrite<uint32_t[]>(count);
    const auto orientation = TagOf<uint16_t>(tiff_, TIFFTAG_ORIENTATION, ORIENTATION_TOPLEFT);
    if (TIFFReadRGBAImageOriented(tiff_, kind.width, kind.height, colors.get(), orientation, 1) !=
        1)
      return Undecoded(absl::StrCat("page ", page + 1));
    // The library has premultiplied the colours by their opacity.
    for (uint64_t i = 0; i < count; ++i) colors[i] |= 0xff000000u;
    DecodeColors({reinterpret_cast<const char*>(colors.get()), count * sizeof(uint32_t)}, 4,
                 volume);
    return absl::OkStatus();
  }

  static std::optional<SampleType> TypeOf(const PageKind& kind) {
    const bool is_signed = kind.format == SAMPLEFORMAT_INT;
    if (kind.format == SAMPLEFORMAT_IEEEFP) {
      return kind.bits == 16   ? std::optional(SampleType::kF16)
             : kind.bits == 32 ? std::optional(SampleType::kF32)
             : kind.bits == 64 ? std::optional(SampleType::kF64)
                               : std::nullopt;
    }
    if (kind.format != SAMPLEFORMAT_UINT && kind.format != SAMPLEFORMAT_INT &&
        kind.format != SAMPLEFORMAT_VOID) {
      return std::nullopt;
    }
    switch (kind.bits) {
      case 8:
        return is_signed ? SampleType::kI8 : SampleType::kU8;
      case 16:
        return is_signed ? SampleType::kI16 : SampleType::kU16;
      case 32:
        return is_signed ? SampleType::kI32 : SampleType::kU32;
      case 64:
        return is_signed ? SampleType::kI64 : SampleType::kU64;
      default:
        // Bits per sample below 8, and 12, are expanded to 8 or 16.
        if (is_signed || kind.bits == 0 || kind.bits > 16) return std::nullopt;
        return kind.bits < 8 ? SampleType::kU8 : SampleType::kU16;
    }
  }

  // Appends the first channel of `count` pixels in `row` to `out`.
  static void DecodeRow(const PageKind& kind, const SampleCode& code, size_t channels,
                        absl::string_view row, size_t count, std::vector<float>* out) {
    const size_t whole = SampleBytes(code.type) * 8;
    if (kind.bits == whole) {
      if (channels == 1) return DecodeSamples(row.substr(0, count * whole / 8), code, out);
      std::vector<float> all;
      DecodeSamples(row.substr(0, count * channels * whole / 8), code, &all);
      KeepFirstOfEach(channels, &all);
      out->insert(out->end(), all.begin(), all.end());
      return;
    }
    for (size_t i = 0; i < count; ++i) {
      uint32_t value = 0;
      for (size_t k = 0; k < kind.bits; ++k) {
        const size_t bit = i * channels * kind.bits + k;
        value = value << 1 | (static_cast<uint8_t>(row[bit / 8]) >> (7 - bit % 8) & 1u);
      }
      out->push_back(static_cast<float>(value * code.slope + code.intercept));
    }
  }

  // Reads a row of tiles at a time. Strips are tiles as wide as the page.
  absl::Status ReadGrey(const PageKind& kind, size_t page, SampledVolume* volume) {
    const std::optional<SampleType> type = TypeOf(kind);
    if (!type) {
      return FileError(
          file_, absl::StrCat("has samples of ", kind.bits, " bits in format ", kind.format),
          "whole numbers of 1 to 16, 32 or 64 bits, and floats of 16, 32 or 64, are read");
    }
    SampleCode code{.type = *type};
    const bool is_float = kind.format == SAMPLEFORMAT_IEEEFP;
    if (kind.photometric == PHOTOMETRIC_MINISWHITE && !is_float &&
        kind.format != SAMPLEFORMAT_INT) {
      code.slope = -1;
      code.intercept = std::ldexp(1.0, kind.bits) - 1;
    }
    const bool tiled = TIFFIsTiled(tiff_) != 0;
    const bool apart =
        TagOf<uint16_t>(tiff_, TIFFTAG_PLANARCONFIG, PLANARCONFIG_CONTIG) == PLANARCONFIG_SEPARATE;
    const size_t channels = apart ? 1 : kind.channels;
    uint32_t wide = kind.width, high = TagOf<uint32_t>(tiff_, TIFFTAG_ROWSPERSTRIP, kind.height);
    if (tiled) {
      wide = TagOf<uint32_t>(tiff_, TIFFTAG_TILEWIDTH, 0);
      high = TagOf<uint32_t>(tiff_, TIFFTAG_TILELENGTH, 0);
    }
    high = tiled ? high : std::min(high, kind.height);
    const uint64_t row_bytes = (uint64_t{wide} * channels * kind.bits + 7) / 8;
    if (wide == 0 || high == 0 || TagOf<uint32_t>(tiff_, TIFFTAG_IMAGEDEPTH, 1) > 1 ||
        row_bytes > static_cast<uint64_t>(kMostAtOnce) / high) {
      return FileError(file_, absl::StrCat("has tiles of ", wide, " by ", high, " pixels"),
                       "smaller ones, in pages of one layer, are expected");
    }
    const uint64_t tile_bytes = row_bytes * high;
    const size_t across = (size_t{kind.width} + wide - 1) / wide;
    // The memory is not initialised, so a damaged page uses none.
    const std::unique_ptr<char[]> tile = std::make_unique_for_overwrite<char[]>(tile_bytes);
    std::vector<std::vector<float>> rows;
    for (uint32_t top = 0; top < kind.height; top += std::min(high, kind.height - top)) {
      const size_t count = std::min(high, kind.height - top);
      rows.assign(across > 1 ? count : 0, {});
      for (size_t k = 0; k < across; ++k) {
        const auto left = static_cast<uint32_t>(k * wide);
        const uint64_t wanted = tiled ? tile_bytes : row_bytes * count;
        const tmsize_t got =
            tiled ? TIFFReadEncodedTile(tiff_, TIFFComputeTile(tiff_, left, top, 0, 0), tile.get(),
                                        static_cast<tmsize_t>(wanted))
                  : TIFFReadEncodedStrip(tiff_, TIFFComputeStrip(tiff_, top, 0), tile.get(),
                                         static_cast<tmsize_t>(wanted));
        if (got < 0 || static_cast<uint64_t>(got) != wanted)
          return Undecoded(absl::StrCat("page ", page + 1, " from row ", top));
        const size_t pixels = std::min<size_t>(wide, kind.width - left);
        for (size_t row = 0; row < count; ++row) {
          DecodeRow(kind, code, channels, {tile.get() + row * row_bytes, row_bytes}, pixels,
                    across > 1 ? &rows[row] : &volume->samples);
        }
      }
      for (const std::vector<float>& row : rows)
        volume->samples.insert(volume->samples.end(), row.begin(), row.end());
    }
    return absl::OkStatus();
  }

  const SourceFile& file_;
  Source source_;
  TIFF* tiff_ = nullptr;
};

}  // namespace

absl::StatusOr<Model> ReadTiffVolume(const SourceFile& file) { return TiffReader(file).Read(); }

}  // namespace voxeld::voxelctl
