#include "tools/import/obj_model.h"

#define TINYOBJLOADER_IMPLEMENTATION
#define TINYOBJLOADER_USE_DOUBLE
#include <tiny_obj_loader.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <sstream>
#include <streambuf>
#include <string>
#include <utility>
#include <vector>

#include "absl/container/flat_hash_map.h"
#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_replace.h"
#include "absl/strings/string_view.h"
#include "absl/strings/strip.h"
#include "common/text/printable.h"
#include "tools/import/mesh_parts.h"
#include "tools/voxelctl/import/triangulate.h"

namespace voxeld::voxelctl {
namespace {

constexpr absl::string_view kExpected =
    "a Wavefront OBJ is text with lines such as \"v 1 2 3\" and \"f 1 2 3\"";
constexpr uint32_t kNone = UINT32_MAX;
constexpr size_t kMostNames = 100'000;  // of materials
// For files with neither normals nor smoothing groups: sharper edges stay edges.
constexpr double kCreaseDegrees = 25;

bool IsBlank(char c) { return c == ' ' || c == '\t' || c == '\r'; }

absl::string_view Trim(absl::string_view text) {
  while (!text.empty() && IsBlank(text.front())) text.remove_prefix(1);
  while (!text.empty() && IsBlank(text.back())) text.remove_suffix(1);
  return text;
}

// Removes the next word from the front of a line and returns it; empty at the end and at a comment.
absl::string_view TakeWord(absl::string_view* line) {
  size_t begin = 0;
  while (begin < line->size() && IsBlank((*line)[begin])) ++begin;
  size_t end = begin;
  if (begin < line->size() && (*line)[begin] == '#') begin = end = line->size();
  while (end < line->size() && !IsBlank((*line)[end])) ++end;
  const absl::string_view word = line->substr(begin, end - begin);
  line->remove_prefix(end);
  return word;
}

// Removes a comment behind a name: "red # paint" becomes "red". Names may contain blanks, and "#"
// within a word.
absl::string_view WithoutComment(absl::string_view name) {
  for (size_t at = name.find('#'); at != absl::string_view::npos; at = name.find('#', at + 1)) {
    if (at > 0 && IsBlank(name[at - 1])) return Trim(name.substr(0, at));
  }
  return name;
}

// The lines of a text. A line that ends in a backslash is joined to the next.
class Lines {
 public:
  explicit Lines(absl::string_view text)
      : text_(text), end_(text.find('\n') == absl::string_view::npos ? '\r' : '\n') {
    absl::ConsumePrefix(&text_, "\xef\xbb\xbf");
  }

  // Returns the number, from 1, of the first physical line that Next returned.
  int64_t number() const { return number_; }

  bool Next(absl::string_view* line) {
    joined_.clear();
    number_ = next_number_;
    while (!text_.empty()) {
      const size_t end = std::min(text_.find(end_), text_.size());
      absl::string_view one = text_.substr(0, end);
      text_.remove_prefix(std::min(end + 1, text_.size()));
      ++next_number_;
      while (!one.empty() && one.back() == '\r') one.remove_suffix(1);
      if (!one.empty() && one.back() == '\\') {
        absl::StrAppend(&joined_, one.substr(0, one.size() - 1), " ");
        continue;
      }
      if (joined_.empty()) {
        *line = one;
      } else {
        absl::StrAppend(&joined_, one);
        *line = joined_;
      }
      return true;
    }
    *line = joined_;
    return !joined_.empty();
  }

