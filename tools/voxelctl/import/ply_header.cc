#include "tools/voxelctl/import/ply_header.h"

#include <algorithm>
#include <optional>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "absl/strings/string_view.h"
#include "common/text/printable.h"
#include "tools/voxelctl/import/model.h"

namespace voxeld::voxelctl {
namespace {

constexpr size_t kMaxHeaderBytes = 1 << 20;

std::optional<PlyType> TypeOf(absl::string_view name) {
  struct Name {
    absl::string_view name;
    PlyType type;
  };
  static constexpr Name kNames[] = {
      {"char", PlyType::kI8},    {"int8", PlyType::kI8},     {"uchar", PlyType::kU8},
      {"uint8", PlyType::kU8},   {"short", PlyType::kI16},   {"int16", PlyType::kI16},
      {"ushort", PlyType::kU16}, {"uint16", PlyType::kU16},  {"int", PlyType::kI32},
      {"int32", PlyType::kI32},  {"uint", PlyType::kU32},    {"uint32", PlyType::kU32},
      {"float", PlyType::kF32},  {"float32", PlyType::kF32}, {"double", PlyType::kF64},
      {"float64", PlyType::kF64}};
  for (const Name& n : kNames) {
    if (n.name == name) return n.type;
  }
  return std::nullopt;
}

absl::Status LineError(const SourceFile& file, int number, absl::string_view line,
                       absl::string_view expected) {
  return FileError(
      file,
      absl::StrCat("header line ", number, " is \"", EscapeForTerminal(line.substr(0, 60)), "\""),
      expected);
}

absl::Status ParseFormat(const SourceFile& file, int number, absl::string_view line,
                         const std::vector<absl::string_view>& words, PlyHeader* header) {
  if (words.size() == 3 && words[2] == "1.0") {
    if (words[1] == "ascii") {
      header->format = PlyHeader::Format::kAscii;
      return absl::OkStatus();
    }
    if (words[1] == "binary_little_endian") {
      header->format = PlyHeader::Format::kBinaryLittleEndian;
      return absl::OkStatus();
    }
    if (words[1] == "binary_big_endian") {
      header->format = PlyHeader::Format::kBinaryBigEndian;
      return absl::OkStatus();
    }
  }
  return LineError(file, number, line,
                   "ascii, binary_little_endian or binary_big_endian 1.0 is expected");
}

absl::Status ParseElement(const SourceFile& file, int number, absl::string_view line,
                          const std::vector<absl::string_view>& words, PlyHeader* header) {
  PlyElement element;
  if (words.size() != 3 || !absl::SimpleAtoi(words[2], &element.count)) {
    return LineError(file, number, line, "\"element NAME COUNT\" is expected");
  }
  element.name = std::string(words[1]);
  header->elements.push_back(std::move(element));
  return absl::OkStatus();
}

absl::Status ParseProperty(const SourceFile& file, int number, absl::string_view line,
                           const std::vector<absl::string_view>& words, PlyHeader* header) {
  PlyProperty property;
  std::optional<PlyType> type;
  if (words.size() == 3) {
    type = TypeOf(words[1]);
    property.name = std::string(words[2]);
  } else if (words.size() == 5 && words[1] == "list") {
    const std::optional<PlyType> count = TypeOf(words[2]);
    if (count && *count != PlyType::kF32 && *count != PlyType::kF64) type = TypeOf(words[3]);
    property.is_list = true;
    property.count_type = count.value_or(PlyType::kU8);
    property.name = std::string(words[4]);
  }
  if (!type || header->elements.empty()) {
    return LineError(file, number, line,
                     "after an element, \"property TYPE NAME\" or \"property list TYPE TYPE "
                     "NAME\" is expected");
  }
  property.type = *type;
  header->elements.back().properties.push_back(std::move(property));
  return absl::OkStatus();
}

// Returns the minimum number of bytes of one entry.
uint64_t LeastBytes(const PlyHeader& header, const PlyElement& element) {
  uint64_t bytes = 0;
  for (const PlyProperty& property : element.properties) {
    if (header.format == PlyHeader::Format::kAscii) {
      bytes += 2;
    } else {
      bytes += PlySize(property.is_list ? property.count_type : property.type);
    }
  }
  return bytes;
}

absl::Status CheckVertices(const SourceFile& file, const PlyHeader& header) {
  const PlyElement* vertex = header.Find("vertex");
  if (vertex == nullptr)
    return FileError(file, "has no vertices", "\"element vertex COUNT\" is expected");
  for (const absl::string_view axis : {"x", "y", "z"}) {
    const auto is_axis = [&](const PlyProperty& p) { return p.name == axis && !p.is_list; };
    if (std::none_of(vertex->properties.begin(), vertex->properties.end(), is_axis)) {
      return FileError(file, absl::StrCat("its vertices have no ", axis),
                       "properties x, y and z are expected");
    }
  }
  if (vertex->count > kMaxModelVertices) {
    return FileError(file, absl::StrCat("announces ", vertex->count, " vertices"),
                     absl::StrCat("at most ", kMaxModelVertices, " are read"));
  }
  return absl::OkStatus();
}

absl::Status CheckCounts(const SourceFile& file, const PlyHeader& header) {
  // The last line of an ASCII file need not have a line end.
  const uint64_t have = file.bytes.size() - header.body + 1;
  uint64_t need = 0;
  for (const PlyElement& element : header.elements) {
    const uint64_t each = LeastBytes(header, element);
    if (each != 0 && element.count > (have - need) / each) {
      return FileError(
          file,
          absl::StrCat("announces ", element.count, " of \"", EscapeForTerminal(element.name),
                       "\", at least ", each, " bytes each, but has ", have - 1, " bytes of data"),
          absl::StrCat("the file is truncated or its header wrong",
                       header.format == PlyHeader::Format::kAscii ? "" : TextModeHint(file.bytes)));
    }
    need += each * element.count;
  }
  if (header.format != PlyHeader::Format::kAscii && need >= have) {
    return FileError(file, absl::StrCat("has ", have - 1, " bytes of data"),
                     absl::StrCat("its header announces at least ", need, ": the file is truncated",
                                  TextModeHint(file.bytes)));
  }
  return absl::OkStatus();
}

}  // namespace

size_t PlySize(PlyType type) {
  switch (type) {
    case PlyType::kI8:
    case PlyType::kU8:
      return 1;
    case PlyType::kI16:
    case PlyType::kU16:
      return 2;
    case PlyType::kI32:
    case PlyType::kU32:
    case PlyType::kF32:
      return 4;
    case PlyType::kF64:
      return 8;
  }
  return 8;
}

const PlyElement* PlyHeader::Find(absl::string_view name) const {
  for (const PlyElement& element : elements) {
    if (element.name == name && element.count > 0) return &element;
  }
  return nullptr;
}

uint64_t PlyHeader::OtherEntries() const {
  uint64_t count = 0;
  for (const PlyElement& element : elements) {
    const bool read =
        &element == Find("vertex") || &element == Find("face") || &element == Find("tristrips");
    if (!read) count += element.count;
  }
  return count;
}

absl::StatusOr<PlyHeader> ParsePlyHeader(const SourceFile& file, PlyCounts counts) {
  const absl::string_view text = absl::string_view(file.bytes).substr(0, kMaxHeaderBytes);
  PlyHeader header;
  bool formatted = false;
  size_t at = 0;
  // The format's first description ends lines by carriage returns alone. If a file does so, a line
  // feed after the header may be its first number.
  const size_t first_end = text.find_first_of("\r\n");
  const bool by_returns = first_end != absl::string_view::npos && text[first_end] == '\r' &&
                          text.substr(first_end, 2) != "\r\n";
  for (int number = 1;; ++number) {
    const size_t end = text.find(by_returns ? '\r' : '\n', at);
    if (end == absl::string_view::npos) {
      if (number == 1) {
        return FileError(file, absl::StrCat("is ", DescribeContents(file.bytes)),
                         "a PLY file begins with a line \"ply\"");
      }
      return FileError(file, absl::StrCat("its header stops in line ", number),
                       "a line \"end_header\" is expected: the file is truncated");
    }
    const absl::string_view line = absl::StripTrailingAsciiWhitespace(text.substr(at, end - at));
    at = end + 1;
    const std::vector<absl::string_view> words =
        absl::StrSplit(line, absl::ByAnyChar(" \t"), absl::SkipEmpty());
    if (number == 1) {
      if (line != "ply") {
        return FileError(file, absl::StrCat("is ", DescribeContents(file.bytes)),
                         "a PLY file begins with a line \"ply\"");
      }
      continue;
    }
    if (words.empty()) continue;
    absl::Status status;
    if (words[0] == "end_header") break;
    if (words[0] == "format") {
      status = ParseFormat(file, number, line, words, &header);
      formatted = true;
    } else if (words[0] == "element") {
      status = ParseElement(file, number, line, words, &header);
    } else if (words[0] == "property") {
      status = ParseProperty(file, number, line, words, &header);
    } else if (words.size() > 2 && words[0] == "comment" && words[1] == "TextureFile") {
      ++header.pictures;
    }
    // Any other line is a comment, or a line that an exporter added without marking it as one.
    if (!status.ok()) return status;
  }
  if (!formatted)
    return FileError(file, "its header has no format", "\"format ascii 1.0\" is expected");
  header.body = at;
  absl::Status status = CheckVertices(file, header);
  if (status.ok() && counts == PlyCounts::kChecked) status = CheckCounts(file, header);
  if (!status.ok()) return status;
  return header;
}

}  // namespace voxeld::voxelctl
