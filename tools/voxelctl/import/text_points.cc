#include "tools/voxelctl/import/text_points.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_split.h"
#include "absl/strings/string_view.h"
#include "common/text/printable.h"
#include "tools/voxelctl/import/point_table.h"

namespace voxeld::voxelctl {
namespace {

struct Column {
  std::optional<PointColumn> known;
  std::string name;  // as in the file; may be empty
  bool operator==(const Column&) const = default;
};
using Columns = std::vector<Column>;
constexpr size_t kMostColumns = 4096;

// Whether the word at the beginning of `text` is a colour such as #ff8000.
bool IsHexColor(absl::string_view text) {
  const size_t end = text.find_first_of(" \t,;");
  const absl::string_view digits = text.substr(0, end).substr(1);
  return text[0] == '#' &&
         (digits.size() == 3 || digits.size() == 4 || digits.size() == 6 || digits.size() == 8) &&
         std::ranges::all_of(
             digits, [](char c) { return absl::ascii_isxdigit(static_cast<unsigned char>(c)); });
}

// Where a comment begins, outside quotation marks: at the beginning of the line, or after a blank, but not where a word must follow. npos:
// there is none.
size_t CommentBegin(absl::string_view line) {
  bool quoted = false;
  char before = '\0';  // the last character that is no blank
  for (size_t i = 0; i < line.size(); ++i) {
    const char c = line[i];
    if (c == '"') quoted = !quoted;
    const bool is_after_blank = i == 0 || line[i - 1] == ' ' || line[i - 1] == '\t';
    if (!quoted && is_after_blank && before != ',' && before != ';' &&
        (c == '#' || line.substr(i, 2) == "//") && (i == 0 || !IsHexColor(line.substr(i)))) {
      return i;
    }
    if (c != ' ' && c != '\t') before = c;
  }
  return absl::string_view::npos;
}

using Words = std::vector<absl::string_view>;

// With a decimal point or a decimal comma.
std::optional<double> Number(absl::string_view word) {
  const std::optional<double> plain = NumberOfWord(word);
  const size_t comma = word.find(',');
  if (plain || comma == absl::string_view::npos || absl::StrContains(word, '.')) return plain;
  std::string with_point(word);
  with_point[comma] = '.';
  return NumberOfWord(with_point);
}

// Returns whether the word is one that tables use for a missing number.
bool IsMissing(absl::string_view word) {
  static constexpr absl::string_view kMissing[] = {"", "na", "n/a", "nan", "null", "none", "-"};
  return std::ranges::any_of(
      kMissing, [word](absl::string_view one) { return absl::EqualsIgnoreCase(word, one); });
}

// Splits words at a mark, which may follow another mark directly, or at blanks (' '). A word in
// quotation marks may contain the mark.
Words SplitAt(absl::string_view line, char mark) {
  Words words;
  words.reserve(9);
  while (words.size() < kMostColumns) {
    while (!line.empty() && (line[0] == ' ' || (line[0] == '\t' && mark != '\t'))) {
      line.remove_prefix(1);
    }
    if (mark == ' ' && line.empty()) break;
    size_t from = 0;
    absl::string_view word;
    // Two quotation marks in a quoted word stand for one.
    size_t close = absl::StartsWith(line, "\"") ? line.find('"', 1) : absl::string_view::npos;
    while (close != absl::string_view::npos && line.substr(close + 1, 1) == "\"")
      close = line.find('"', close + 2);
    const bool quoted = close != absl::string_view::npos;
    if (quoted) {
      word = line.substr(1, close - 1);
      from = close + 1;
    }
    const size_t end = mark == ' ' ? line.find_first_of(" \t", from) : line.find(mark, from);
    if (!quoted) word = line.substr(0, end);
    words.push_back(absl::StripAsciiWhitespace(word));
    if (end == absl::string_view::npos) break;
    line.remove_prefix(end + 1);
  }
  return words;
}

// Lines without their ends, comments and blanks around. A comment begins with "#" or "//".
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
      whole_ = absl::StripAsciiWhitespace(TakeLine(&rest_));
      const size_t begin = CommentBegin(whole_);
      *line = absl::StripAsciiWhitespace(whole_.substr(0, begin));
      if (!line->empty()) return true;
      if (begin == 0 && IsPointAfterAll()) {
        *line = whole_;
        return true;
      }
      if (begin == 0) {
        comment_ = absl::StripAsciiWhitespace(
            whole_.substr(std::min(whole_.find_first_not_of("#/"), whole_.size())));
      }
    }
    return false;
  }
  size_t number() const { return number_; }
  // The line with the comment at its end.
  absl::string_view whole() const { return whole_; }
  // The last line that was nothing but a comment.
  absl::string_view comment() const { return comment_; }
  // From now on lines are points in these columns.
  void Expect(PointColumns columns, char mark) {
    columns_ = std::move(columns);
    mark_ = mark;
  }
  // How many comments since then look like points whose first word begins with "#" or "//".
  uint64_t points_in_comments() const { return points_in_comments_; }

 private:
  // Whether a line that begins like a comment is a point whose first word is a colour such as #ff8000.
  bool IsPointAfterAll() {
    if (columns_.empty() || columns_[0]) return false;
    const Words words = SplitAt(whole_, mark_);
    bool is_point = words.size() == columns_.size();
    for (size_t c = 0; is_point && c < words.size(); ++c)
      is_point = !columns_[c] || Number(words[c]).has_value();
    if (!is_point) return false;
    if (words[0].size() >= 7 && IsHexColor(words[0])) return true;
    ++points_in_comments_;
    return false;
  }

  absl::string_view rest_, whole_, comment_;
  size_t number_ = 0;
  PointColumns columns_;
  char mark_ = ' ';
  uint64_t points_in_comments_ = 0;
};

