#include "tools/voxelctl/text/table.h"

#include <algorithm>
#include <iterator>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/string_view.h"
#include "common/text/printable.h"

namespace voxeld::voxelctl {
namespace {

constexpr absl::string_view kGap = "  ";

// Counts code points, which are a terminal's columns in the scripts in which names are mostly
// written.
size_t Width(absl::string_view text) {
  return static_cast<size_t>(
      std::count_if(text.begin(), text.end(), [](char c) { return (c & 0xc0) != 0x80; }));
}

}  // namespace

void Table::Add(std::vector<std::string> cells) {
  cells.resize(columns_.size());
  for (std::string& cell : cells) cell = EscapeForTerminal(cell);
  rows_.push_back(std::move(cells));
}

std::string Table::Text() const {
  std::vector<size_t> widths;
  for (size_t c = 0; c < columns_.size(); ++c) {
    size_t width = Width(columns_[c].heading);
    for (const std::vector<std::string>& row : rows_) width = std::max(width, Width(row[c]));
    widths.push_back(width);
  }
  std::string text;
  const auto add_row = [&](const auto& cell) {
    std::string line;
    for (size_t c = 0; c < columns_.size(); ++c) {
      const std::string& value = cell(c);
      const std::string pad(widths[c] - Width(value), ' ');
      absl::StrAppend(&line, c == 0 ? "" : kGap);
      absl::StrAppend(&line, columns_[c].align == Align::kRight ? pad : "", value,
                      columns_[c].align == Align::kLeft ? pad : "");
    }
    line.erase(line.find_last_not_of(' ') + 1);
    absl::StrAppend(&text, line, "\n");
  };
  add_row([&](size_t c) -> const std::string& { return columns_[c].heading; });
  for (const std::vector<std::string>& row : rows_) {
    add_row([&](size_t c) -> const std::string& { return row[c]; });
  }
  return text;
}

std::string Grouped(uint64_t value) {
  std::string digits = absl::StrCat(value);
  for (size_t at = digits.size(); at > 3;) {
    at -= 3;
    digits.insert(at, 1, ',');
  }
  return digits;
}

std::string Counted(uint64_t count, const std::string& one, const std::string& many) {
  if (count == 1) return absl::StrCat("1 ", one);
  return absl::StrCat(Grouped(count), " ", many.empty() ? absl::StrCat(one, "s") : many);
}

std::string Bytes(uint64_t value) {
  if (value < 1000) return absl::StrCat(value, " B");
  static constexpr absl::string_view kUnits[] = {"kB", "MB", "GB", "TB", "PB", "EB"};
  double scaled = static_cast<double>(value) / 1000;
  size_t unit = 0;
  for (; scaled >= 999.5 && unit + 1 < std::size(kUnits); ++unit) scaled /= 1000;
  return absl::StrFormat("%.*f %s",
                         scaled < 9.995   ? 2
                         : scaled < 99.95 ? 1
                                          : 0,
                         scaled, kUnits[unit]);
}

std::string Duration(int64_t nanoseconds) {
  if (nanoseconds <= 0) return "–";
  const double ns = static_cast<double>(nanoseconds);
  if (ns < 1e6) return absl::StrFormat("%.0f µs", ns / 1e3);
  if (ns < 1e9) return absl::StrFormat("%.2f ms", ns / 1e6);
  const int64_t seconds = nanoseconds / 1'000'000'000;
  if (seconds < 60) return absl::StrFormat("%.2f s", ns / 1e9);
  if (seconds < 3600) return absl::StrFormat("%d min %02d s", seconds / 60, seconds % 60);
  return absl::StrFormat("%d h %02d min", seconds / 3600, seconds / 60 % 60);
}

}  // namespace voxeld::voxelctl
