#include "tools/voxelctl/import/text_points.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <optional>
#include <utility>
#include <vector>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/string_view.h"
#include "common/text/printable.h"
#include "tools/voxelctl/import/point_table.h"

namespace voxeld::voxelctl {
namespace {

using Columns = std::vector<std::optional<PointColumn>>;
constexpr size_t kMostColumns = 256;

// Lines without their ends, comments and blanks around.
class Lines {
 public:
  explicit Lines(absl::string_view text) : rest_(text) {
    absl::string_view bom = "\xef\xbb\xbf";
    if (absl::StartsWith(rest_, bom)) rest_.remove_prefix(bom.size());
  }

  // False at the end. Empty ones are passed over.
  bool Next(absl::string_view* line) {
    while (!rest_.empty()) {
      ++number_;
      const size_t end = std::min(rest_.find('\n'), rest_.size());
      absl::string_view all = rest_.substr(0, end);
      rest_.remove_prefix(std::min(end + 1, rest_.size()));
      all = all.substr(0, all.find('#'));
      all = all.substr(0, all.find("//"));
      *line = absl::StripAsciiWhitespace(all);
      if (!line->empty()) return true;
    }
    return false;
  }
  size_t number() const { return number_; }

 private:
  absl::string_view rest_;
  size_t number_ = 0;
};

// Blanks part words, and so does one comma, semicolon or tab, between which there may be nothing.
std::vector<absl::string_view> Split(absl::string_view line) {
  const bool marked = line.find_first_of(",;") != absl::string_view::npos;
  const absl::string_view marks = marked ? ",;" : " \t";
  std::vector<absl::string_view> words;
  while (words.size() < kMostColumns) {
    if (!marked) {
      line = absl::StripLeadingAsciiWhitespace(line);
      if (line.empty()) break;
    }
    const size_t end = line.find_first_of(marks);
    words.push_back(absl::StripAsciiWhitespace(line.substr(0, end)));
    if (end == absl::string_view::npos) break;
    line.remove_prefix(end + 1);
  }
  return words;
}

std::optional<double> Number(absl::string_view word) {
  if (absl::StartsWith(word, "+")) word.remove_prefix(1);
  double value = 0;
  const auto result = std::from_chars(word.data(), word.data() + word.size(), value);
  if (result.ec != std::errc() || result.ptr != word.data() + word.size()) return std::nullopt;
  return value;
}

bool IsNames(const std::vector<absl::string_view>& words) {
  return std::ranges::none_of(words,
                              [](absl::string_view word) { return Number(word).has_value(); });
}

// The greatest and least of the columns from the fourth on, over the whole file.
struct Ranges {
  double least[6] = {}, greatest[6] = {};
};

Ranges RangesOf(absl::string_view text, size_t columns) {
  Ranges out;
  Lines lines(text);
  absl::string_view line;
  while (lines.Next(&line)) {
    const auto words = Split(line);
    for (size_t c = 3; c < std::min({words.size(), columns, size_t{9}}); ++c) {
      const double value = Number(words[c]).value_or(0);
      out.least[c - 3] = std::min(out.least[c - 3], value);
      out.greatest[c - 3] = std::max(out.greatest[c - 3], value);
    }
  }
  return out;
}

Columns ByCount(size_t count, const Ranges& ranges) {
  using C = PointColumn;
  const Columns xyz = {C::kX, C::kY, C::kZ}, color = {C::kRed, C::kGreen, C::kBlue},
                normal = {C::kNormalX, C::kNormalY, C::kNormalZ};
  const auto with = [&xyz](const Columns& more, const Columns& and_more = {}) {
    Columns all = xyz;
    all.insert(all.end(), more.begin(), more.end());
    all.insert(all.end(), and_more.begin(), and_more.end());
    return all;
  };
  const double least = *std::min_element(ranges.least, ranges.least + 3),
               greatest = *std::max_element(ranges.greatest, ranges.greatest + 3);
  switch (count) {
    case 4:
    case 5:
      return with({C::kIntensity});
    case 6:
      return with(least < 0 && least >= -1 && greatest <= 1 ? normal : color);
    case 7:
      return with({C::kIntensity}, color);
    case 9:
      return with(color, normal);
    default:
      return count > 7 ? with(color) : xyz;
  }
}

double FullScale(absl::string_view text, const Columns& columns) {
  double greatest = 0;
  Lines lines(text);
  absl::string_view line;
  while (lines.Next(&line)) {
    const auto words = Split(line);
    for (size_t c = 0; c < std::min(words.size(), columns.size()); ++c) {
      const bool color = columns[c] == PointColumn::kRed || columns[c] == PointColumn::kGreen ||
                         columns[c] == PointColumn::kBlue;
      if (color) greatest = std::max(greatest, Number(words[c]).value_or(0));
    }
  }
  return greatest <= 1 ? 1 : greatest <= 255 ? 255 : 65535;
}

// What the columns are, having read the lines that are no points yet; the first point's line is in `first`.
absl::StatusOr<Columns> ReadHead(const SourceFile& file, Lines* lines, absl::string_view* first) {
  Columns columns;
  if (!lines->Next(first))
    return FileError(file, "holds no line of numbers", "x y z a line is expected");
  auto words = Split(*first);
  if (words.size() == 1 && Number(words[0]).has_value()) {  // a count
    if (!lines->Next(first))
      return FileError(file, "ends after a count", "x y z a line is expected");
    words = Split(*first);
  }
  if (IsNames(words)) {
    for (const absl::string_view word : words) {
      absl::string_view name = word;
      if (name.size() > 1 && name.front() == '"' && name.back() == '"')
        name = name.substr(1, name.size() - 2);
      const auto column = PointColumnOf(name);
      const bool twice = column.has_value() && std::ranges::find(columns, column) != columns.end();
      columns.push_back(twice ? std::nullopt : column);
    }
    if (!lines->Next(first))
      return FileError(file, "ends after its names", "x y z a line is expected");
    return columns;
  }
  if (words.size() < 3) {
    return FileError(file, absl::StrCat("line ", lines->number(), " is ", DescribeContents(*first)),
                     "three numbers or more a line are expected, or names of columns first");
  }
  return ByCount(words.size(), RangesOf(file.bytes, words.size()));
}

}  // namespace

absl::StatusOr<Model> ReadTextPoints(const SourceFile& file) {
  Lines lines(file.bytes);
  absl::string_view line;
  const absl::StatusOr<Columns> columns = ReadHead(file, &lines, &line);
  if (!columns.ok()) return columns.status();
  std::array<bool, kPointColumns> has = {};
  for (const auto& column : *columns) {
    if (column.has_value()) has[static_cast<size_t>(*column)] = true;
  }
  absl::StatusOr<PointTable> table = PointTable::Make(file, has, FullScale(file.bytes, *columns));
  if (!table.ok()) return table.status();
  do {
    const auto words = Split(line);
    PointRow row = {};
    for (size_t c = 0; c < columns->size(); ++c) {
      if (!(*columns)[c].has_value()) continue;
      const std::optional<double> value = c < words.size() ? Number(words[c]) : std::nullopt;
      if (!value.has_value()) {
        return FileError(
            file,
            absl::StrCat("line ", lines.number(), " has ",
                         c < words.size()
                             ? absl::StrCat("\"", EscapeForTerminal(words[c].substr(0, 24)), "\"")
                             : "nothing",
                         " in column ", c + 1),
            "a number is expected");
      }
      row[static_cast<size_t>(*(*columns)[c])] = *value;
    }
    if (absl::Status status = table->Add(file, row, absl::StrCat("line ", lines.number()));
        !status.ok()) {
      return status;
    }
  } while (lines.Next(&line));
  return std::move(*table).Finish(file, file.extension == "csv" ? "CSV points" : "XYZ points");
}

}  // namespace voxeld::voxelctl
