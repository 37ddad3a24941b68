#include "tools/import/volume_samples.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <string>
#include <type_traits>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "common/text/printable.h"

namespace voxeld::voxelctl {
namespace {

static_assert(std::endian::native == std::endian::little);

constexpr uint64_t kMostAlong = 65536;
constexpr size_t kColorsAtOnce = 65536;  // colours that are converted through numbers at a time
constexpr double kLeastSlab = 0.05;      // share of a volume's greatest length

// Reserves space for `more` values. The capacity grows in proportion to the size, because samples
// come a slice or a row at a time.
template <typename T>
void MakeRoom(size_t more, std::vector<T>* values) {
  if (values->capacity() - values->size() >= more) return;
  values->reserve(values->empty() ? more : std::max(values->size() + more, 2 * values->size()));
}

// A float of 16 bits (IEEE 754 binary16).
struct Half {
  uint16_t bits = 0;
  explicit operator double() const {
    const int exponent = bits >> 10 & 31, fraction = bits & 1023;
    const double size = exponent == 0    ? std::ldexp(fraction, -24)
                        : exponent == 31 ? std::numeric_limits<double>::quiet_NaN()
                                         : std::ldexp(1024 + fraction, exponent - 25);
    return bits >> 15 != 0 ? -size : size;
  }
};

template <typename T>
T NumberAt(const char* bytes, bool big_endian) {
  char raw[sizeof(T)];
  std::memcpy(raw, bytes, sizeof(T));
  if (big_endian) std::reverse(raw, raw + sizeof(T));
  T value;
  std::memcpy(&value, raw, sizeof(T));
  return value;
}

float FiniteOrNot(float number) {
  return std::isfinite(number) ? number : std::numeric_limits<float>::quiet_NaN();
}

template <typename T>
void Decode(absl::string_view bytes, const SampleCode& code, std::vector<float>* out) {
  const size_t count = bytes.size() / sizeof(T), before = out->size();
  MakeRoom(count, out);
  out->resize(before + count);
  float* const numbers = out->data() + before;
  const char* const from = bytes.data();
  // The fast path for most files, which take most of the time if they are large.
  if constexpr (std::is_integral_v<T>) {
    if (!code.big_endian && code.spare_bits == 0 && code.slope == 1 && code.intercept == 0) {
      for (size_t i = 0; i < count; ++i)
        numbers[i] = static_cast<float>(NumberAt<T>(from + i * sizeof(T), false));
      return;
    }
  }
  for (size_t i = 0; i < count; ++i) {
    T value = NumberAt<T>(from + i * sizeof(T), code.big_endian);
    if constexpr (std::is_integral_v<T>) {
      // Shifting right copies the sign bit if T is signed.
      value = static_cast<T>(
          static_cast<T>(static_cast<std::make_unsigned_t<T>>(value) << code.spare_bits) >>
          code.spare_bits);
    }
    numbers[i] =
        FiniteOrNot(static_cast<float>(static_cast<double>(value) * code.slope + code.intercept));
  }
}

// Returns the maximum of a colour channel of this type.
double GreatestOf(SampleType type) {
  switch (type) {
    case SampleType::kI8:
      return std::numeric_limits<int8_t>::max();
    case SampleType::kU8:
      return std::numeric_limits<uint8_t>::max();
    case SampleType::kI16:
      return std::numeric_limits<int16_t>::max();
    case SampleType::kU16:
      return std::numeric_limits<uint16_t>::max();
    case SampleType::kI32:
      return std::numeric_limits<int32_t>::max();
    case SampleType::kU32:
      return std::numeric_limits<uint32_t>::max();
    case SampleType::kI64:
      return static_cast<double>(std::numeric_limits<int64_t>::max());
    case SampleType::kU64:
      return static_cast<double>(std::numeric_limits<uint64_t>::max());
    case SampleType::kF16:
    case SampleType::kF32:
    case SampleType::kF64:
      return 1;
  }
  return 1;
}

}  // namespace

size_t SampleBytes(SampleType type) {
  switch (type) {
    case SampleType::kI8:
    case SampleType::kU8:
      return 1;
    case SampleType::kI16:
    case SampleType::kU16:
    case SampleType::kF16:
      return 2;
    case SampleType::kI32:
    case SampleType::kU32:
    case SampleType::kF32:
      return 4;
    case SampleType::kI64:
    case SampleType::kU64:
    case SampleType::kF64:
      return 8;
  }
  return 1;
}

absl::Status CheckVolumeSize(const SourceFile& file, const std::array<uint64_t, 3>& size) {
  uint64_t samples = 1;
  for (const uint64_t along : size) {
    if (along < 1 || along > kMostAlong) {
      return FileError(file, absl::StrCat("has ", along, " samples along an axis"),
                       absl::StrCat("1 to ", kMostAlong, " are expected"));
    }
    samples *= along;
  }
  if (samples <= kMaxModelSamples) return absl::OkStatus();
  return FileError(file,
                   absl::StrCat("has ", size[0], " by ", size[1], " by ", size[2], " samples"),
                   absl::StrCat("at most ", kMaxModelSamples, " in all are read"));
}

void DecodeSamples(absl::string_view bytes, const SampleCode& code, std::vector<float>* out) {
  switch (code.type) {
    case SampleType::kI8:
      return Decode<int8_t>(bytes, code, out);
    case SampleType::kU8:
      return Decode<uint8_t>(bytes, code, out);
    case SampleType::kI16:
      return Decode<int16_t>(bytes, code, out);
    case SampleType::kU16:
      return Decode<uint16_t>(bytes, code, out);
    case SampleType::kI32:
      return Decode<int32_t>(bytes, code, out);
    case SampleType::kU32:
      return Decode<uint32_t>(bytes, code, out);
    case SampleType::kI64:
      return Decode<int64_t>(bytes, code, out);
    case SampleType::kU64:
      return Decode<uint64_t>(bytes, code, out);
    case SampleType::kF16:
      return Decode<Half>(bytes, code, out);
    case SampleType::kF32:
      return Decode<float>(bytes, code, out);
    case SampleType::kF64:
      return Decode<double>(bytes, code, out);
  }
}

void DecodeColors(absl::string_view bytes, size_t bytes_each, SampledVolume* volume) {
  const size_t count = bytes.size() / bytes_each;
  MakeRoom(count, &volume->colors);
  MakeRoom(count, &volume->samples);
  for (size_t i = 0; i < count; ++i) {
    const auto at = [&](size_t k) { return static_cast<uint8_t>(bytes[i * bytes_each + k]); };
    const int alpha = bytes_each == 4 ? at(3) : 255;
    const auto channel = [&](size_t k) { return static_cast<uint8_t>(at(k) * alpha / 255); };
    const Rgb color = {channel(0), channel(1), channel(2)};
    volume->colors.push_back(color);
    volume->samples.push_back(
        static_cast<float>(0.299 * color.r + 0.587 * color.g + 0.114 * color.b));
  }
}

void DecodeColors(absl::string_view bytes, const SampleCode& code, size_t channels,
                  SampledVolume* volume) {
  if (code.type == SampleType::kU8 && code.slope == 1 && code.intercept == 0)
    return DecodeColors(bytes, channels, volume);
  const size_t step = channels * SampleBytes(code.type) * kColorsAtOnce;
  std::vector<float> numbers;
  for (size_t at = 0; at < bytes.size(); at += step) {
    numbers.clear();
    DecodeSamples(bytes.substr(at, step), code, &numbers);
    ColorsOf(numbers, code.type, channels, volume);
  }
}

void ColorsOf(std::span<const float> numbers, SampleType type, size_t channels,
              SampledVolume* volume) {
  const double most = GreatestOf(type);
  std::string colors;
  for (size_t at = 0; at < numbers.size(); at += channels * kColorsAtOnce) {
    colors.clear();
    for (const float number :
         numbers.subspan(at, std::min(channels * kColorsAtOnce, numbers.size() - at))) {
      const double part = std::isfinite(number) ? std::clamp(number / most, 0.0, 1.0) : 0;
      colors += static_cast<char>(std::lround(part * 255));
    }
    DecodeColors(colors, channels, volume);
  }
}

std::string Interleaved(absl::string_view bytes, size_t planes, size_t bytes_each) {
  const size_t plane = bytes.size() / planes;
  std::string out;
  out.reserve(bytes.size());
  for (size_t at = 0; at < plane; at += bytes_each) {
    for (size_t k = 0; k < planes; ++k)
      absl::StrAppend(&out, bytes.substr(k * plane + at, bytes_each));
  }
  return out;
}

absl::Status ReadTextSamples(const SourceFile& file, absl::string_view text, uint64_t count,
                             const SampleCode& code, std::vector<float>* out) {
  for (uint64_t i = 0; i < count; ++i) {
    text.remove_prefix(std::min(text.find_first_not_of(" \t\r\n,"), text.size()));
    if (text.empty()) {
      return FileError(file, absl::StrCat("has ", i, " samples of ", count),
                       "the file is truncated");
    }
    const absl::string_view word = text.substr(0, text.find_first_of(" \t\r\n,"));
    double value = 0;
    if (!absl::SimpleAtod(word, &value)) {
      return FileError(
          file, absl::StrCat("sample ", i, " is \"", EscapeForTerminal(word.substr(0, 40)), "\""),
          "a number is expected");
    }
    const auto number = static_cast<float>(value * code.slope + code.intercept);
    out->push_back(std::isfinite(number) ? number : std::numeric_limits<float>::quiet_NaN());
    text.remove_prefix(word.size());
  }
  return absl::OkStatus();
}

absl::StatusOr<absl::string_view> TakeSamples(const SourceFile& file, absl::string_view all,
                                              uint64_t from, uint64_t count, uint64_t bytes_each) {
  const uint64_t there = all.size() - std::min<uint64_t>(from, all.size());
  const uint64_t bytes = count * bytes_each;
  if (there >= bytes) return all.substr(from, bytes);
  return FileError(file,
                   absl::StrCat("has ", there, " bytes of samples; ", count, " of ", bytes_each,
                                " bytes take ", bytes),
                   "the file is truncated");
}

void KeepFirstOfEach(size_t each, std::vector<float>* samples) {
  if (each == 1) return;
  for (size_t i = 0; i * each < samples->size(); ++i) (*samples)[i] = (*samples)[i * each];
  samples->resize(samples->size() / each);
}

absl::Status PlaceVolume(const SourceFile& file, const Point3& first,
                         const std::array<Point3, 3>& steps, SampledVolume* volume) {
  const auto& [a, b, c] = steps;
  const double spans =
      a.x * (b.y * c.z - b.z * c.y) + a.y * (b.z * c.x - b.x * c.z) + a.z * (b.x * c.y - b.y * c.x);
  const double lengths =
      std::hypot(a.x, a.y, a.z) * std::hypot(b.x, b.y, b.z) * std::hypot(c.x, c.y, c.z);
  if (!(std::abs(spans) > 1e-6 * lengths) || !std::isfinite(lengths) ||
      !std::isfinite(first.x + first.y + first.z)) {
    return FileError(file,
                     absl::StrCat("its axes are (", a.x, ", ", a.y, ", ", a.z, "), (", b.x, ", ",
                                  b.y, ", ", b.z, ") and (", c.x, ", ", c.y, ", ", c.z, ")"),
                     "three directions that span a volume are expected");
  }
  std::array<double, 3> lengths_of;
  for (size_t axis = 0; axis < 3; ++axis) {
    lengths_of[axis] = std::hypot(steps[axis].x, steps[axis].y, steps[axis].z) * volume->size[axis];
  }
  const double longest = *std::max_element(lengths_of.begin(), lengths_of.end());
  for (size_t corner = 0; corner < 8; ++corner) {
    Point3 at = first;
    for (size_t axis = 0; axis < 3; ++axis) {
      const double middle = (volume->size[axis] - 1) / 2.0;
      const double half =
          volume->size[axis] / 2.0 * std::max(1.0, kLeastSlab * longest / lengths_of[axis]);
      const double along = (corner >> axis & 1) != 0 ? middle + half : middle - half;
      at.x += steps[axis].x * along;
      at.y += steps[axis].y * along;
      at.z += steps[axis].z * along;
    }
    if (!std::isfinite(at.x) || !std::isfinite(at.y) || !std::isfinite(at.z)) {
      return FileError(file,
                       absl::StrCat("has a corner at (", at.x, ", ", at.y, ", ", at.z,
                                    "), by steps of (", a.x, ", ", a.y, ", ", a.z, "), (", b.x,
                                    ", ", b.y, ", ", b.z, ") and (", c.x, ", ", c.y, ", ", c.z,
                                    ") from (", first.x, ", ", first.y, ", ", first.z, ")"),
                       "corners at finite places are expected");
    }
    volume->corners[corner] = at;
  }
  return absl::OkStatus();
}

}  // namespace voxeld::voxelctl
