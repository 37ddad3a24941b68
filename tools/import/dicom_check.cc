#include "tools/import/dicom_check.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_split.h"
#include "absl/strings/string_view.h"
#include "common/text/printable.h"
#include "tools/import/inflate.h"
#include "tools/voxelctl/import/model.h"

namespace voxeld::voxelctl {
namespace {

constexpr size_t kPreamble = 128;
constexpr int kMostSequences = 32;
constexpr uint32_t kUndefined = UINT32_MAX;
constexpr uint32_t kItem = 0xFFFEE000, kItemEnd = 0xFFFEE00D, kSequenceEnd = 0xFFFEE0DD;
constexpr uint32_t kPixels = 0x7FE00010;
constexpr uint32_t kModalityTables = 0x00283000, kDisplayTables = 0x00283010;  // sequences
constexpr absl::string_view kDeflated = "1.2.840.10008.1.2.1.99",
                            kBigEndian = "1.2.840.10008.1.2.2", kRunLengths = "1.2.840.10008.1.2.5";
// Value representations (two letters) whose elements have 32-bit lengths.
constexpr absl::string_view kLong = "OB OD OF OL OV OW SQ SV UC UN UR UT UV";

class Walker {
 public:
  explicit Walker(const SourceFile& file) : file_(file), bytes_(file.bytes) {}

  // Returns where the deflated part begins; 0 if nothing is deflated.
  absl::StatusOr<size_t> DeflatedFrom() {
    size_t at = kPreamble + 4;
    if (absl::Status status = Head(&at); !status.ok()) return status;
    return facts_.transfer_syntax == kDeflated ? at : 0;
  }

  absl::StatusOr<DicomFacts> Walk() {
    size_t at = kPreamble + 4;
    if (absl::Status status = Head(&at); !status.ok()) return status;
    const std::string& syntax = facts_.transfer_syntax;
    facts_.big_endian = syntax == kBigEndian;
    explicit_ = syntax.empty() ? SaysItsKind(at) : syntax != "1.2.840.10008.1.2";
    while (at < bytes_.size()) {
      if (absl::Status status = Element(&at, bytes_.size(), 0); !status.ok()) return status;
    }
    if (absl::Status status = CheckFacts(); !status.ok()) return status;
    return facts_;
  }

 private:
  // The second group says how the rest is encoded; it is itself always explicit.
  absl::Status Head(size_t* at) {
    explicit_ = true;
    while (*at + 8 <= bytes_.size() && U16(*at) == 2) {
      if (absl::Status status = Element(at, bytes_.size(), 0); !status.ok()) return status;
    }
    return absl::OkStatus();
  }

  // Returns whether two letters are at the place where an element's value representation would be.
  bool SaysItsKind(size_t at) const {
    return at + 8 <= bytes_.size() &&
           absl::ascii_isupper(static_cast<unsigned char>(bytes_[at + 4])) &&
           absl::ascii_isupper(static_cast<unsigned char>(bytes_[at + 5]));
  }

  uint16_t U16(size_t at) const {
    uint16_t value;
    std::memcpy(&value, bytes_.data() + at, 2);
    return facts_.big_endian ? __builtin_bswap16(value) : value;
  }
  uint32_t U32(size_t at) const {
    uint32_t value;
    std::memcpy(&value, bytes_.data() + at, 4);
    return facts_.big_endian ? __builtin_bswap32(value) : value;
  }
  static std::string Name(uint32_t tag) {
    return absl::StrFormat("(%04x,%04x)", tag >> 16, tag & 0xffff);
  }
  absl::Status CutOff(uint32_t tag, uint64_t length, uint64_t left) const {
    return FileError(
        file_,
        absl::StrCat("its element ", Name(tag), " has ", length, " bytes; ", left, " are left"),
        "the file is truncated or damaged");
  }

