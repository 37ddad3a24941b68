#include "daemon/colormaps/colormaps.h"

#include <algorithm>
#include <charconv>

#include "colormaps_text.h"  // kColormapsText, generated from the file
#include "common/text/suggest.h"

namespace voxeld {
namespace {

// Returns the text up to `separator`, and removes both from `text`.
std::string_view Take(std::string_view& text, char separator) {
  const size_t end = std::min(text.find(separator), text.size());
  const std::string_view taken = text.substr(0, end);
  text.remove_prefix(std::min(end + 1, text.size()));
  return taken;
}

// Calls f(name, colours) for each map until it returns true.
template <typename F>
void ForEachMap(F&& f) {
  std::string_view text = kColormapsText;
  while (!text.empty()) {
    std::string_view line = Take(text, '\n');
    if (line.empty() || line.front() == '#') continue;
    const std::string_view name = Take(line, ' ');
    if (f(name, line)) return;
  }
}

// "viridis_r" is viridis reversed.
constexpr std::string_view kReversed = "_r";

std::string_view WithoutReversed(std::string_view name) {
  return name.ends_with(kReversed) ? name.substr(0, name.size() - kReversed.size()) : name;
}

}  // namespace

std::optional<ColorTable> FindColormap(std::string_view name) {
  if (const std::string_view plain = WithoutReversed(name);
      plain != name && !plain.ends_with(kReversed)) {
    std::optional<ColorTable> table = FindColormap(plain);
    if (table.has_value()) std::reverse(table->begin(), table->end());
    return table;
  }
  std::vector<uint32_t> stops;
  ForEachMap([&](std::string_view found, std::string_view colors) {
    if (found != name) return false;
    while (!colors.empty()) {
      const std::string_view color = Take(colors, ' ');
      uint32_t rgb = 0;
      std::from_chars(color.data(), color.data() + color.size(), rgb, 16);
      stops.push_back(rgb);
    }
    return true;
  });
  if (stops.empty()) return std::nullopt;
  // Interpolate in integers: a segment has 255 parts.
  ColorTable table;
  const uint32_t last = static_cast<uint32_t>(stops.size() - 1);
  for (uint32_t i = 0; i < table.size(); ++i) {
    const uint32_t at = i * last / 255, rest = i * last % 255;
    const uint32_t a = stops[at], b = stops[std::min(at + 1, last)];
    table[i] = 0;
    for (uint32_t shift = 0; shift < 24; shift += 8) {
      const uint32_t mixed =
          ((a >> shift & 255) * (255 - rest) + (b >> shift & 255) * rest + 127) / 255;
      table[i] |= mixed << shift;
    }
  }
  return table;
}

std::vector<std::string> ColormapNames() {
  std::vector<std::string> names;
  ForEachMap([&](std::string_view name, std::string_view) {
    names.emplace_back(name);
    return false;
  });
  return names;
}

std::string ColormapAdvice(std::string_view wrong) {
  const std::vector<std::string> names = ColormapNames();
  std::string near = Nearest(WithoutReversed(wrong), names);
  if (!near.empty()) {
    if (wrong.ends_with(kReversed)) near += kReversed;
    return "did you mean \"" + near + "\"?";
  }
  std::string all;
  for (const std::string& name : names) all += (all.empty() ? "" : ", ") + name;
  return "there are " + all + ", each also turned round, as viridis_r";
}

}  // namespace voxeld
