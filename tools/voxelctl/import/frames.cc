#include "tools/voxelctl/import/frames.h"

#include <algorithm>
#include <filesystem>
#include <optional>
#include <system_error>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/string_view.h"
#include "absl/strings/strip.h"
#include "tools/voxelctl/import/importer.h"

namespace voxeld::voxelctl {
namespace {

constexpr size_t kMostDigits = 12;

// A file name with a place for a number.
struct Pattern {
  std::string before, after;
  size_t digits = 1;
};

std::optional<Pattern> ParsePattern(const std::string& name) {
  const size_t hash = name.find('#');
  if (hash != std::string::npos) {
    const size_t end = std::min(name.find_first_not_of('#', hash), name.size());
    if (end - hash > kMostDigits) return std::nullopt;
    return Pattern{name.substr(0, hash), name.substr(end), end - hash};
  }
  const size_t percent = name.find('%');
  if (percent == std::string::npos) return std::nullopt;
  const size_t d = name.find_first_not_of("0123456789", percent + 1);
  if (d == std::string::npos || name[d] != 'd') return std::nullopt;
  Pattern pattern{name.substr(0, percent), name.substr(d + 1)};
  const std::string width = name.substr(percent + 1, d - percent - 1);
  if (!width.empty() && (width[0] != '0' || !absl::SimpleAtoi(width, &pattern.digits) ||
                         pattern.digits > kMostDigits)) {
    return std::nullopt;
  }
  pattern.digits = std::max<size_t>(pattern.digits, 1);
  return pattern;
}

std::optional<uint64_t> NumberOf(const Pattern& pattern, absl::string_view name) {
  if (!absl::ConsumePrefix(&name, pattern.before) || !absl::ConsumeSuffix(&name, pattern.after))
    return std::nullopt;
  if (name.size() < pattern.digits || name.size() > kMostDigits ||
      (name.size() > pattern.digits && name[0] == '0')) {
    return std::nullopt;
  }
  uint64_t number = 0;
  if (!std::all_of(name.begin(), name.end(), absl::ascii_isdigit) ||
      !absl::SimpleAtoi(name, &number))
    return std::nullopt;
  return number;
}

}  // namespace

absl::StatusOr<Model> FileFrames::Read(int64_t frame) {
  return ImportFile(paths_[static_cast<size_t>(frame)], options_, interrupt_);
}

bool IsSequence(const std::string& path) {
  std::error_code ignored;
  return ParsePattern(std::filesystem::path(path).filename().string()).has_value() &&
         !std::filesystem::exists(path, ignored);
}

absl::StatusOr<std::vector<std::string>> FindSequence(const std::string& path) {
  const std::filesystem::path whole(path);
  const std::optional<Pattern> pattern = ParsePattern(whole.filename().string());
  if (!pattern) {
    return absl::InvalidArgumentError(absl::StrCat(
        path, ": its name has no place for a number; one such as #### or %04d is expected"));
  }
  const std::filesystem::path folder = whole.has_parent_path() ? whole.parent_path() : ".";
  std::vector<std::pair<uint64_t, std::string>> found;
  std::error_code error;
  for (std::filesystem::directory_iterator at(folder, error), end; !error && at != end;
       at.increment(error)) {
    const std::string name = at->path().filename().string();
    const std::optional<uint64_t> number = NumberOf(*pattern, name);
    if (!number) continue;
    if (found.size() >= static_cast<size_t>(kMaxFrames)) {
      return absl::InvalidArgumentError(absl::StrCat(path, ": there are more than ",
                                                     static_cast<size_t>(kMaxFrames),
                                                     " such files; take a part of them"));
    }
    found.emplace_back(*number, whole.has_parent_path() ? (folder / name).string() : name);
  }
  if (error) return absl::NotFoundError(absl::StrCat(folder.string(), ": ", error.message()));
  if (found.empty()) {
    return absl::NotFoundError(absl::StrCat(path, ": there is no such file; names with ",
                                            pattern->digits, " digits are looked for"));
  }
  std::sort(found.begin(), found.end());
  std::vector<std::string> paths;
  paths.reserve(found.size());
  for (auto& [number, name] : found) paths.push_back(std::move(name));
  return paths;
}

void FrameAhead::Ask(int64_t frame) {
  next_ = std::async(std::launch::async, [this, frame] { return source_.Read(frame); });
}

}  // namespace voxeld::voxelctl