  absl::Status Element(size_t* at, size_t end, int depth) {
    if (end - *at < 8) return CutOff(0, 8, end - *at);
    const uint32_t tag = uint32_t{U16(*at)} << 16 | U16(*at + 2);
    absl::string_view kind = bytes_.substr(*at + 4, 2);
    uint64_t length = 0;
    if (!explicit_ || tag >> 16 == 0xFFFE) {
      kind = "";
      length = U32(*at + 4);
      *at += 8;
    } else if (absl::StrContains(kLong, kind)) {
      if (end - *at < 12) return CutOff(tag, 12, end - *at);
      length = U32(*at + 8);
      *at += 12;
    } else {
      length = U16(*at + 6);
      *at += 8;
    }
    const bool top = depth == 0;
    if (top && tag == kPixels) facts_.has_pixels = true, facts_.pixels.clear();
    if (length == kUndefined) {
      const bool implicit = kind == "UN";
      const bool was = explicit_;
      if (implicit) explicit_ = false;
      if (top && tag == kPixels) facts_.compressed = true;
      absl::Status status = Within(tag, at, end, tag == kPixels, depth);
      explicit_ = was;
      return status;
    }
    if (length > end - *at) return CutOff(tag, length, end - *at);
    const size_t after = *at + length;
    if (kind == "SQ" || (kind.empty() && tag != kPixels && BeginsWithItem(*at, length))) {
      if (absl::Status status = Within(tag, at, after, false, depth); !status.ok()) return status;
    } else {
      Take(tag, bytes_.substr(*at, length), top);
    }
    *at = after;
    return absl::OkStatus();
  }

  // Returns whether a value without an explicit representation is a sequence: it begins like one,
  // and the item fits.
  bool BeginsWithItem(size_t at, uint64_t length) const {
    if (length < 8 || (uint32_t{U16(at)} << 16 | U16(at + 2)) != kItem) return false;
    const uint32_t item = U32(at + 4);
    return item == kUndefined || item <= length - 8;
  }

  // The items of the element `tag`.
  absl::Status Within(uint32_t tag, size_t* at, size_t end, bool fragments, int depth) {
    const uint32_t outer = std::exchange(sequence_, tag);
    absl::Status status = Items(at, end, tag, fragments, depth + 1);
    sequence_ = outer;
    return status;
  }

  // Items up to a delimiter or `end`; `fragments`: their contents are no elements.
  absl::Status Items(size_t* at, size_t end, uint32_t of, bool fragments, int depth) {
    if (depth > kMostSequences) {
      return FileError(file_, absl::StrCat("has sequences ", depth, " deep"),
                       absl::StrCat("at most ", kMostSequences, " are read"));
    }
    while (*at < end) {
      if (end - *at < 8) return CutOff(of, 8, end - *at);
      const uint32_t tag = uint32_t{U16(*at)} << 16 | U16(*at + 2);
      const uint64_t length = U32(*at + 4);
      *at += 8;
      if (tag == kSequenceEnd) return absl::OkStatus();
      if (tag != kItem) {
        return FileError(file_, absl::StrCat("has ", Name(tag), " among the items of ", Name(of)),
                         "the file is damaged");
      }
      if (length != kUndefined && length > end - *at) return CutOff(of, length, end - *at);
      if (fragments) {
        if (length == kUndefined) return CutOff(of, length, end - *at);
        if (depth == 1) facts_.pixels.emplace_back(*at, length);
        *at += length;
        continue;
      }
      const size_t after = length == kUndefined ? end : *at + length;
      while (*at < after) {
        if (after - *at >= 8 && (uint32_t{U16(*at)} << 16 | U16(*at + 2)) == kItemEnd) {
          *at += 8;
          break;
        }
        if (absl::Status status = Element(at, after, depth); !status.ok()) return status;
      }
    }
    return absl::OkStatus();
  }

  // Of 16 bits each.
  std::vector<uint32_t> Numbers(absl::string_view value) const {
    std::vector<uint32_t> numbers;
    for (size_t i = 0; i + 2 <= value.size(); i += 2)
      numbers.push_back(U16(static_cast<size_t>(value.data() - bytes_.data()) + i));
    return numbers;
  }

  static std::string Text(absl::string_view value) {
    return std::string(absl::StripAsciiWhitespace(value.substr(0, value.find('\0'))));
  }