 private:
  absl::string_view text_;
  const char end_;
  std::string joined_;
  int64_t number_ = 1, next_number_ = 1;
};

// Returns whether the library reads the word as a number; it reads everything else as 0.
bool IsNumber(absl::string_view word) {
  size_t at = 0, digits = 0;
  const auto take_digits = [&] {
    const size_t from = at;
    while (at < word.size() && absl::ascii_isdigit(static_cast<unsigned char>(word[at]))) ++at;
    return at - from;
  };
  if (at < word.size() && (word[at] == '+' || word[at] == '-')) ++at;
  digits = take_digits();
  if (at < word.size() && word[at] == '.') {
    ++at;
    digits += take_digits();
  }
  if (digits == 0) return false;
  if (at < word.size() && (word[at] == 'e' || word[at] == 'E')) {
    ++at;
    if (at < word.size() && (word[at] == '+' || word[at] == '-')) ++at;
    const size_t exponent = take_digits();
    if (exponent == 0 || exponent > 4) return false;
  }
  return at == word.size();
}

// ------------------------------------------------------------------------------------------- materials

struct Material {
  std::array<double, 3> color = {1, 1, 1};
  bool has_color = false;  // the file sets it
  std::array<double, 3> emission = {0, 0, 0};
  bool transparent = false;
  std::string picture;  // its name; empty: none
  size_t library = 0;   // the file that names it
  std::array<double, 2> scale = {1, 1}, offset = {0, 0};
  bool clamp = false;
  std::vector<const char*> left_out;  // kinds of ignored maps
};

// Returns a map statement whose options have as many numbers as the library expects.
std::string MapWithFullOptions(absl::string_view rest) {
  std::string out;
  while (true) {
    absl::string_view after = rest;
    const absl::string_view word = TakeWord(&after);
    if (!absl::StartsWith(word, "-")) break;
    rest = after;
    absl::StrAppend(&out, " ", word);
    if (word == "-o" || word == "-s" || word == "-t") {
      for (int i = 0; i < 3; ++i) {
        after = rest;
        const absl::string_view number = TakeWord(&after);
        // A picture may be called "2".
        if (IsNumber(number) && !Trim(after).empty()) {
          absl::StrAppend(&out, " ", number);
          rest = after;
        } else {
          absl::StrAppend(&out, word == "-s" ? " 1" : " 0");
        }
      }
    } else {
      absl::StrAppend(&out, " ", TakeWord(&rest));
      if (word == "-mm") absl::StrAppend(&out, " ", TakeWord(&rest));
    }
  }
  return absl::StrCat(out, " ", Trim(rest));
}

// Returns the text of an .mtl file in the form that the library reads correctly.
std::string PrepareMtl(absl::string_view text) {
  std::string out;
  Lines lines(text);
  for (absl::string_view line; lines.Next(&line);) {
    absl::string_view rest = line;
    const absl::string_view key = TakeWord(&rest);
    if (key.empty()) continue;
    if (key == "Kd" || key == "Ke") {
      absl::string_view numbers = rest;
      const absl::string_view r = TakeWord(&numbers), g = TakeWord(&numbers),
                              b = TakeWord(&numbers);
      if (!IsNumber(r)) {
        absl::StrAppend(&out, "spectral 1\n");
        continue;
      }
      // One number applies to all three channels.
      absl::StrAppend(&out, key, " ", r, " ", IsNumber(g) ? g : r, " ", IsNumber(b) ? b : r, "\n");
      if (key == "Kd") absl::StrAppend(&out, "has_Kd 1\n");
    } else if (absl::StartsWith(key, "map_") || key == "bump" || key == "disp" || key == "refl" ||
               key == "norm") {
      absl::StrAppend(&out, key, MapWithFullOptions(rest), "\n");
    } else if (key == "d") {
      absl::string_view word = TakeWord(&rest);
      if (word == "-halo") word = TakeWord(&rest);
      absl::StrAppend(&out, "d ", word, "\n");
    } else {
      absl::StrAppend(&out, key, " ", Trim(rest), "\n");
    }
  }
  return out;
}

Material FromLibrary(const tinyobj::material_t& read) {
  Material material;
  material.has_color = read.unknown_parameter.contains("has_Kd");
  if (material.has_color) std::copy_n(read.diffuse, 3, material.color.begin());
  std::copy_n(read.emission, 3, material.emission.begin());
  material.transparent = read.dissolve < 1;
  material.picture = read.diffuse_texname;
  const tinyobj::texture_option_t& options = read.diffuse_texopt;
  material.scale = {options.scale[0], options.scale[1]};
  material.offset = {options.origin_offset[0], options.origin_offset[1]};
  material.clamp = options.clamp;
  const auto add = [&](const char* kind, const std::string& name) {
    if (!name.empty()) material.left_out.push_back(kind);
  };
  add("bump maps", read.bump_texname);
  add("bump maps", read.normal_texname);
  add("bump maps", read.displacement_texname);
  add("opacity maps", read.alpha_texname);
  add("emission maps", read.emissive_texname);
  for (const std::string* name :
       {&read.specular_texname, &read.specular_highlight_texname, &read.reflection_texname,
        &read.roughness_texname, &read.metallic_texname, &read.sheen_texname})
    add("maps of gloss and reflection", *name);
  if (read.ambient_texname != read.diffuse_texname) add("ambient maps", read.ambient_texname);
  if (read.unknown_parameter.contains("spectral")) material.left_out.push_back("spectral colours");
  if (options.brightness != 0 || options.contrast != 1 || options.turbulence[0] != 0)
    material.left_out.push_back("brightness and turbulence of textures");
  return material;
}

// ------------------------------------------------------------------------------------------ statements

// The common properties of the elements of one part.
struct Group {
  Kind kind = Kind::kTriangles;
  uint32_t material = kNone;  // the number of its name
  double crease = kCreaseDegrees;
  bool has_coordinates = false, has_normals = false;
  auto operator<=>(const Group&) const = default;
};

// Indices of positions, texture coordinates and normals, from 0; kNone if missing.
using CornerKey = std::array<uint32_t, 3>;

struct Polygons {
  std::vector<CornerKey> corners;
  std::vector<uint32_t> sizes;  // of each polygon, line or set of points
};

struct Totals {
  int64_t positions = 0, coordinates = 0, normals = 0;
};

// Gives the library one statement at a time, so that each callback belongs to that statement.
class Statements final : public std::streambuf {
 public:
  Statements(const SourceFile& file, const Totals& totals, Model* model)
      : file_(file), totals_(totals), model_(model), lines_(file.bytes) {}

