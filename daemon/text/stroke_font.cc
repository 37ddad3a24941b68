#include "daemon/text/stroke_font.h"

#include <algorithm>
#include <cstdlib>
#include <fstream>
#include <sstream>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "absl/strings/string_view.h"

namespace voxeld::text {
namespace {

constexpr const char* kFolder = "/usr/share/hershey-fonts";
// Capitals extend from 12 above the middle to the baseline, 9 below it.
constexpr float kBaseline = 9, kCapital = 21;
constexpr size_t kHead = 8;

}  // namespace

absl::StatusOr<StrokeFont> StrokeFont::Load(std::string_view name) {
  const std::string path =
      absl::StrCat(kFolder, "/", absl::string_view(name.data(), name.size()), ".jhf");
  const bool word =
      !name.empty() && name.size() < 64 && std::all_of(name.begin(), name.end(), [](char c) {
        return absl::ascii_isalnum(static_cast<unsigned char>(c)) || c == '_';
      });
  if (!word) return absl::NotFoundError("is none: a stroke font's name is a word, as futural");
  std::ifstream file(path);
  if (!file) {
    return absl::NotFoundError(
        absl::StrCat("is none: there is no ", path, "; the package hershey-fonts-data has some"));
  }
  std::ostringstream whole;
  whole << file.rdbuf();
  return Parse(whole.str());
}

absl::StatusOr<StrokeFont> StrokeFont::Parse(std::string_view jhf) {
  StrokeFont font;
  std::string line;
  size_t number = 0;
  // A glyph may continue on further lines until it has all its pairs.
  for (const absl::string_view part :
       absl::StrSplit(absl::string_view(jhf.data(), jhf.size()), '\n')) {
    ++number;
    if (line.empty() && part.empty()) continue;
    absl::StrAppend(&line, part);
    int pairs = 0;
    if (line.size() < kHead || !absl::SimpleAtoi(absl::string_view(line).substr(5, 3), &pairs) ||
        pairs < 1) {
      return absl::InvalidArgumentError(
          absl::StrCat("line ", number, ": no glyph begins with \"", line.substr(0, kHead), "\""));
    }
    if (line.size() < kHead + 2 * static_cast<size_t>(pairs)) continue;
    const auto at = [&](size_t i) { return static_cast<float>(line[kHead + i] - 'R'); };
    Glyph glyph{at(0), at(1), {}};
    Stroke stroke;
    const auto lift = [&] {
      if (stroke.size() > 1) glyph.strokes.push_back(stroke);
      stroke.clear();
    };
    for (size_t pair = 1; pair < static_cast<size_t>(pairs); ++pair) {
      if (line.compare(kHead + 2 * pair, 2, " R") == 0) {
        lift();
      } else {
        stroke.push_back({at(2 * pair), kBaseline - at(2 * pair + 1)});
      }
    }
    lift();
    font.glyphs_.push_back(std::move(glyph));
    line.clear();
  }
  if (!line.empty() || font.glyphs_.empty()) {
    return absl::InvalidArgumentError(
        absl::StrCat("line ", number, ": the file ends within a glyph"));
  }
  return font;
}

StrokeFont::Line StrokeFont::Lay(std::string_view ascii) const {
  Line line;
  for (const char c : ascii) {
    const auto of = [](char letter) {
      return static_cast<size_t>(static_cast<unsigned char>(letter)) - ' ';
    };
    size_t index = of(c);
    if (index >= glyphs_.size()) index = of('?');
    if (index >= glyphs_.size()) continue;
    const Glyph& glyph = glyphs_[index];
    for (const Stroke& stroke : glyph.strokes) {
      Stroke& placed = line.strokes.emplace_back();
      for (const StrokePoint& p : stroke) {
        placed.push_back({line.width + (p.x - glyph.left) / kCapital, p.y / kCapital});
      }
    }
    line.width += (glyph.right - glyph.left) / kCapital;
  }
  return line;
}

}  // namespace voxeld::text