  void Take(uint32_t tag, absl::string_view value, bool top) {
    // In multi-frame images these are in sequences, either of each frame or shared by all.
    std::string* const anywhere = tag == 0x00200037   ? &facts_.orientation
                                  : tag == 0x00280030 ? &facts_.spacing
                                  : tag == 0x00180050 ? &facts_.slice_thickness
                                  : tag == 0x00180088 ? &facts_.slices_apart
                                  : tag == 0x00281052 ? &facts_.intercept
                                  : tag == 0x00281053 ? &facts_.slope
                                  : tag == 0x00281050 ? &facts_.window_center
                                  : tag == 0x00281051 ? &facts_.window_width
                                                      : nullptr;
    if (sequence_ == kModalityTables && tag == 0x00283002)
      facts_.modality.descriptor = Numbers(value);
    if (sequence_ == kModalityTables && tag == 0x00283006)
      facts_.modality.entries = {static_cast<size_t>(value.data() - bytes_.data()), value.size()};
    facts_.display_tables += sequence_ == kDisplayTables && tag == 0x00283006 ? 1 : 0;
    if (!top && tag == 0x00281052) facts_.intercepts.push_back(Text(value));
    if (!top && tag == 0x00281053) facts_.slopes.push_back(Text(value));
    if (anywhere != nullptr) {
      if (top || anywhere->empty()) *anywhere = Text(value);
      return;
    }
    if (tag == 0x00200032) {
      facts_.positions.push_back(Text(value));
      return;
    }
    if (!top) return;
    static constexpr std::array<uint32_t, 6> kTimes = {0x00200100, 0x00080032, 0x00181060,
                                                       0x00200012, 0x00180086, 0x00200013};
    const auto time = std::find(kTimes.begin(), kTimes.end(), tag);
    if (time != kTimes.end()) {
      facts_.times[static_cast<size_t>(time - kTimes.begin())] = Text(value);
      return;
    }
    if (tag >= 0x00281101 && tag <= 0x00281103) {
      facts_.palette[tag - 0x00281101].descriptor = Numbers(value);
      return;
    }
    if (tag >= 0x00281201 && tag <= 0x00281203) {
      facts_.palette[tag - 0x00281201].entries = {static_cast<size_t>(value.data() - bytes_.data()),
                                                  value.size()};
      return;
    }
    // Groups 6000 to 601e: the rows of an overlay.
    if ((tag & 0xFFE1FFFF) == 0x60000010) ++facts_.overlays;
    const uint16_t number =
        value.size() >= 2 ? U16(static_cast<size_t>(value.data() - bytes_.data())) : uint16_t{0};
    switch (tag) {
      case 0x00020010:
        facts_.transfer_syntax = Text(value);
        break;
      case 0x0020000E:
        facts_.series = Text(value);
        break;
      case 0x00280002:
        facts_.samples_per_pixel = number;
        break;
      case 0x00280004:
        facts_.photometric = Text(value);
        break;
      case 0x00280006:
        facts_.planar = number == 1;
        break;
      case 0x3004000C:
        facts_.frame_offsets = Text(value);
        break;
      case 0x00181164:
        facts_.detector_spacing = Text(value);
        break;
      case 0x00182010:
        facts_.film_spacing = Text(value);
        break;
      case 0x00280034:
        facts_.aspect = Text(value);
        break;
      case 0x00280009: {
        const std::vector<uint32_t> halves = Numbers(value);
        for (size_t i = 0; i + 1 < halves.size(); i += 2)
          facts_.frame_axes.push_back(halves[i] << 16 | halves[i + 1]);
        break;
      }
      case 0x00540080: {
        const std::vector<uint32_t> slices = Numbers(value);
        facts_.slice_order.assign(slices.begin(), slices.end());
        break;
      }
      case 0x00280008:
        if (!absl::SimpleAtoi(Text(value), &facts_.frames)) facts_.frames = 0;
        break;
      case 0x00280010:
        facts_.rows = number;
        break;
      case 0x00280011:
        facts_.columns = number;
        break;
      case 0x00280100:
        facts_.bits_allocated = number;
        break;
      case 0x00280101:
        facts_.bits_stored = number;
        break;
      case 0x00280102:
        facts_.high_bit = number;
        break;
      case 0x00280103:
        facts_.is_signed = number == 1;
        break;
      case kPixels:
        facts_.pixels.emplace_back(static_cast<size_t>(value.data() - bytes_.data()), value.size());
        break;
      default:
        break;
    }
  }