bool IsPoint(const Words& words) {
  return std::ranges::count_if(words, [](absl::string_view w) { return Number(w).has_value(); }) >=
         3;
}

bool IsNames(const Words& words) {
  return std::ranges::none_of(words,
                              [](absl::string_view word) { return Number(word).has_value(); }) &&
         !std::ranges::all_of(words, IsMissing);
}

// Returns the separator of a file's words: the first of these that splits the first line of three
// or more numbers into numbers, so a comma may also be a decimal one. Without such a line, the
// first separator that occurs in the first line.
char MarkOf(absl::string_view text) {
  Lines lines(text);
  absl::string_view line;
  while (lines.Next(&line)) {
    for (const char mark : {';', '\t', ',', ' '}) {
      if (mark != ' ' && line.find(mark) == absl::string_view::npos) continue;
      const Words words = SplitAt(line, mark);
      const bool all_words = std::ranges::all_of(words, [](absl::string_view word) {
        return word.empty() || Number(word).has_value() ||
               word.find_first_of(",; ") == absl::string_view::npos;
      });
      if (all_words && IsPoint(words)) return mark;
    }
  }
  Lines first(text);
  if (first.Next(&line)) {
    for (const char mark : {';', '\t', ','}) {
      if (line.find(mark) != absl::string_view::npos) return mark;
    }
  }
  return ' ';
}

// The words of the line at which `lines` is, which has points. A line with too few at the file's mark is parted at its own, and what
// looks like a comment in a line with too few is words.
Words WordsOf(absl::string_view line, const Lines& lines, char mark, size_t columns) {
  Words words = SplitAt(line, mark);
  if (words.size() < columns && line.size() < lines.whole().size()) {
    Words all = SplitAt(lines.whole(), mark);
    if (all.size() >= columns) return all;
  }
  return words.size() < columns ? SplitAt(line, MarkOf(line)) : words;
}

// The extremes of the columns from the fourth on, over the whole file.
struct Ranges {
  double least[6] = {}, greatest[6] = {};
};

