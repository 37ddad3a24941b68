#include "gpu/samples_check.h"

#include <cmath>

#include "absl/strings/str_cat.h"
#include "gpu/primitives/samples.h"
#include "gpu/samples_bricks.h"

namespace voxeld::gpu {

absl::Status CheckSamples(std::span<const uint32_t> words) {
  const auto wrong = [](const char* what, auto value, absl::string_view right) {
    return absl::InvalidArgumentError(
        absl::StrCat("samples.", what, " is ", value, ", must be ", right));
  };
  if (words.size() < kSampleHeadWords) {
    return wrong("words", words.size(), absl::StrCat(kSampleHeadWords, " at least"));
  }
  const SampleView view{words.data()};
  const SampleHead& head = view.head();
  uint64_t samples = 1;
  for (const uint32_t size : head.size) {
    if (size < 1 || size > SampleHead::kMostAlong) {
      return wrong("size", size, absl::StrCat("1 to ", SampleHead::kMostAlong));
    }
    samples *= size;
  }
  if (static_cast<uint32_t>(head.format) > 3) {
    return wrong("format", static_cast<uint32_t>(head.format), "0 to 3");
  }
  if (static_cast<uint32_t>(head.filter) > 1) {
    return wrong("filter", static_cast<uint32_t>(head.filter), "0 or 1");
  }
  if (head.by_level > 2) return wrong("by_level", head.by_level, "0 to 2");
  if (head.by_level != 0 && head.format == SampleFormat::kRgba8) {
    return wrong("by_level", head.by_level, "0 for colours");
  }
  if (!std::isfinite(head.low) || !std::isfinite(head.scale) || !std::isfinite(head.level)) {
    return wrong("low", static_cast<double>(head.low), "finite, as scale and level");
  }
  if (samples > (uint64_t{1} << 40)) return wrong("size", samples, "2⁴⁰ at most, in all");
  if (head.bricks != BrickWords(head.size)) {
    return wrong("bricks", head.bricks, absl::StrCat(BrickWords(head.size)));
  }
  const uint64_t expected = SampleWords(head.size, static_cast<uint32_t>(head.format));
  if (words.size() != expected) return wrong("words", words.size(), absl::StrCat(expected));
  return absl::OkStatus();
}

}  // namespace voxeld::gpu