  absl::Status CheckFacts() const {
    if (!facts_.has_pixels) return FileError(file_, "holds no pixels", "an image is expected");
    if (facts_.rows == 0 || facts_.columns == 0 || facts_.frames == 0) {
      return FileError(file_,
                       absl::StrCat("has ", facts_.frames, " frames of ", facts_.columns, " by ",
                                    facts_.rows, " pixels"),
                       "at least one is expected");
    }
    const std::string& photometric = facts_.photometric;
    const uint64_t bits = facts_.bits_allocated;
    const bool colors = photometric == "RGB" || absl::StartsWith(photometric, "YBR_");
    const bool palette = photometric == "PALETTE COLOR";
    if ((!IsGrey(facts_) && !colors && !palette) ||
        facts_.samples_per_pixel != (colors ? 3u : 1u)) {
      return FileError(
          file_,
          absl::StrCat("is an image in ", facts_.samples_per_pixel, " channels (",
                       EscapeForTerminal(photometric), ")"),
          "one of numbers (MONOCHROME1, MONOCHROME2), RGB, YBR_… or PALETTE COLOR is expected");
    }
    const bool one = bits == 1 && !colors && !palette && !facts_.compressed;
    if (!one && bits != 8 && bits != 16 && (bits != 32 || colors || palette)) {
      return FileError(
          file_, absl::StrCat("has ", bits, " bits for each ", colors ? "colour" : "pixel"),
          colors || palette ? "8 or 16 are read" : "8, 16, 32 or, uncompressed, 1 are read");
    }
    const bool run_lengths = facts_.transfer_syntax == kRunLengths;
    // The library that decodes these mixes up the colours.
    if (colors && bits == 16 && run_lengths) {
      return FileError(file_, "has colours of 16 bits, compressed by run lengths",
                       "8 bits, or another compression, are read");
    }
    // The library also reads beyond the end of these, whose channels have different sizes.
    if (photometric == "YBR_FULL_422" && run_lengths) {
      return FileError(file_, "has colours in YBR_FULL_422, compressed by run lengths",
                       "RGB or YBR_FULL is expected");
    }
    if (absl::Status status = palette ? CheckPalette() : absl::OkStatus(); !status.ok())
      return status;
    if (!facts_.modality.descriptor.empty()) {
      const absl::Status status = CheckTable(facts_.modality, "table of what its numbers mean");
      if (!status.ok()) return status;
    }
    // At most 2³² of the first two, so that the product cannot wrap.
    const uint64_t pixels = facts_.rows * facts_.columns;
    if (facts_.frames > kMaxModelSamples / pixels) {
      return FileError(file_,
                       absl::StrCat("has ", facts_.frames, " frames of ", facts_.columns, " by ",
                                    facts_.rows, " pixels"),
                       absl::StrCat("at most ", kMaxModelSamples, " in all are read"));
    }
    if (facts_.bits_stored == 0 || facts_.bits_stored > bits ||
        facts_.high_bit + 1 != facts_.bits_stored) {
      return FileError(file_,
                       absl::StrCat("has ", facts_.bits_stored, " bits up to bit ", facts_.high_bit,
                                    " of the ", bits, " for each pixel"),
                       "bits from bit 0 on are expected");
    }
    // In YBR_FULL_422 two pixels share their colours.
    const uint64_t halves = !colors ? 2 : photometric == "YBR_FULL_422" ? 4 : 6;
    if (photometric == "YBR_FULL_422" && !facts_.compressed &&
        (facts_.columns % 2 == 1 || bits != 8)) {
      return FileError(file_,
                       absl::StrCat("has rows of ", facts_.columns, " pixels of ", bits,
                                    " bits in YBR_FULL_422"),
                       "an even number of them, of 8 bits, is expected");
    }
    const uint64_t wanted = (pixels * facts_.frames * bits * halves / 2 + 7) / 8;
    if (!facts_.compressed) {
      const uint64_t given = facts_.pixels.empty() ? 0 : facts_.pixels[0].second;
      return given < wanted ? CutOff(kPixels, wanted, given) : absl::OkStatus();
    }
    if (facts_.pixels.size() < 2) {
      return FileError(file_, "has no fragment of its compressed pixels",
                       "at least one is expected");
    }
    if (run_lengths && facts_.pixels.size() - 1 != facts_.frames) {
      return FileError(file_,
                       absl::StrCat("has ", facts_.pixels.size() - 1, " fragments for ",
                                    facts_.frames, " frames, compressed by run lengths"),
                       "one for each frame is expected");
    }
    for (size_t i = 1; i < facts_.pixels.size(); ++i) {
      const absl::string_view fragment =
          bytes_.substr(facts_.pixels[i].first, facts_.pixels[i].second);
      const absl::Status status =
          run_lengths ? CheckRunLengths(fragment, facts_.samples_per_pixel * bits / 8)
                      : CheckPicture(fragment);
      if (!status.ok()) return status;
    }
    return absl::OkStatus();
  }

