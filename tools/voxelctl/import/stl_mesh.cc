#include "tools/voxelctl/import/stl_mesh.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <optional>
#include <utility>
#include <vector>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/string_view.h"
#include "absl/strings/strip.h"
#include "common/text/printable.h"
#include "tools/voxelctl/import/surface_builder.h"

namespace voxeld::voxelctl {
namespace {

static_assert(std::endian::native == std::endian::little, "numbers are copied as they are");

constexpr uint64_t kBinaryHeader = 84;
constexpr uint64_t kBinaryFacet = 50;
constexpr size_t kTitle = 80;           // bytes of the header before the count
constexpr size_t kAsciiProbe = 1024;    // bytes in which a text has no NUL
constexpr size_t kMostVertices = 4096;  // per facet

bool IsFinite(const Point3& p) {
  return std::isfinite(p.x) && std::isfinite(p.y) && std::isfinite(p.z);
}

absl::Status TooLarge(const SourceFile& file) {
  return FileError(file,
                   absl::StrCat("has over ", kMaxModelVertices, " different vertices or ",
                                kMaxModelIndices / 3, " triangles"),
                   "so large a model is not read; simplify it first");
}

// Facets with a color of their own, and those without, which get the model's.
class Facets {
 public:
  // Returns: false if there are too many.
  bool Add(const Point3& file_normal, const Point3 (&corners)[3], std::optional<Rgb> color) {
    Point3 normal = UnitOrZero(file_normal);
    if (normal == Point3{}) normal = FacetNormal(corners[0], corners[1], corners[2]);
    SurfaceBuilder& surface = color ? colored_ : plain_;
    for (const Point3& corner : corners) {
      if (!surface.Add({corner, normal, color.value_or(Rgb{})})) return false;
    }
    return true;
  }

  Model Finish(const SourceFile& file) && {
    Model model;
    model.path = file.path;
    model.format = "STL";
    model.up = Up::kZ;
    if (!colored_.empty()) model.parts.push_back(std::move(colored_).Finish());
    if (!plain_.empty()) model.parts.push_back(std::move(plain_).Finish());
    return model;
  }

 private:
  SurfaceBuilder colored_{true}, plain_{false};
};

// ------------------------------------------------------------------------------------ binary

uint8_t FromFiveBits(unsigned value) { return static_cast<uint8_t>((value & 31) * 255 / 31); }

// The meaning of the two bytes after each facet.
class Attributes {
 public:
  explicit Attributes(absl::string_view title) {
    const size_t at = title.find("COLOR=");
    if (at == absl::string_view::npos || title.size() - at < 10) return;
    const auto channel = [&](size_t i) { return static_cast<uint8_t>(title[at + 6 + i]); };
    all_ = Rgb{channel(0), channel(1), channel(2)};
  }

  std::optional<Rgb> ColorOf(uint16_t attribute) const {
    const bool top = (attribute & 0x8000) != 0;
    const uint8_t low = FromFiveBits(attribute), middle = FromFiveBits(attribute >> 5),
                  high = FromFiveBits(attribute >> 10);
    if (all_) return top ? *all_ : Rgb{low, middle, high};
    if (top) return Rgb{high, middle, low};
    return std::nullopt;
  }

 private:
  std::optional<Rgb> all_;  // Magics: the color of facets that have none
};

absl::StatusOr<Model> ReadBinaryStl(const SourceFile& file, uint32_t count) {
  const Attributes attributes(absl::string_view(file.bytes).substr(0, kTitle));
  Facets facets;
  const char* at = file.bytes.data() + kBinaryHeader;
  for (uint32_t f = 0; f < count; ++f, at += kBinaryFacet) {
    float numbers[12];
    uint16_t attribute = 0;
    std::memcpy(numbers, at, sizeof numbers);
    std::memcpy(&attribute, at + sizeof numbers, sizeof attribute);
    Point3 corners[3];
    for (int c = 0; c < 3; ++c) {
      corners[c] = {numbers[3 + 3 * c], numbers[4 + 3 * c], numbers[5 + 3 * c]};
      if (!IsFinite(corners[c])) {
        return FileError(file,
                         absl::StrCat("facet ", f + 1, " has the vertex (", corners[c].x, ", ",
                                      corners[c].y, ", ", corners[c].z, ")"),
                         "coordinates must be finite");
      }
    }
    if (!facets.Add({numbers[0], numbers[1], numbers[2]}, corners, attributes.ColorOf(attribute)))
      return TooLarge(file);
  }
  return std::move(facets).Finish(file);
}

// ------------------------------------------------------------------------------------- ASCII

// The words of a text, with the line of the last one.
class StlWords {
 public:
  explicit StlWords(absl::string_view text) : rest_(text) {}

