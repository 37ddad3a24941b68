// Decodes DICOM's pixels; gdcm decodes compressed ones.

#include <gdcmImageReader.h>
#include <gdcmTrace.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <exception>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/string_view.h"
#include "tools/import/dicom_check.h"
#include "tools/import/volume_samples.h"

namespace voxeld::voxelctl {
namespace {

// The layout of three values per pixel.
struct ColorLayout {
  bool planar = false;
  bool ybr = false;
  bool halved = false;  // two neighbouring pixels: two brightnesses, then their shared blue and red
  bool big_endian = false;
};

// Returns three bytes per pixel, r g b. `bytes` holds all values.
std::string ToRgb(absl::string_view bytes, const DicomFacts& facts, const ColorLayout& layout) {
  const uint64_t frame = facts.rows * facts.columns;
  const size_t each = facts.bits_allocated / 8;
  const int spare = std::max(0, facts.bits_stored - 8);
  // Returns the highest 8 bits of the value at index `at`.
  const auto number = [&](uint64_t at) {
    const auto byte = [&](size_t i) { return static_cast<uint8_t>(bytes[at * each + i]); };
    if (each == 1) return uint32_t{byte(0)};
    const uint32_t value = layout.big_endian ? byte(0) << 8 | byte(1) : byte(1) << 8 | byte(0);
    return std::min(value >> spare, 255u);
  };
  std::string out;
  out.reserve(frame * facts.frames * 3);
  for (uint64_t pixel = 0; pixel < frame * facts.frames; ++pixel) {
    std::array<uint32_t, 3> c;
    for (uint64_t k = 0; k < 3; ++k) {
      const uint64_t at = layout.halved   ? pixel / 2 * 4 + (k == 0 ? pixel % 2 : k + 1)
                          : layout.planar ? (pixel / frame * 3 + k) * frame + pixel % frame
                                          : pixel * 3 + k;
      c[k] = number(at);
    }
    if (layout.ybr) {
      // ITU-R BT.601, full range from 0 to 255 (PS3.3, C.7.6.3.1.2).
      const double y = c[0], b = c[1] - 128.0, r = c[2] - 128.0;
      const auto channel = [](double v) {
        return static_cast<uint32_t>(std::lround(std::clamp(v, 0.0, 255.0)));
      };
      c = {channel(y + 1.402 * r), channel(y - 0.344136 * b - 0.714136 * r),
           channel(y + 1.772 * b)};
    }
    for (const uint32_t channel : c) out += static_cast<char>(channel);
  }
  return out;
}

absl::Status Undecoded(const SourceFile& file, absl::string_view why) {
  return FileError(file, absl::StrCat("its image could not be decoded (", why, ")"),
                   "the file is damaged or compressed in a way that is not supported");
}

SampleType TypeOf(const DicomFacts& facts) {
  switch (facts.bits_allocated) {
    case 8:
      return facts.is_signed ? SampleType::kI8 : SampleType::kU8;
    case 16:
      return facts.is_signed ? SampleType::kI16 : SampleType::kU16;
    default:
      return facts.is_signed ? SampleType::kI32 : SampleType::kU32;
  }
}

void PutNumber(std::string* out, uint64_t value, size_t bytes) {
  for (size_t i = 0; i < bytes; ++i) *out += static_cast<char>(value >> 8 * i);
}

// Appends an element in the encoding that every reader accepts.
void PutElement(std::string* out, uint32_t tag, absl::string_view kind, std::string value) {
  if (value.size() % 2 == 1) value += kind == "UI" ? '\0' : ' ';
  PutNumber(out, tag >> 16, 2);
  PutNumber(out, tag & 0xffff, 2);
  absl::StrAppend(out, kind);
  PutNumber(out, value.size(), 2);
  *out += value;
}

void PutShort(std::string* out, uint32_t tag, uint64_t value) {
  std::string bytes;
  PutNumber(&bytes, value, 2);
  PutElement(out, tag, "US", std::move(bytes));
}

// The library terminates the program (by its assertions) at malformed elements. So it gets a file
// that we build ourselves, which contains only what the pixels need, and the compressed fragments.
std::string Rewritten(const SourceFile& file, const DicomFacts& facts) {
  std::string meta;
  PutElement(&meta, 0x00020002, "UI", "1.2.840.10008.5.1.4.1.1.7");
  PutElement(&meta, 0x00020003, "UI", "1.2.3");
  PutElement(&meta, 0x00020010, "UI", facts.transfer_syntax);
  std::string out, size;
  out.resize(128);
  out += "DICM";
  PutNumber(&size, meta.size(), 4);
  PutElement(&out, 0x00020000, "UL", size);
  out += meta;
  PutElement(&out, 0x00080016, "UI", "1.2.840.10008.5.1.4.1.1.7");
  PutElement(&out, 0x00080018, "UI", "1.2.3");
  const bool colors = facts.samples_per_pixel == 3;
  PutShort(&out, 0x00280002, facts.samples_per_pixel);
  PutElement(&out, 0x00280004, "CS", colors ? facts.photometric : "MONOCHROME2");
  if (colors) PutShort(&out, 0x00280006, facts.planar ? 1 : 0);
  PutElement(&out, 0x00280008, "IS", absl::StrCat(facts.frames));
  PutShort(&out, 0x00280010, facts.rows);
  PutShort(&out, 0x00280011, facts.columns);
  PutShort(&out, 0x00280100, facts.bits_allocated);
  PutShort(&out, 0x00280101, facts.bits_stored);
  PutShort(&out, 0x00280102, facts.high_bit);
  PutShort(&out, 0x00280103, facts.is_signed ? 1 : 0);
  out += std::string("\xe0\x7f\x10\x00OB\0\0\xff\xff\xff\xff", 12);
  for (size_t i = 0; i < facts.pixels.size(); ++i) {
    // The table of offsets is left empty because nothing here needs it.
    const auto [at, length] = i == 0 ? std::pair<size_t, size_t>(0, 0) : facts.pixels[i];
    out += std::string("\xfe\xff\x00\xe0", 4);
    PutNumber(&out, length + length % 2, 4);
    out.append(file.bytes, at, length);
    if (length % 2 == 1) out += '\0';
  }
  return out + std::string("\xfe\xff\xdd\xe0\0\0\0\0", 8);
}

absl::StatusOr<std::string> Decompress(const SourceFile& file, const DicomFacts& facts,
                                       uint64_t wanted) {
  gdcm::Trace::DebugOff();
  gdcm::Trace::WarningOff();
  gdcm::Trace::ErrorOff();
  std::istringstream in(Rewritten(file, facts));
  gdcm::ImageReader reader;
  reader.SetStream(in);
  if (!reader.Read()) return Undecoded(file, "it is none that is known");
  const gdcm::Image& image = reader.GetImage();
  if (image.GetBufferLength() != wanted) {
    return Undecoded(file, absl::StrCat(image.GetBufferLength(), " bytes instead of ", wanted));
  }
  std::string pixels(wanted, '\0');
  if (!image.GetBuffer(pixels.data())) return Undecoded(file, "its pixels are not whole");
  if (facts.samples_per_pixel == 1) return pixels;
  // The remaining conversion, which the decoder did not do.
  return ToRgb(
      pixels, facts,
      {.planar = image.GetPlanarConfiguration() == 1,
       .ybr = absl::StartsWith(image.GetPhotometricInterpretation().GetString(), "YBR_FULL"),
       .halved = false,
       .big_endian = false});
}

// Returns the number of a table's first entry. It is signed if the pixels are.
int32_t FirstOf(const DicomFacts& facts, const DicomFacts::Palette& table) {
  const auto bits = static_cast<uint16_t>(table.descriptor[1]);
  return facts.is_signed ? static_cast<int16_t>(bits) : bits;
}

// Replaces numbers by the table entries with those numbers; numbers outside the table use its first or last entry.
void LookUp(const SourceFile& file, const DicomFacts& facts, const DicomFacts::Palette& table,
            float* begin, float* end) {
  const auto& [descriptor, entries] = table;
  const uint32_t count = descriptor[0] == 0 ? 65536 : descriptor[0];
  const bool wide = entries.second >= uint64_t{count} * 2;
  std::vector<float> values;
  DecodeSamples(absl::string_view(file.bytes).substr(entries.first, count * (wide ? 2 : 1)),
                {.type = wide ? SampleType::kU16 : SampleType::kU8, .big_endian = facts.big_endian},
                &values);
  const double first = FirstOf(facts, table), last = static_cast<double>(values.size() - 1);
  for (float* at = begin; at != end; ++at)
    *at = values[static_cast<size_t>(std::clamp(double{*at} - first, 0.0, last))];
}

// Three bytes a pixel of places in a palette.
std::string FromPalette(const SourceFile& file, const DicomFacts& facts,
                        const std::vector<float>& places) {
  std::array<std::vector<uint8_t>, 3> tables;
  for (size_t k = 0; k < 3; ++k) {
    const auto& [descriptor, entries] = facts.palette[k];
    const uint64_t count = descriptor[0] == 0 ? 65536 : descriptor[0];
    const bool wide = entries.second >= count * 2;
    for (uint64_t i = 0; i < count; ++i) {
      // 16-bit entries use the upper 8 bits; 8-bit entries in 16 bits of space use the lower ones.
      const size_t high = facts.big_endian ? 0 : 1;
      const size_t at = !wide ? i : i * 2 + (descriptor[2] == 16 ? high : 1 - high);
      tables[k].push_back(static_cast<uint8_t>(file.bytes[entries.first + at]));
    }
  }
  std::string out;
  out.reserve(places.size() * 3);
  for (const float place : places) {
    for (size_t k = 0; k < 3; ++k) {
      const int32_t first = FirstOf(facts, facts.palette[k]);
      const double at =
          std::clamp(double{place} - first, 0.0, static_cast<double>(tables[k].size() - 1));
      out += static_cast<char>(tables[k][static_cast<size_t>(at)]);
    }
  }
  return out;
}

// Decodes bits, starting with the lowest bit of the first byte.
void DecodeBits(absl::string_view bytes, uint64_t count, std::vector<float>* out) {
  out->reserve(out->size() + count);
  for (uint64_t i = 0; i < count; ++i)
    out->push_back(static_cast<float>(static_cast<uint8_t>(bytes[i / 8]) >> i % 8 & 1));
}

// Returns a frame's own text, or the shared one.
const std::string& OfFrame(const DicomFacts& facts, size_t frame,
                           const std::vector<std::string>& each, const std::string& all) {
  return each.size() == facts.frames ? each[frame] : all;
}

absl::Status Decode(const SourceFile& file, const DicomFacts& facts, SampledVolume* volume) {
  const uint64_t pixels = facts.columns * facts.rows * facts.frames;
  const bool colors = facts.samples_per_pixel == 3;
  const absl::string_view whole = file.bytes;
  if (facts.bits_allocated == 1) {
    DecodeBits(whole.substr(facts.pixels[0].first), pixels, &volume->samples);
    return absl::OkStatus();
  }
  SampleCode code{.type = TypeOf(facts),
                  .big_endian = facts.big_endian && !facts.compressed,
                  .spare_bits = facts.bits_allocated - facts.bits_stored};
  std::string decoded;
  absl::string_view bytes = whole.substr(facts.compressed ? 0 : facts.pixels[0].first);
  if (facts.compressed) {
    const uint64_t wanted = pixels * facts.samples_per_pixel * SampleBytes(code.type);
    absl::StatusOr<std::string> out = Decompress(file, facts, wanted);
    if (!out.ok()) return out.status();
    decoded = *std::move(out);
    bytes = decoded;
  } else if (colors) {
    decoded = ToRgb(bytes, facts,
                    {.planar = facts.planar,
                     .ybr = facts.photometric != "RGB",
                     .halved = facts.photometric == "YBR_FULL_422",
                     .big_endian = facts.big_endian});
    bytes = decoded;
  }
  if (colors) {
    DecodeColors(bytes, 3, volume);
    return absl::OkStatus();
  }
  bytes = bytes.substr(0, pixels * SampleBytes(code.type));
  if (!IsGrey(facts)) {
    std::vector<float> places;
    DecodeSamples(bytes, code, &places);
    DecodeColors(FromPalette(file, facts, places), 3, volume);
    return absl::OkStatus();
  }
  const size_t frame = bytes.size() / facts.frames;
  for (size_t i = 0; i < facts.frames; ++i) {
    const std::vector<double> slope = DicomNumbers(OfFrame(facts, i, facts.slopes, facts.slope)),
                              intercept = DicomNumbers(
                                  OfFrame(facts, i, facts.intercepts, facts.intercept));
    code.slope = !slope.empty() && slope[0] != 0 ? slope[0] : 1;
    code.intercept = !intercept.empty() ? intercept[0] : 0;
    if (!facts.modality.descriptor.empty()) code.slope = 1, code.intercept = 0;
    DecodeSamples(bytes.substr(i * frame, frame), code, &volume->samples);
  }
  if (!facts.modality.descriptor.empty()) {
    float* const end = volume->samples.data() + volume->samples.size();
    LookUp(file, facts, facts.modality, end - pixels, end);
  }
  return absl::OkStatus();
}

}  // namespace

absl::Status DecodeDicomPixels(const SourceFile& file, const DicomFacts& facts,
                               SampledVolume* volume) {
  try {
    return Decode(file, facts, volume);
  } catch (const std::exception& error) {
    return Undecoded(file, error.what());
  }
}

}  // namespace voxeld::voxelctl