  // Checks the header of a frame compressed by run lengths (DICOM PS3.5, G.5): the number of its
  // segments, one per byte of a pixel, and the offset of each.
  absl::Status CheckRunLengths(absl::string_view frame, uint64_t segments) const {
    constexpr size_t kHead = 64, kMostSegments = 15;
    const auto number = [frame](size_t i) {
      uint32_t value = 0;
      std::memcpy(&value, frame.data() + 4 * i, sizeof(value));
      return value;
    };
    if (frame.size() < kHead || segments > kMostSegments || number(0) != segments) {
      return FileError(file_,
                       absl::StrCat("has a frame of ", frame.size() < kHead ? 0 : number(0),
                                    " segments of run lengths"),
                       absl::StrCat(segments, " are expected, one for each byte of a pixel"));
    }
    for (size_t i = 1; i <= segments; ++i) {
      const uint64_t begin = number(i), before = i == 1 ? kHead : number(i - 1);
      if (begin < before || begin > frame.size()) {
        return FileError(
            file_,
            absl::StrCat("has a segment of run lengths at byte ", begin, " of ", frame.size()),
            "the file is damaged");
      }
    }
    return absl::OkStatus();
  }

  absl::Status CheckPalette() const {
    static constexpr const char* kNames[] = {"palette of red", "palette of green",
                                             "palette of blue"};
    for (size_t i = 0; i < 3; ++i) {
      if (absl::Status status = CheckTable(facts_.palette[i], kNames[i]); !status.ok())
        return status;
      const uint32_t bits = facts_.palette[i].descriptor[2];
      if (bits != 8 && bits != 16) {
        return FileError(file_, absl::StrCat("has ", bits, " bits for entries of its ", kNames[i]),
                         "8 or 16 are expected");
      }
    }
    return absl::OkStatus();
  }

  absl::Status CheckTable(const DicomFacts::Palette& table, absl::string_view name) const {
    const auto& [descriptor, entries] = table;
    const auto& [at, length] = entries;
    if (descriptor.size() != 3 || descriptor[2] < 8 || descriptor[2] > 16) {
      return FileError(file_, absl::StrCat("has no ", name, " that can be read"),
                       "three numbers (entries, the first, 8 to 16 bits) are expected to describe "
                       "it");
    }
    const uint64_t count = descriptor[0] == 0 ? 65536 : descriptor[0];
    // Entries of 8 bits may have 16 bits of room.
    if (length < count || (descriptor[2] > 8 && length < count * 2)) {
      return FileError(file_,
                       absl::StrCat("has ", length, " bytes for ", count, " entries of ",
                                    descriptor[2], " bits in its ", name),
                       "all of them are expected");
    }
    return absl::OkStatus();
  }

  uint64_t Big(absl::string_view bytes, size_t at, size_t length) const {
    uint64_t value = 0;
    for (size_t i = at; i < at + length; ++i)
      value = value << 8 | static_cast<unsigned char>(i < bytes.size() ? bytes[i] : 0);
    return value;
  }