  // Reads the file through the library.
  absl::Status Read();
  absl::Status Build();

 private:
  int_type underflow() override;
  void Prepare(absl::string_view line);
  void PreparePosition(absl::string_view rest);
  void PrepareNumbers(absl::string_view key, absl::string_view rest, size_t least,
                      const char* kind);
  void PrepareElement(absl::string_view rest);
  bool CheckReference(absl::string_view word);
  void NoteMissing(absl::string_view name);
  void LoadMaterials(absl::string_view names);
  bool LoadMaterialFile(const std::string& name);
  uint32_t Resolve(int index, size_t so_far, int64_t total, const char* what);
  void AddElement(const tinyobj::index_t* indices, int count);
  void Fail(absl::string_view found, absl::string_view expected) {
    if (status_.ok())
      status_ = FileError(file_, absl::StrCat("line ", lines_.number(), " ", found), expected);
  }

  void AddCloud();
  void AddPart(const Group& group, const Polygons& polygons);
  void AddColors(const Material* material, const std::vector<CornerKey>& keys, Part* part);
  bool AddPicture(const Material& material, const std::vector<CornerKey>& keys, Part* part);
  uint32_t PictureOf(const Material& material);

  const SourceFile& file_;
  const Totals totals_;
  Model* const model_;
  Lines lines_;
  std::string prepared_;
  absl::Status status_;

  std::vector<Point3> positions_, normals_;
  std::vector<std::array<float, 3>> colors_;  // one per position, or none
  std::vector<std::array<float, 2>> coordinates_;
  bool color_follows_ = false;
  bool has_colors_ = false;
  float greatest_color_ = 0;