Ranges RangesOf(absl::string_view text, char mark, size_t columns) {
  Ranges out;
  Lines lines(text);
  absl::string_view line;
  while (lines.Next(&line)) {
    const auto words = WordsOf(line, lines, mark, columns);
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
  using Known = std::vector<C>;
  const Known color = {C::kRed, C::kGreen, C::kBlue},
              normal = {C::kNormalX, C::kNormalY, C::kNormalZ};
  const auto with = [count](const Known& more, const Known& and_more = {}) {
    Columns all = {{C::kX, ""}, {C::kY, ""}, {C::kZ, ""}};
    for (const C column : more) all.push_back({column, ""});
    for (const C column : and_more) all.push_back({column, ""});
    all.resize(std::max(all.size(), count));
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
      return with(count > 7 ? color : Known());
  }
}

double FullScale(absl::string_view text, char mark, const PointColumns& columns) {
  ChannelRange range;
  Lines lines(text);
  lines.Expect(columns, mark);
  absl::string_view line;
  while (lines.Next(&line)) {
    const auto words = WordsOf(line, lines, mark, columns.size());
    for (size_t c = 0; c < std::min(words.size(), columns.size()); ++c) {
      if (columns[c] && IsColor(*columns[c])) range.Add(Number(words[c]).value_or(0));
    }
  }
  return range.FullScale();
}

bool Has(const Columns& columns, PointColumn column) {
  return std::ranges::find(columns, column, &Column::known) != columns.end();
}

Columns ByNames(const Words& words) {
  const std::vector<std::string> names(words.begin(), words.end());
  const PointColumns known = PointColumnsByName(names);
  Columns columns;
  for (size_t c = 0; c < names.size(); ++c) columns.push_back({known[c], names[c]});
  return columns;
}

// Returns: the columns that a comment names, as CloudCompare writes it. Empty unless it names x, y,
// z and as many columns as the points have.
Columns ByComment(absl::string_view comment, char mark, size_t count) {
  for (const char at : {mark, ' '}) {
    Columns columns = ByNames(SplitAt(comment, at));
    if (columns.size() == count && Has(columns, PointColumn::kX) && Has(columns, PointColumn::kY) &&
        Has(columns, PointColumn::kZ)) {
      return columns;
    }
  }
  return {};
}

PointLayout LayoutOf(const Columns& columns) {
  PointColumns known;
  for (const Column& column : columns) known.push_back(column.known);
  return PointLayout::Of(std::move(known));
}

// What the columns are, having read the lines that are no points yet; the first point's line is in `first`. `count`: the number of points
// that a line before them announces.
absl::StatusOr<Columns> ReadHead(const SourceFile& file, char mark, Lines* lines,
                                 absl::string_view* first, std::optional<uint64_t>* count) {
  if (!lines->Next(first))
    return FileError(file, "holds no line of numbers", "x y z a line is expected");
  Words words = SplitAt(*first, mark);
  uint64_t announced = 0;
  if (words.size() == 1 && absl::SimpleAtoi(words[0], &announced)) {
    *count = announced;
    if (!lines->Next(first))
      return FileError(file, "ends after a count", "x y z a line is expected");
    words = SplitAt(*first, mark);
  }
  if (IsNames(words)) {
    const Words all = SplitAt(lines->whole(), mark);
    Columns columns = ByNames(words);
    lines->Expect(LayoutOf(columns).shown, mark);
    if (!lines->Next(first))
      return FileError(file, "ends after its names", "x y z a line is expected");
    // What looks like a comment behind the names may be more of them.
    if (mark != ' ' && all.size() > words.size() &&
        SplitAt(lines->whole(), mark).size() == all.size()) {
      columns = ByNames(all);
      lines->Expect(LayoutOf(columns).shown, mark);
    }
    return columns;
  }
  if (words.size() < 3) {
    return FileError(file, absl::StrCat("line ", lines->number(), " is ", DescribeContents(*first)),
                     "three numbers or more a line are expected, or names of columns first");
  }
  Columns named = ByComment(lines->comment(), mark, words.size());
  if (!named.empty()) {
    lines->Expect(LayoutOf(named).shown, mark);
    return named;
  }
  return ByCount(words.size(), RangesOf(file.bytes, mark, words.size()));
}

}  // namespace