  // Checks the size that a picture declares before a decoder relies on it. Data without a picture's
  // beginning continue another picture.
  absl::Status CheckPicture(absl::string_view picture) const {
    uint64_t wide = facts_.columns, high = facts_.rows;
    if (absl::StartsWith(picture, "\xff\x4f\xff\x51")) {
      wide = Big(picture, 8, 4) - Big(picture, 16, 4);
      high = Big(picture, 12, 4) - Big(picture, 20, 4);
    } else if (absl::StartsWith(picture, "\xff\xd8")) {
      size_t at = 2;
      while (at + 9 < picture.size() && picture[at] == '\xff') {
        const uint64_t marker = Big(picture, at + 1, 1);
        const bool frame = (marker >= 0xC0 && marker <= 0xCF && marker != 0xC4 && marker != 0xC8 &&
                            marker != 0xCC) ||
                           marker == 0xF7;
        if (frame) {
          high = Big(picture, at + 5, 2);
          wide = Big(picture, at + 7, 2);
          break;
        }
        at += 2 + Big(picture, at + 2, 2);
      }
    }
    if (wide == facts_.columns && high == facts_.rows) return absl::OkStatus();
    return FileError(file_,
                     absl::StrCat("holds a picture of ", wide, " by ", high, " pixels in one of ",
                                  facts_.columns, " by ", facts_.rows),
                     "the file is damaged");
  }

  const SourceFile& file_;
  const absl::string_view bytes_;
  bool explicit_ = true;
  uint32_t sequence_ = 0;  // the element whose items are walked
  DicomFacts facts_;
};

}  // namespace

bool IsGrey(const DicomFacts& facts) { return absl::StartsWith(facts.photometric, "MONOCHROME"); }

bool LacksPreamble(const SourceFile& file) {
  const absl::string_view bytes = file.bytes;
  if (LooksLikeDicom(file) || bytes.size() < 12) return false;
  // The file begins with the length of the second group, or with an identifier of the first: "UI",
  // or eight bytes that are plausible without it.
  if (absl::StartsWith(bytes, absl::string_view("\2\0\0\0UL\4\0", 8))) return true;
  if (bytes.substr(0, 2) != absl::string_view("\x08\0", 2) || bytes[3] != 0) return false;
  static constexpr absl::string_view kKinds[] = {"UI", "CS", "UL", "DA", "TM", "LO"};
  for (const absl::string_view kind : kKinds) {
    if (bytes.substr(4, 2) == kind) return true;
  }
  uint32_t length;
  std::memcpy(&length, bytes.data() + 4, sizeof(length));
  return length > 0 && length <= 64 && length % 2 == 0;
}

absl::StatusOr<std::optional<SourceFile>> PlainDicom(const SourceFile& given) {
  SourceFile headed{.path = given.path, .extension = given.extension, .bytes = {}};
  const bool lacks_preamble = LacksPreamble(given);
  if (lacks_preamble)
    headed.bytes = absl::StrCat(std::string(kPreamble, '\0'), "DICM", given.bytes);
  const SourceFile& file = lacks_preamble ? headed : given;
  if (!LooksLikeDicom(file)) return std::nullopt;
  const absl::StatusOr<size_t> head = Walker(file).DeflatedFrom();
  if (!head.ok()) return head.status();
  if (*head == 0) return lacks_preamble ? std::optional(std::move(headed)) : std::nullopt;
  const absl::StatusOr<std::string> rest =
      Inflate(file, absl::string_view(file.bytes).substr(*head), kMaxDeflated + 1, Deflated::kRaw);
  if (!rest.ok()) return rest.status();
  if (rest->size() > kMaxDeflated) {
    return FileError(file, absl::StrCat("holds more than ", kMaxDeflated, " bytes, compressed"),
                     "less is read");
  }
  SourceFile inflated{.path = file.path, .extension = file.extension, .bytes = {}};
  inflated.bytes = absl::StrCat(absl::string_view(file.bytes).substr(0, *head), *rest);
  return inflated;
}

std::vector<double> DicomNumbers(const std::string& text) {
  std::vector<double> numbers;
  for (const absl::string_view word : absl::StrSplit(text, '\\', absl::SkipEmpty())) {
    double number = 0;
    if (!absl::SimpleAtod(word, &number) || !std::isfinite(number)) return {};
    numbers.push_back(number);
  }
  return numbers;
}

bool LooksLikeDicom(const SourceFile& file) {
  return file.bytes.size() > kPreamble + 12 && file.bytes.compare(kPreamble, 4, "DICM") == 0;
}

absl::StatusOr<DicomFacts> CheckDicom(const SourceFile& file) {
  if (!LooksLikeDicom(file)) {
    return FileError(file, absl::StrCat("is ", DescribeContents(file.bytes)),
                     "DICOM is expected (\"DICM\" at byte 128)");
  }
  return Walker(file).Walk();
}

}  // namespace voxeld::voxelctl