  Group group_;
  std::map<Group, Polygons> groups_;
  uint64_t corners_ = 0;
  std::map<std::string, uint32_t> names_;  // of used materials
  std::map<std::string, Material> materials_;
  // By number in names_; null if no file defines it.
  std::vector<const Material*> materials_by_number_;
  bool has_missing_ = false;  // a file that this one names cannot be read
  std::vector<SourceFile> libraries_;
  std::map<std::pair<size_t, std::string>, uint32_t> pictures_;
  Triangulator triangulator_;
};

Statements::int_type Statements::underflow() {
  prepared_.clear();
  for (absl::string_view line; prepared_.empty() && status_.ok() && lines_.Next(&line);)
    Prepare(line);
  if (prepared_.empty() || !status_.ok()) return traits_type::eof();
  setg(prepared_.data(), prepared_.data(), prepared_.data() + prepared_.size());
  return traits_type::to_int_type(prepared_.front());
}

bool IsOneOf(absl::string_view key, std::initializer_list<absl::string_view> keys) {
  return std::find(keys.begin(), keys.end(), key) != keys.end();
}

void Statements::Prepare(absl::string_view line) {
  absl::string_view rest = line;
  const absl::string_view key = TakeWord(&rest);
  if (key.empty()) return;
  if (key == "v") return PreparePosition(rest);
  if (key == "vn") return PrepareNumbers("vn", rest, 3, "normals that are not numbers");
  if (key == "vt") return PrepareNumbers("vt", rest, 1, "texture coordinates that are not numbers");
  if (key == "f" || key == "fo" || key == "l" || key == "p") {
    group_.kind = key == "l" ? Kind::kSegments : key == "p" ? Kind::kPoints : Kind::kTriangles;
    return PrepareElement(rest);
  }
  if (key == "usemtl") {
    if (names_.size() >= kMostNames) return;
    const auto next = static_cast<uint32_t>(names_.size());
    group_.material = names_.try_emplace(std::string(Trim(rest)), next).first->second;
  } else if (key == "mtllib") {
    LoadMaterials(Trim(rest));
  } else if (key == "s") {
    const absl::string_view group = TakeWord(&rest);
    group_.crease = group == "off" || group == "0" ? 0 : 180;
  } else if (IsOneOf(key, {"curv", "cdc", "cdp"})) {
    AddLeftOut("free-form curves", 1, model_);
  } else if (IsOneOf(key, {"surf", "bsp", "bzp"})) {
    AddLeftOut("free-form surfaces", 1, model_);
  } else if (IsOneOf(key, {"usemap", "maplib"})) {
    AddLeftOut("texture maps apart from materials", key == "usemap" ? 1 : 0, model_);
  } else if (!IsOneOf(key, {// Names, and how they are drawn.
                            "g", "o", "bevel", "c_interp", "d_interp", "lod", "shadow_obj",
                            "trace_obj", "mg",
                            // Parts of free-form curves and surfaces.
                            "vp", "cstype", "deg", "bmat", "step", "curv2", "parm", "trim", "hole",
                            "scrv", "sp", "end", "con", "ctech", "stech", "res"})) {
    AddLeftOut("unknown statements", 1, model_);
  }
}

void Statements::PreparePosition(absl::string_view rest) {
  std::array<absl::string_view, 8> words;
  size_t count = 0;
  for (absl::string_view word = TakeWord(&rest); !word.empty() && count < words.size();
       word = TakeWord(&rest))
    words[count++] = word;
  for (size_t i = 0; i < count; ++i) {
    if (!IsNumber(words[i])) {
      return Fail(
          absl::StrCat("has the number \"", EscapeForTerminal(words[i].substr(0, 24)), "\""),
          "finite decimal numbers are expected");
    }
  }
  // After x, y and z follows a weight, or red, green and blue, perhaps with an opacity.
  const bool has_color = count == 6 || count == 7;
  absl::StrAppend(&prepared_, "v ", words[0], " ", words[1], " ", words[2], "\n");
  if (has_color) absl::StrAppend(&prepared_, "vn ", words[3], " ", words[4], " ", words[5], "\n");
  if (count == 5 || count == 8) AddLeftOut("further numbers of vertices", 1, model_);
  color_follows_ = has_color;
}

// A word that is not a number becomes 0, and the statement is counted as `kind`.
void Statements::PrepareNumbers(absl::string_view key, absl::string_view rest, size_t least,
                                const char* kind) {
  absl::StrAppend(&prepared_, key);
  size_t bad = 0;
  for (size_t count = 0; count < 3; ++count) {
    const absl::string_view word = TakeWord(&rest);
    if (word.empty() && count >= least) break;
    bad += IsNumber(word) ? 0 : 1;
    absl::StrAppend(&prepared_, " ", IsNumber(word) ? word : "0");
  }
  absl::StrAppend(&prepared_, "\n");
  AddLeftOut(kind, bad > 0 ? 1 : 0, model_);
}

// The library parses references with atoi, which checks nothing.
bool Statements::CheckReference(absl::string_view word) {
  absl::string_view left = word;
  for (int part = 0; part < 3; ++part) {
    const absl::string_view index = left.substr(0, left.find('/'));
    int value = 0;
    const auto parsed = std::from_chars(index.data(), index.data() + index.size(), value);
    const bool whole = parsed.ec == std::errc() && parsed.ptr == index.data() + index.size();
    // "1//2" has no texture coordinates; some programs write "1/" and "1/2/".
    if (!whole && (part == 0 || !index.empty())) break;
    if (whole && value == 0 && part > 0) break;
    if (index.size() == left.size()) return true;
    left.remove_prefix(index.size() + 1);
  }
  Fail(absl::StrCat("refers to vertex \"", EscapeForTerminal(word.substr(0, 24)), "\""),
       "a vertex number is expected, as in 3, 3/1 or 3/1/2");
  return false;
}

void Statements::PrepareElement(absl::string_view rest) {
  absl::StrAppend(&prepared_, "f");
  size_t count = 0;
  for (absl::string_view word = TakeWord(&rest); !word.empty(); word = TakeWord(&rest), ++count) {
    if (!CheckReference(word)) return;
    absl::StrAppend(&prepared_, " ", word);
  }
  absl::StrAppend(&prepared_, "\n");
  const size_t least = group_.kind == Kind::kTriangles ? 3 : group_.kind == Kind::kSegments ? 2 : 1;
  if (count >= least) return;
  prepared_.clear();
  AddLeftOut("faces and lines with too few corners", 1, model_);
}

bool Statements::LoadMaterialFile(const std::string& name) {
  absl::StatusOr<SourceFile> library = ReadOtherFile(file_, name);
  if (!library.ok() && absl::StrContains(name, '\\'))
    library = ReadOtherFile(file_, absl::StrReplaceAll(name, {{"\\", "/"}}));
  if (!library.ok()) return false;
  std::istringstream text(PrepareMtl(library->bytes));
  std::map<std::string, int> numbers;
  std::vector<tinyobj::material_t> materials;
  std::string warning, error;
  tinyobj::LoadMtl(&numbers, &materials, &text, &warning, &error);
  for (const tinyobj::material_t& read : materials) {
    Material material = FromLibrary(read);
    material.library = libraries_.size();
    materials_.try_emplace(std::string(Trim(read.name)), std::move(material));
  }
  library->bytes.clear();
  libraries_.push_back(*std::move(library));
  return true;
}

// Names the first file that cannot be read.
void Statements::NoteMissing(absl::string_view name) {
  if (std::exchange(has_missing_, true)) return;
  AddNote(absl::StrCat("cannot read ", EscapeForTerminal(name.substr(0, 80)),
                       ", which it names; put it beside the file"),
          model_);
}

// The names are one name that may contain blanks, or several without.
void Statements::LoadMaterials(absl::string_view names) {
  const bool quoted = names.size() > 2 && names.front() == '"' && names.back() == '"';
  if (quoted) names = names.substr(1, names.size() - 2);
  if (names.empty() || LoadMaterialFile(std::string(names))) return;
  uint64_t missing = 0;
  absl::string_view rest = names;
  for (absl::string_view name = TakeWord(&rest); !name.empty(); name = TakeWord(&rest)) {
    if (LoadMaterialFile(std::string(name))) continue;
    ++missing;
    NoteMissing(name);
  }
  AddLeftOut("material files that cannot be read", missing, model_);
}

uint32_t Statements::Resolve(int index, size_t so_far, int64_t total, const char* what) {
  // Negative numbers count backwards from the line.
  const int64_t number =
      index < 0 ? static_cast<int64_t>(so_far) + index : static_cast<int64_t>(index) - 1;
  if (number >= 0 && number < total) return static_cast<uint32_t>(number);
  Fail(absl::StrCat("refers to ", what, " ", index),
       absl::StrCat("the file has ", what == absl::string_view("vertex") ? "vertices" : what,
                    " 1 to ", total, ": it is truncated or damaged"));
  return 0;
}

void Statements::AddElement(const tinyobj::index_t* indices, int count) {
  corners_ += static_cast<uint64_t>(count);
  if (corners_ > kMaxModelIndices) {
    return Fail(absl::StrCat("has corner ", corners_),
                absl::StrCat("at most ", kMaxModelIndices, " are read"));
  }
  group_.has_coordinates = group_.has_normals = group_.kind == Kind::kTriangles;
  for (int i = 0; i < count; ++i) {
    group_.has_coordinates &= indices[i].texcoord_index != 0;
    group_.has_normals &= indices[i].normal_index != 0;
  }
  Group group = group_;
  if (group.has_normals || group.kind != Kind::kTriangles) group.crease = 0;
  Polygons& polygons = groups_[group];
  for (int i = 0; i < count; ++i) {
    CornerKey corner = {kNone, kNone, kNone};
    corner[0] = Resolve(indices[i].vertex_index, positions_.size(), totals_.positions, "vertex");
    if (group.has_coordinates)
      corner[1] = Resolve(indices[i].texcoord_index, coordinates_.size(), totals_.coordinates,
                          "texture coordinates");
    if (group.has_normals)
      corner[2] = Resolve(indices[i].normal_index, normals_.size(), totals_.normals, "normals");
    polygons.corners.push_back(corner);
  }
  polygons.sizes.push_back(static_cast<uint32_t>(count));
}

absl::Status Statements::Read() {
  tinyobj::callback_t calls;
  calls.vertex_cb = [](void* self, double x, double y, double z, double) {
    auto* const to = static_cast<Statements*>(self);
    to->positions_.push_back({x, y, z});
    if (to->has_colors_) to->colors_.push_back({1, 1, 1});
  };
  calls.normal_cb = [](void* self, double x, double y, double z) {
    auto* const to = static_cast<Statements*>(self);
    if (!to->color_follows_) {
      to->normals_.push_back(Direction({x, y, z}));
      return;
    }
    to->color_follows_ = false;
    if (!to->has_colors_) to->colors_.assign(to->positions_.size(), {1, 1, 1});
    to->has_colors_ = true;
    to->colors_.back() = {static_cast<float>(x), static_cast<float>(y), static_cast<float>(z)};
    to->greatest_color_ = std::max(
        {to->greatest_color_, to->colors_.back()[0], to->colors_.back()[1], to->colors_.back()[2]});
  };
  calls.texcoord_cb = [](void* self, double x, double y, double) {
    static_cast<Statements*>(self)->coordinates_.push_back(
        {static_cast<float>(x), static_cast<float>(y)});
  };
  calls.index_cb = [](void* self, tinyobj::index_t* indices, int count) {
    static_cast<Statements*>(self)->AddElement(indices, count);
  };
  std::istream stream(this);
  tinyobj::LoadObjWithCallback(stream, calls, this);
  return status_;
}

// ----------------------------------------------------------------------------------------------- parts

void Statements::AddCloud() {
  Part part{.kind = Kind::kPoints, .positions = std::move(positions_)};
  std::vector<CornerKey> keys(part.positions.size());
  for (uint32_t i = 0; i < keys.size(); ++i) keys[i] = {i, kNone, kNone};
  AddColors(nullptr, keys, &part);
  model_->parts.push_back(std::move(part));
}

void Statements::AddColors(const Material* material, const std::vector<CornerKey>& keys,
                           Part* part) {
  const bool has_base = material != nullptr && (material->has_color || !material->picture.empty());
  const std::optional<std::array<double, 3>> base =
      BaseColor(has_base ? std::optional(material->color) : std::nullopt,
                material != nullptr && IsLit(material->emission), has_colors_);
  if (!base) return;
  // Some programs write vertex colours from 0 to 255.
  const double scale = greatest_color_ > 1 ? 255 : 1;
  const std::array<double, 3> light = material == nullptr || part->picture != kNoPicture
                                          ? std::array<double, 3>{0, 0, 0}
                                          : material->emission;
  part->colors.reserve(keys.size());
  for (const CornerKey& key : keys) {
    std::array<uint8_t, 3> bytes;
    for (size_t c = 0; c < 3; ++c) {
      const double own = has_colors_ ? colors_[key[0]][c] / scale : 1;
      bytes[c] = ColorByte((*base)[c] * own + light[c], false);
    }
    part->colors.push_back({bytes[0], bytes[1], bytes[2]});
  }
}

uint32_t Statements::PictureOf(const Material& material) {
  const auto [at, is_new] = pictures_.try_emplace({material.library, material.picture}, kNoPicture);
  if (!is_new) return at->second;
  const SourceFile& library = libraries_[material.library];
  const std::string slashes = absl::StrReplaceAll(material.picture, {{"\\", "/"}});
  absl::StatusOr<SourceFile> picture = ReadOtherFile(library, material.picture);
  if (!picture.ok()) picture = ReadOtherFile(library, slashes);
  // The name may be a path on the computer that wrote the file.
  if (!picture.ok())
    picture = ReadOtherFile(library, std::filesystem::path(slashes).filename().string());
  if (!picture.ok()) {
    AddLeftOut("textures that cannot be read", 1, model_);
    NoteMissing(material.picture);
  } else if (!IsPicture(picture->bytes)) {
    AddLeftOut("textures that are neither PNG nor JPEG", 1, model_);
  } else {
    at->second = static_cast<uint32_t>(model_->pictures.size());
    model_->pictures.push_back(std::move(picture->bytes));
  }
  return at->second;
}

bool Statements::AddPicture(const Material& material, const std::vector<CornerKey>& keys,
                            Part* part) {
  part->picture = PictureOf(material);
  if (part->picture == kNoPicture) return false;
  part->texture_coordinates.reserve(keys.size());
  for (const CornerKey& key : keys) {
    const std::array<float, 2>& at = coordinates_[key[1]];
    // v points up in OBJ, and down in a model.
    part->texture_coordinates.push_back(
        {static_cast<float>(at[0] * material.scale[0] + material.offset[0]),
         static_cast<float>(1 - (at[1] * material.scale[1] + material.offset[1]))});
  }
  return true;
}

void Statements::AddPart(const Group& group, const Polygons& polygons) {
  Part part{.kind = group.kind};
  std::vector<CornerKey> keys;  // of the part's vertices
  absl::flat_hash_map<CornerKey, uint32_t> vertices;
  std::vector<uint32_t> corners, triangles;
  std::vector<Point3> outline;
  size_t at = 0;
  for (const uint32_t size : polygons.sizes) {
    corners.clear();
    for (uint32_t i = 0; i < size; ++i) {
      const CornerKey& key = polygons.corners[at++];
      const auto [vertex, is_new] = vertices.try_emplace(key, static_cast<uint32_t>(keys.size()));
      if (is_new) {
        keys.push_back(key);
        part.positions.push_back(positions_[key[0]]);
        if (group.has_normals) part.normals.push_back(normals_[key[2]]);
      }
      corners.push_back(vertex->second);
    }
    if (group.kind == Kind::kSegments) {
      for (uint32_t i = 1; i < size; ++i)
        part.indices.insert(part.indices.end(), {corners[i - 1], corners[i]});
    } else if (group.kind == Kind::kTriangles) {
      outline.clear();
      for (const uint32_t corner : corners) outline.push_back(part.positions[corner]);
      triangles.clear();
      triangulator_.Append(outline, &triangles);
      for (const uint32_t corner : triangles) part.indices.push_back(corners[corner]);
    }
  }
  const Material* const material =
      group.material == kNone ? nullptr : materials_by_number_[group.material];
  if (material != nullptr && !material->picture.empty() && group.kind == Kind::kTriangles) {
    if (!group.has_coordinates) {
      AddLeftOut("textures without coordinates", 1, model_);
    } else if (AddPicture(*material, keys, &part) && material->clamp) {
      AddLeftOut("triangles across the edge of a picture that does not repeat",
                 ApplyWrap(Wrap::kClamp, Wrap::kClamp, &part), model_);
    }
  }
  AddColors(material, keys, &part);
  if (group.kind == Kind::kTriangles) {
    AddLeftOut("triangles without an area", DropEmptyTriangles(&part), model_);
    if (part.indices.empty()) return;
    if (!group.has_normals) AddNormals(group.crease, &part);
  }
  model_->parts.push_back(std::move(part));
}

absl::Status Statements::Build() {
  const auto finite = [](const std::array<float, 2>& at) {
    return std::isfinite(at[0]) && std::isfinite(at[1]);
  };
  if (!std::all_of(coordinates_.begin(), coordinates_.end(), finite))
    return FileError(file_, "has texture coordinates out of range", "finite numbers are expected");
  if (groups_.empty()) {
    AddCloud();
    return absl::OkStatus();
  }
  materials_by_number_.assign(names_.size(), nullptr);
  // "Wire #25" may be a name, and "red # paint" a name with a comment, so whole names are tried
  // first.
  std::map<absl::string_view, const Material*> without_comments;
  for (const auto& [name, material] : materials_)
    without_comments.try_emplace(WithoutComment(name), &material);
  for (const auto& [name, number] : names_) {
    if (const auto found = materials_.find(name); found != materials_.end()) {
      materials_by_number_[number] = &found->second;
      continue;
    }
    const auto found = without_comments.find(WithoutComment(name));
    if (found != without_comments.end()) materials_by_number_[number] = found->second;
  }
  for (auto& [group, polygons] : groups_) {
    AddPart(group, polygons);
    polygons = {};
  }
  uint64_t undefined = 0;
  for (const Material* const one : materials_by_number_) {
    if (one == nullptr) {
      ++undefined;
      continue;
    }
    const Material& material = *one;
    AddLeftOut("transparency of materials", material.transparent ? 1 : 0, model_);
    for (const char* kind : material.left_out) AddLeftOut(kind, 1, model_);
    AddLeftOut("emission over pictures",
               IsLit(material.emission) && !material.picture.empty() ? 1 : 0, model_);
  }
  AddLeftOut("materials that no file defines", undefined, model_);
  return absl::OkStatus();
}

// Counts the items that references may refer to, because these may follow the references.
absl::StatusOr<Totals> Count(const SourceFile& file) {
  Totals totals;
  Lines lines(file.bytes);
  for (absl::string_view line; lines.Next(&line);) {
    const absl::string_view key = TakeWord(&line);
    if (key == "vt") ++totals.coordinates;
    if (key == "vn") ++totals.normals;
    if (key != "v") continue;
    for (int i = 0; i < 3; ++i) {
      if (TakeWord(&line).empty()) {
        return FileError(file,
                         absl::StrCat("vertex ", totals.positions + 1, " in line ", lines.number(),
                                      " has ", i, i == 1 ? " coordinate" : " coordinates"),
                         "three are expected: the file is truncated or damaged");
      }
    }
    ++totals.positions;
  }
  if (totals.positions == 0) {
    return FileError(file, absl::StrCat("is ", DescribeContents(file.bytes), ", with no vertex"),
                     kExpected);
  }
  for (const int64_t count : {totals.positions, totals.coordinates, totals.normals}) {
    if (count > static_cast<int64_t>(kMaxModelVertices)) {
      return FileError(file, absl::StrCat("has ", count, " vertices"),
                       absl::StrCat("at most ", kMaxModelVertices, " are read"));
    }
  }
  return totals;
}

}  // namespace

absl::StatusOr<Model> ReadObjModel(const SourceFile& file) {
  const absl::string_view text = file.bytes;
  if (absl::StartsWith(text, "\xff\xfe") || absl::StartsWith(text, "\xfe\xff"))
    return FileError(file, "is UTF-16 text", "UTF-8 is read; convert it");
  if (text.find('\0') != absl::string_view::npos)
    return FileError(file, absl::StrCat("is ", DescribeContents(text)), kExpected);
  const absl::StatusOr<Totals> totals = Count(file);
  if (!totals.ok()) return totals.status();
  Model model;
  model.path = file.path;
  model.format = "Wavefront OBJ";
  model.up = Up::kY;
  Statements statements(file, *totals, &model);
  if (absl::Status status = statements.Read(); !status.ok()) return status;
  if (absl::Status status = statements.Build(); !status.ok()) return status;
  return model;
}

}  // namespace voxeld::voxelctl
