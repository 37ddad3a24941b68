#include "tools/import/clouds.h"

#include <liblzf/lzf.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "absl/functional/function_ref.h"
#include "absl/strings/ascii.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "common/text/printable.h"
#include "tools/voxelctl/import/point_table.h"

namespace voxeld::voxelctl {
namespace {

static_assert(std::endian::native == std::endian::little, "values are read in place");

struct Field {
  std::string name;
  uint32_t size = 0;   // of one value
  char type = 'F';     // I, U, F
  uint32_t count = 1;  // values of each point
  // The role of its first value, and the index among the attributes of a point.
  std::optional<PointColumn> shown;
  std::optional<size_t> attribute;
};

// The values of a point.
struct PcdPoint {
  PointRow row = {};
  std::vector<double> attributes;
};

// PCL fills the gaps of a record with fields of this name.
bool IsPadding(const Field& field) { return field.name == "_"; }

enum class Data : uint8_t { kAscii, kBinary, kCompressed };

struct PcdHeader {
  std::vector<Field> fields;
  uint64_t points = 0;
  Data data = Data::kAscii;
  size_t body = 0;  // offset of the points
  uint64_t point_bytes = 0;
  bool has_viewpoint = false;  // other than that at the origin which looks straight ahead
};

constexpr uint64_t kMostPointBytes = 4096;
constexpr uint64_t kMostExpanded = 100;  // a factor; LZF expands 3 bytes to 264 at most

using Words = std::vector<absl::string_view>;

absl::Status Wrong(const SourceFile& file, size_t line, absl::string_view found,
                   absl::string_view expected) {
  return FileError(file, absl::StrCat("line ", line, " ", found), expected);
}

// Whether the words of VIEWPOINT are a translation by 0 and a quaternion, w first, that does not turn.
bool IsPlainViewpoint(const Words& words) {
  constexpr std::array<double, 7> kPlain = {0, 0, 0, 1, 0, 0, 0};
  if (words.size() != kPlain.size() + 1) return false;
  for (size_t i = 0; i < kPlain.size(); ++i) {
    const std::optional<double> value = NumberOfWord(words[i + 1]);
    if (!value || (i < 3 ? *value : std::abs(*value)) != kPlain[i]) return false;
  }
  return true;
}

// One line of the header. `done`: it was the last.
absl::Status TakeHeaderLine(const SourceFile& file, size_t line, const Words& words, PcdHeader* out,
                            uint64_t* width, uint64_t* height, bool* done) {
  const absl::string_view key = words[0];
  const auto each = [&](auto&& take) -> absl::Status {
    if (words.size() != out->fields.size() + 1) {
      return Wrong(file, line, absl::StrCat("has ", words.size() - 1, " values of ", key),
                   absl::StrCat("there are ", out->fields.size(), " FIELDS"));
    }
    for (size_t i = 0; i < out->fields.size(); ++i) {
      if (!take(words[i + 1], &out->fields[i])) {
        return Wrong(file, line,
                     absl::StrCat("has ", key, " \"", EscapeForTerminal(words[i + 1]), "\""),
                     "SIZE is 1, 2, 4 or 8, TYPE I, U or F, COUNT a number from 1 on");
      }
    }
    return absl::OkStatus();
  };
  if (key == "FIELDS" || key == "COLUMNS") {
    for (size_t i = 1; i < words.size(); ++i) out->fields.push_back({std::string(words[i])});
    return absl::OkStatus();
  }
  if (key == "SIZE") {
    return each([](absl::string_view word, Field* field) {
      return absl::SimpleAtoi(word, &field->size) && std::has_single_bit(field->size) &&
             field->size <= 8;
    });
  }
  if (key == "TYPE") {
    return each([](absl::string_view word, Field* field) {
      field->type = word[0];
      return word == "I" || word == "U" || word == "F";
    });
  }
  if (key == "COUNT") {
    return each([](absl::string_view word, Field* field) {
      return absl::SimpleAtoi(word, &field->count) && field->count >= 1 &&
             field->count <= kMostPointBytes;
    });
  }
  uint64_t* const number = key == "WIDTH"    ? width
                           : key == "HEIGHT" ? height
                           : key == "POINTS" ? &out->points
                                             : nullptr;
  if (number != nullptr && (words.size() != 2 || !absl::SimpleAtoi(words[1], number))) {
    return Wrong(file, line, absl::StrCat("has no number for ", key), "one is expected");
  }
  if (key == "VIEWPOINT") out->has_viewpoint = !IsPlainViewpoint(words);
  if (key != "DATA") return absl::OkStatus();  // VERSION and what others may add
  *done = true;
  const absl::string_view data = words.size() > 1 ? words[1] : "";
  if (data == "ascii") return absl::OkStatus();
  out->data = data == "binary" ? Data::kBinary : Data::kCompressed;
  if (data == "binary" || data == "binary_compressed") return absl::OkStatus();
  return Wrong(file, line, absl::StrCat("has DATA \"", EscapeForTerminal(data), "\""),
               "ascii, binary and binary_compressed are read");
}

absl::StatusOr<PcdHeader> ReadPcdHeader(const SourceFile& file) {
  PcdHeader out;
  uint64_t width = 0, height = 1;
  bool done = false;
  const absl::string_view bytes = file.bytes;
  for (size_t line = 1; !done; ++line) {
    const size_t end = bytes.find('\n', out.body);
    if (end == absl::string_view::npos || line > 1000) {
      return FileError(file, absl::StrCat("is ", DescribeContents(bytes)),
                       "a PCD header is expected, up to its line DATA");
    }
    const absl::string_view text =
        absl::StripAsciiWhitespace(bytes.substr(out.body, end - out.body));
    out.body = end + 1;
    if (text.empty() || text.front() == '#') continue;
    const Words words = absl::StrSplit(text, absl::ByAnyChar(" \t"), absl::SkipEmpty());
    if (absl::Status status = TakeHeaderLine(file, line, words, &out, &width, &height, &done);
        !status.ok()) {
      return status;
    }
  }
  if (out.points == 0 && width <= kMaxModelVertices && height <= kMaxModelVertices) {
    out.points = width * height;
  }
  for (const Field& field : out.fields) {
    if (field.size == 0) return FileError(file, "has no line SIZE", "a PCD header is expected");
    if (out.data != Data::kAscii && field.type == 'F' && field.size < 4 && !IsPadding(field)) {
      return FileError(file,
                       absl::StrCat("has field ", EscapeForTerminal(field.name),
                                    " of TYPE F and SIZE ", field.size),
                       "floating-point numbers have 4 or 8 bytes");
    }
    out.point_bytes += uint64_t{field.size} * field.count;
  }
  if (out.points == 0 || out.points > kMaxModelVertices || out.point_bytes > kMostPointBytes) {
    return FileError(
        file, absl::StrCat("has ", out.points, " points of ", out.point_bytes, " bytes"),
        absl::StrCat("1 to ", kMaxModelVertices, " of at most ", kMostPointBytes, " are read"));
  }
  return out;
}

template <typename T>
double As(const char* at) {
  T value;
  std::memcpy(&value, at, sizeof(value));
  return static_cast<double>(value);
}

double ValueOf(const Field& field, const char* at) {
  switch (field.type) {
    case 'F':
      return field.size == 8 ? As<double>(at) : field.size == 4 ? As<float>(at) : std::nan("");
    case 'I':
      return field.size == 1   ? As<int8_t>(at)
             : field.size == 2 ? As<int16_t>(at)
             : field.size == 4 ? As<int32_t>(at)
                               : As<int64_t>(at);
    default:
      return field.size == 1   ? As<uint8_t>(at)
             : field.size == 2 ? As<uint16_t>(at)
             : field.size == 4 ? As<uint32_t>(at)
                               : As<uint64_t>(at);
  }
}

bool IsPacked(const Field& field) {
  return (field.name == "rgb" || field.name == "rgba") && field.size == 4;
}

// `word`: nothing if the colour is not known.
void SetPacked(std::optional<uint32_t> word, PointRow* row) {
  for (const auto& [column, shift] :
       {std::pair(PointColumn::kRed, 16), {PointColumn::kGreen, 8}, {PointColumn::kBlue, 0}}) {
    (*row)[static_cast<size_t>(column)] = word ? *word >> shift & 0xFF : std::nan("");
  }
}

void SetNumber(const Field& field, double value, PcdPoint* point) {
  if (field.attribute) point->attributes[*field.attribute] = value;
  if (field.shown) point->row[static_cast<size_t>(*field.shown)] = value;
}

// Stores a field's first value in the point.
void Take(const Field& field, const char* at, PcdPoint* point) {
  if (field.shown == PointColumn::kPackedColor) {
    uint32_t word;
    std::memcpy(&word, at, sizeof(word));
    SetPacked(word, &point->row);
  } else {
    SetNumber(field, ValueOf(field, at), point);
  }
}

// Stores a word of ascii data. A packed colour may be written as the float with the same bits, or
// as an integer.
bool TakeWord(const Field& field, absl::string_view word, PcdPoint* point) {
  const std::optional<double> number = NumberOfWord(word);
  if (!number) return false;
  const double value = *number;
  if (field.shown == PointColumn::kPackedColor) {
    // With its alpha the word of most colours is negative as a signed number, and not a number as a float: then the text does not
    // say which colour it is.
    std::optional<uint32_t> bits;
    if (field.type == 'F' && !std::isnan(value)) {
      bits = std::bit_cast<uint32_t>(static_cast<float>(value));
    } else if (value >= INT32_MIN && value <= UINT32_MAX) {
      bits = static_cast<uint32_t>(static_cast<int64_t>(value));
    }
    SetPacked(bits, &point->row);
  } else {
    SetNumber(field, value, point);
  }
  return true;
}

bool IsThere(const PointRow& row) {
  return std::isfinite(row[0]) && std::isfinite(row[1]) && std::isfinite(row[2]);
}

using TakePoint = absl::FunctionRef<absl::Status(const PcdPoint&, uint64_t number)>;

PcdPoint EmptyPoint(const PcdHeader& header) {
  PcdPoint point;
  for (const Field& field : header.fields) {
    if (field.attribute) point.attributes.push_back(0);
  }
  return point;
}

// Removes the first word and the blanks behind it. Returns: the word; empty if there is none.
absl::string_view TakeWordOf(absl::string_view* line) {
  const absl::string_view word = line->substr(0, line->find_first_of(" \t\r"));
  line->remove_prefix(word.size());
  *line = absl::StripLeadingAsciiWhitespace(*line);
  return word;
}

// Counts of what the data contain besides points.
struct Surplus {
  uint64_t points = 0;  // beyond the header's number
  uint64_t words = 0;   // of lines, beyond the fields
};

// A line is a point.
absl::Status ReadAscii(const SourceFile& file, const PcdHeader& header, TakePoint take,
                       Surplus* surplus) {
  absl::string_view rest = absl::string_view(file.bytes).substr(header.body);
  PcdPoint point = EmptyPoint(header), ignored = point;
  *surplus = {};
  for (uint64_t i = 0; i < header.points || !rest.empty();) {
    absl::string_view line =
        rest.empty() ? rest : absl::StripLeadingAsciiWhitespace(TakeLine(&rest));
    if (line.empty() && !rest.empty()) continue;
    if (i >= header.points) {
      surplus->points += line.empty() ? 0 : 1;
      continue;
    }
    for (const Field& field : header.fields) {
      for (uint32_t k = 0; k < field.count; ++k) {
        const absl::string_view word = TakeWordOf(&line);
        if (!TakeWord(field, word, k == 0 ? &point : &ignored)) {
          return FileError(
              file,
              absl::StrCat("point ", i, " of ", header.points, " has ",
                           word.empty()
                               ? "nothing"
                               : absl::StrCat("\"", EscapeForTerminal(word.substr(0, 24)), "\""),
                           " for ", EscapeForTerminal(field.name)),
              "a number is expected");
        }
      }
    }
    while (!TakeWordOf(&line).empty()) ++surplus->words;
    if (absl::Status status = take(point, i); !status.ok()) return status;
    ++i;
  }
  return absl::OkStatus();
}

// Reads points one after another, or field after field (`by_field`), as compressed data store them.
absl::Status ReadBinary(const SourceFile& file, const PcdHeader& header, absl::string_view bytes,
                        bool by_field, TakePoint take, Surplus* surplus) {
  const uint64_t there = bytes.size() / header.point_bytes;
  if (there < header.points) {
    return FileError(file,
                     absl::StrCat("has ", bytes.size(), " bytes of data for ", header.points,
                                  " points of ", header.point_bytes, TextModeHint(file.bytes)),
                     "the file is truncated or damaged");
  }
  *surplus = {.points = there - header.points};
  PcdPoint point = EmptyPoint(header);
  for (uint64_t i = 0; i < header.points; ++i) {
    uint64_t before = 0;  // bytes of the fields before it
    for (const Field& field : header.fields) {
      const uint64_t bytes_of_field = uint64_t{field.size} * field.count;
      const uint64_t at =
          by_field ? before * header.points + i * bytes_of_field : i * header.point_bytes + before;
      if (field.count > 0) Take(field, bytes.data() + at, &point);
      before += bytes_of_field;
    }
    if (absl::Status status = take(point, i); !status.ok()) return status;
  }
  return absl::OkStatus();
}

absl::StatusOr<std::string> Decompress(const SourceFile& file, const PcdHeader& header) {
  const absl::string_view body = absl::string_view(file.bytes).substr(header.body);
  uint32_t packed = 0, whole = 0;
  if (body.size() >= 8) {
    std::memcpy(&packed, body.data(), 4);
    std::memcpy(&whole, body.data() + 4, 4);
  }
  if (body.size() < 8 || packed > body.size() - 8 || whole != header.points * header.point_bytes ||
      whole > packed * kMostExpanded) {
    return FileError(
        file,
        absl::StrCat("has ", packed, " compressed bytes of ", whole, " in ", body.size(),
                     " bytes of data for ", header.points, " points of ", header.point_bytes),
        "the file is truncated or damaged");
  }
  std::string out(whole, '\0');
  if (lzf_decompress(body.data() + 8, packed, out.data(), whole) != whole) {
    return FileError(file, "has compressed data that do not decompress",
                     "the file is truncated or damaged");
  }
  return out;
}

}  // namespace

absl::StatusOr<Model> ReadPcdPoints(const SourceFile& file, bool attributes) {
  absl::StatusOr<PcdHeader> header = ReadPcdHeader(file);
  if (!header.ok()) return header.status();
  std::vector<std::string> field_names;
  for (const Field& field : header->fields) field_names.push_back(field.name);
  PointColumns columns = PointColumnsByName(field_names);
  if (const auto packed =
          std::ranges::find_if(header->fields, [](const Field& field) { return IsPacked(field); });
      packed != header->fields.end()) {
    columns[static_cast<size_t>(packed - header->fields.begin())] = PointColumn::kPackedColor;
  }
  const PointLayout layout = PointLayout::Of(std::move(columns));
  bool floats = false, wide = false;  // colours whose scale depends on their greatest value
  std::vector<std::string> names;
  for (size_t f = 0; attributes && f < layout.attributes.size(); ++f) {
    Field& field = header->fields[layout.attributes[f]];
    if (IsPadding(field)) continue;
    field.attribute = names.size();
    names.push_back(field.name);
  }
  uint64_t others = 0, further = 0;
  for (size_t f = 0; f < header->fields.size(); ++f) {
    Field& field = header->fields[f];
    field.shown = layout.shown[f];
    if (IsPadding(field)) continue;
    if (field.shown || field.attribute) {
      further += field.count - 1;
    } else {
      ++others;
    }
    if (field.shown && IsColor(*field.shown)) {
      floats |= field.type == 'F';
      wide |= field.type != 'F' && field.size > 1;
    }
  }
  std::string decompressed;
  if (header->data == Data::kCompressed) {
    absl::StatusOr<std::string> bytes = Decompress(file, *header);
    if (!bytes.ok()) return bytes.status();
    decompressed = *std::move(bytes);
  }
  Surplus surplus;
  const auto read = [&](TakePoint take) {
    if (header->data == Data::kAscii) return ReadAscii(file, *header, take, &surplus);
    const bool by_field = header->data == Data::kCompressed;
    return ReadBinary(file, *header,
                      by_field ? decompressed : absl::string_view(file.bytes).substr(header->body),
                      by_field, take, &surplus);
  };
  ChannelRange range;
  if (!floats) range.Add(255);
  if (floats || wide) {
    const absl::Status looked = read([&](const PcdPoint& point, uint64_t) {
      for (const PointColumn c : {PointColumn::kRed, PointColumn::kGreen, PointColumn::kBlue})
        range.Add(point.row[static_cast<size_t>(c)]);
      return absl::OkStatus();
    });
    if (!looked.ok()) return looked;
  }
  absl::StatusOr<PointTable> table = PointTable::Make(file, layout, range.FullScale());
  if (!table.ok()) return table.status();
  table->SetAttributes(std::move(names));
  uint64_t nowhere = 0;
  const absl::Status status = read([&](const PcdPoint& point, uint64_t number) {
    if (IsThere(point.row))
      return table->Add(file, point.row, absl::StrCat("point ", number), point.attributes);
    ++nowhere;
    return absl::OkStatus();
  });
  if (!status.ok()) return status;
  if (table->size() == 0) {
    return FileError(file, "has no point that is anywhere", "at least one is expected");
  }
  Model model = std::move(*table).Finish(file, "PCD points");
  AddLeftOut("points that are not finite", nowhere, &model);
  AddLeftOut("other fields", others, &model);
  AddLeftOut("further values of fields", further, &model);
  AddLeftOut("points beyond the header's number", surplus.points, &model);
  AddLeftOut("words beyond the fields", surplus.words, &model);
  AddLeftOut("viewpoints", header->has_viewpoint ? 1 : 0, &model);
  return model;
}

}  // namespace voxeld::voxelctl