  // Returns an empty word at the end.
  absl::string_view Next() {
    while (!rest_.empty() && absl::ascii_isspace(static_cast<unsigned char>(rest_.front()))) {
      // A carriage return ends a line unless a line feed follows.
      const bool ends =
          rest_.front() == '\n' || (rest_.front() == '\r' && !absl::StartsWith(rest_, "\r\n"));
      line_ += ends ? 1 : 0;
      rest_.remove_prefix(1);
    }
    size_t length = 0;
    while (length < rest_.size() && !absl::ascii_isspace(static_cast<unsigned char>(rest_[length])))
      ++length;
    const absl::string_view word = rest_.substr(0, length);
    rest_.remove_prefix(length);
    return word;
  }

  // Skips the rest of the line, which is a name and may contain any word.
  void PassName() { rest_.remove_prefix(std::min(rest_.find_first_of("\r\n"), rest_.size())); }

  uint64_t line() const { return line_; }

 private:
  absl::string_view rest_;
  uint64_t line_ = 1;
};

absl::Status Cut(const SourceFile& file) {
  return FileError(file, "ends without \"endsolid\"", "the file is truncated");
}

absl::Status NoNumber(const SourceFile& file, const StlWords& words, absl::string_view word) {
  return FileError(file,
                   absl::StrCat("line ", words.line(), " has \"",
                                EscapeForTerminal(word.substr(0, 24)), "\" as a coordinate"),
                   "a vertex is three finite numbers, with points as decimal marks");
}

// Reads three coordinates after "vertex".
absl::StatusOr<Point3> ReadVertex(const SourceFile& file, StlWords* words) {
  Point3 p;
  for (double* coordinate : {&p.x, &p.y, &p.z}) {
    const absl::string_view word = words->Next();
    if (word.empty()) return Cut(file);
    if (!absl::SimpleAtod(word, coordinate) || !std::isfinite(*coordinate))
      return NoNumber(file, *words, word);
  }
  return p;
}

// A "facet" with its contents up to "endfacet". Its normal is zero if the file has none or it is
// not a number.
struct AsciiFacet {
  Point3 normal;
  uint64_t colors = 0;  // lines that begin with "color"
  std::vector<Point3> corners;
};

absl::StatusOr<AsciiFacet> ReadFacet(const SourceFile& file, StlWords* words) {
  AsciiFacet facet;
  const uint64_t line = words->line();
  absl::string_view word = words->Next();
  if (absl::EqualsIgnoreCase(word, "normal")) {
    bool good = true;
    for (double* coordinate : {&facet.normal.x, &facet.normal.y, &facet.normal.z})
      good &= absl::SimpleAtod(words->Next(), coordinate);
    if (!good) facet.normal = {};
    word = words->Next();
  }
  for (; !absl::EqualsIgnoreCase(word, "endfacet"); word = words->Next()) {
    if (word.empty()) return Cut(file);
    if (absl::EqualsIgnoreCase(word, "vertex")) {
      const absl::StatusOr<Point3> vertex = ReadVertex(file, words);
      if (!vertex.ok()) return vertex.status();
      if (facet.corners.size() >= kMostVertices) {
        return FileError(
            file,
            absl::StrCat("the facet in line ", line, " has over ", kMostVertices, " vertices"),
            "a facet is a triangle");
      }
      facet.corners.push_back(*vertex);
    } else if (absl::EqualsIgnoreCase(word, "color")) {
      ++facet.colors;
    } else if (absl::EqualsIgnoreCase(word, "facet") || absl::EqualsIgnoreCase(word, "endsolid")) {
      return FileError(file, absl::StrCat("the facet in line ", line, " has no \"endfacet\""),
                       "the file is damaged");
    }
  }
  if (facet.corners.size() < 3) {
    return FileError(file,
                     absl::StrCat("the facet in line ", line, " has ", facet.corners.size(),
                                  facet.corners.size() == 1 ? " vertex" : " vertices"),
                     "a facet has three");
  }
  return facet;
}

absl::StatusOr<Model> ReadAsciiStl(const SourceFile& file, absl::string_view text) {
  StlWords words(text);
  Facets facets;
  uint64_t count = 0, colors = 0;
  bool open = false;
  for (absl::string_view word = words.Next(); !word.empty(); word = words.Next()) {
    if (absl::EqualsIgnoreCase(word, "solid")) {
      open = true;
      words.PassName();
    } else if (absl::EqualsIgnoreCase(word, "endsolid")) {
      open = false;
      words.PassName();
    } else if (absl::EqualsIgnoreCase(word, "facet")) {
      const absl::StatusOr<AsciiFacet> facet = ReadFacet(file, &words);
      if (!facet.ok()) return facet.status();
      ++count;
      colors += facet->colors;
      const std::vector<Point3>& c = facet->corners;
      for (size_t i = 2; i < c.size(); ++i) {
        if (!facets.Add(facet->normal, {c[0], c[i - 1], c[i]}, std::nullopt)) return TooLarge(file);
      }
    } else if (absl::EqualsIgnoreCase(word, "color")) {
      ++colors;
    }
    // Other words are specific to an exporter and are ignored.
  }
  if (count == 0) {
    return FileError(file, "is ASCII STL without a facet", "at least one triangle is expected");
  }
  if (open) return Cut(file);
  Model model = std::move(facets).Finish(file);
  // The format does not define these lines, and programs disagree about their numbers.
  AddLeftOut("colours of ASCII facets", colors, &model);
  return model;
}

}  // namespace

absl::StatusOr<Model> ReadStlMesh(const SourceFile& file) {
  const absl::string_view bytes = file.bytes;
  uint32_t facets = 0;
  if (bytes.size() >= kBinaryHeader) std::memcpy(&facets, bytes.data() + kTitle, sizeof facets);
  const uint64_t announced = kBinaryHeader + kBinaryFacet * facets;
  if (facets > 0 && bytes.size() == announced) return ReadBinaryStl(file, facets);
  absl::string_view text = bytes;
  absl::ConsumePrefix(&text, "\xef\xbb\xbf");
  const bool is_text = bytes.substr(0, kAsciiProbe).find('\0') == absl::string_view::npos;
  if (is_text && absl::StartsWithIgnoreCase(absl::StripLeadingAsciiWhitespace(text), "solid"))
    return ReadAsciiStl(file, text);
  const bool is_utf16 = absl::StartsWith(bytes, "\xff\xfe") || absl::StartsWith(bytes, "\xfe\xff");
  if (bytes.size() < kBinaryHeader || is_text || (is_utf16 && bytes.size() < announced)) {
    return FileError(file,
                     absl::StrCat("is ", DescribeContents(bytes), ", ", bytes.size(), " bytes"),
                     "an STL begins with \"solid\", or is binary with a header of 84 bytes");
  }
  if (facets == 0)
    return FileError(file, "is binary STL with no triangle", "at least one is expected");
  if (bytes.size() < announced) {
    return FileError(file,
                     absl::StrCat("as binary STL it announces ", facets,
                                  facets == 1 ? " triangle (" : " triangles (", announced,
                                  " bytes) but has ", bytes.size(), " bytes"),
                     "the file is truncated, or not an STL");
  }
  return ReadBinaryStl(file, facets);
}

}  // namespace voxeld::voxelctl