absl::StatusOr<Model> ReadTextPoints(const SourceFile& file, bool attributes) {
  if (absl::StartsWith(file.bytes, "\xff\xfe") || absl::StartsWith(file.bytes, "\xfe\xff"))
    return FileError(file, absl::StrCat("is ", DescribeContents(file.bytes)), "UTF-8 is expected");
  const char mark = MarkOf(file.bytes);
  Lines lines(file.bytes);
  absl::string_view line;
  std::optional<uint64_t> announced;
  const absl::StatusOr<Columns> columns = ReadHead(file, mark, &lines, &line, &announced);
  if (!columns.ok()) return columns.status();
  if (columns->size() >= kMostColumns) {
    return FileError(file, absl::StrCat("has ", kMostColumns, " columns or more"),
                     absl::StrCat("at most ", kMostColumns - 1, " are read"));
  }
  const PointLayout layout = LayoutOf(*columns);
  std::vector<size_t> numbers;  // the columns that are attributes
  std::vector<std::string> names;
  if (attributes) numbers = layout.attributes;
  for (const size_t c : numbers) {
    const Column& column = (*columns)[c];
    names.push_back(!column.name.empty()                      ? column.name
                    : column.known == PointColumn::kIntensity ? "intensity"
                                                              : absl::StrCat("column ", c + 1));
  }
  absl::StatusOr<PointTable> table =
      PointTable::Make(file, layout, FullScale(file.bytes, mark, layout.shown));
  if (!table.ok()) {
    constexpr size_t kMostNamed = 12;
    std::vector<std::string> named;
    for (size_t c = 0; c < std::min(columns->size(), kMostNamed); ++c)
      named.push_back(EscapeForTerminal((*columns)[c].name.substr(0, 40)));
    return absl::Status(
        table.status().code(),
        absl::StrCat(table.status().message(), "; its first line names ",
                     absl::StrJoin(named, ", "), columns->size() > kMostNamed ? ", …" : "",
                     "; rename three columns to x, y and z"));
  }
  table->SetAttributes(std::move(names));
  std::vector<double> values(numbers.size());
  uint64_t beyond = 0, rows = 0;                // words, lines
  bool has_points = false, has_commas = false;  // decimal points and decimal commas
  do {
    const auto words = WordsOf(line, lines, mark, columns->size());
    PointRow row = {};
    ++rows;
    beyond += words.size() - std::min(words.size(), columns->size());
    for (size_t c = 0; c < columns->size(); ++c) {
      if (!layout.shown[c]) continue;
      std::optional<double> value = c < words.size() ? Number(words[c]) : std::nullopt;
      if (!value && c < words.size() && IsMissing(words[c])) value = std::nan("");
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
      has_points |= words[c].find('.') != absl::string_view::npos;
      has_commas |= words[c].find(',') != absl::string_view::npos;
      if (has_points && has_commas) {
        return FileError(file,
                         absl::StrCat("line ", lines.number(), " has \"",
                                      EscapeForTerminal(words[c].substr(0, 24)), "\" in column ",
                                      c + 1, ", but the file has both decimal points and commas"),
                         "one of the two is expected");
      }
      row[static_cast<size_t>(*layout.shown[c])] = *value;
    }
    for (size_t i = 0; i < numbers.size(); ++i) {
      const size_t c = numbers[i];
      values[i] = c < words.size() ? Number(words[c]).value_or(std::nan("")) : std::nan("");
    }
    if (absl::Status status = table->Add(file, row, absl::StrCat("line ", lines.number()), values);
        !status.ok()) {
      return status;
    }
  } while (lines.Next(&line));
  if (table->size() == 0) {
    return FileError(file, "has no point whose x, y and z are numbers", "at least one is expected");
  }
  Model model =
      std::move(*table).Finish(file, file.extension == "csv" ? "CSV points" : "XYZ points");
  if (announced && *announced != rows) {
    AddNote(absl::StrCat("its first line announces ", *announced, " points, but it has ", rows),
            &model);
  }
  if (!attributes) AddLeftOut("other columns", layout.others.size(), &model);
  AddLeftOut("words beyond the columns", beyond, &model);
  AddLeftOut("points in comments", lines.points_in_comments(), &model);
  return model;
}

}  // namespace voxeld::voxelctl
