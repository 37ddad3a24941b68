#include "tools/voxelctl/import/molecule.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <optional>
#include <string>
#include <unordered_map>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "absl/strings/strip.h"
#include "common/text/printable.h"

namespace voxeld::voxelctl {
namespace {

// In ångström.
constexpr double kFarthestAtom = 1e6;
// Maximum excess and minimum of a bond's length.
constexpr double kBondSlack = 0.45, kNearestAtom = 0.4;
constexpr double kHydrogen = 0.35;  // larger radii are not hydrogen's
constexpr double kRodDiameter = 0.3,
                 kBallShare = 0.25;  // a rod's diameter; a ball's share of its atom
// The number of atoms per cell, by density: up to twenty times as many per cubic ångström as in a
// crystal with its hydrogens.
constexpr double kMostDense = 2.2, kMostSparse = 16;

constexpr double kNoAtomValue = std::numeric_limits<double>::quiet_NaN();

// Finds bonds by distance, with a grid whose cells are as large as the longest bond, so that only
// neighbouring cells are compared.
class BondSearch {
 public:
  explicit BondSearch(const std::vector<MoleculeAtom>& atoms) : atoms_(atoms) {
    double largest = 0.5;
    for (const MoleculeAtom& atom : atoms) {
      if (atom.element->bonds) largest = std::max(largest, atom.element->covalent);
    }
    side_ = 2 * largest + kBondSlack;
  }

  absl::Status Run(const SourceFile& file, std::vector<std::array<uint32_t, 2>>* bonds);

 private:
  using Cell = std::array<int64_t, 3>;
  Cell CellOf(const Point3& p) const {
    return {static_cast<int64_t>(std::floor(p.x / side_)),
            static_cast<int64_t>(std::floor(p.y / side_)),
            static_cast<int64_t>(std::floor(p.z / side_))};
  }
  // 21 bits per axis are enough for kFarthestAtom.
  static uint64_t Key(const Cell& cell) {
    constexpr int64_t kMiddle = int64_t{1} << 20;
    uint64_t key = 0;
    for (const int64_t part : cell) key = key << 21 | static_cast<uint64_t>(part + kMiddle);
    return key;
  }
  bool AreBound(uint32_t a, uint32_t b) const {
    const ChemicalElement &first = *atoms_[a].element, &second = *atoms_[b].element;
    if (first.covalent < kHydrogen && second.covalent < kHydrogen) return false;
    const Point3 &p = atoms_[a].at, &q = atoms_[b].at;
    const double x = p.x - q.x, y = p.y - q.y, z = p.z - q.z;
    const double apart = x * x + y * y + z * z;
    const double most = first.covalent + second.covalent + kBondSlack;
    return apart > kNearestAtom * kNearestAtom && apart < most * most;
  }

  const std::vector<MoleculeAtom>& atoms_;
  double side_ = 0;
};

absl::Status BondSearch::Run(const SourceFile& file, std::vector<std::array<uint32_t, 2>>* bonds) {
  std::vector<std::pair<uint64_t, uint32_t>> sorted;
  for (uint32_t i = 0; i < atoms_.size(); ++i) {
    if (atoms_[i].element->bonds) sorted.emplace_back(Key(CellOf(atoms_[i].at)), i);
  }
  std::sort(sorted.begin(), sorted.end());
  std::unordered_map<uint64_t, std::pair<size_t, size_t>> cells;
  const auto most = static_cast<size_t>(kMostSparse + kMostDense * side_ * side_ * side_);
  for (size_t begin = 0; begin < sorted.size();) {
    size_t end = begin;
    while (end < sorted.size() && sorted[end].first == sorted[begin].first) ++end;
    if (end - begin > most) {
      const Point3& p = atoms_[sorted[begin].second].at;
      return FileError(
          file,
          absl::StrCat("has more than ", most, " atoms near (", p.x, ", ", p.y, ", ", p.z, ")"),
          "coordinates in ångström are expected");
    }
    cells.emplace(sorted[begin].first, std::pair(begin, end));
    begin = end;
  }
  for (const auto& [key, range] : cells) {
    const Cell cell = CellOf(atoms_[sorted[range.first].second].at);
    // Each pair of cells is visited once: from the cell with the lower key.
    for (int64_t n = 0; n < 27; ++n) {
      const uint64_t other =
          Key({cell[0] + n % 3 - 1, cell[1] + n / 3 % 3 - 1, cell[2] + n / 9 - 1});
      if (other < key) continue;
      const auto there = cells.find(other);
      if (there == cells.end()) continue;
      for (size_t a = range.first; a < range.second; ++a) {
        for (size_t b = other == key ? a + 1 : there->second.first; b < there->second.second; ++b) {
          if (AreBound(sorted[a].second, sorted[b].second))
            bonds->push_back({sorted[a].second, sorted[b].second});
        }
      }
      if (bonds->size() > kMaxModelVertices / 4) {
        return FileError(file, absl::StrCat("has more than ", kMaxModelVertices / 4, " bonds"),
                         "so large a molecule is not read");
      }
    }
  }
  return absl::OkStatus();
}

void AddAtomAttributes(const Molecule& molecule, Part* part) {
  for (const Attribute& all : molecule.attributes) part->attributes.push_back({all.name, {}});
}

void AddAtomVertex(const Molecule& molecule, uint32_t atom, const Point3& at, Part* part) {
  part->positions.push_back(at);
  part->colors.push_back(molecule.atoms[atom].element->color);
  for (size_t i = 0; i < part->attributes.size(); ++i)
    part->attributes[i].values.push_back(molecule.attributes[i].values[atom]);
}

void AddRods(const Molecule& molecule, Model* model) {
  Part part{.kind = Kind::kSegments};
  part.thickness = kRodDiameter;
  AddAtomAttributes(molecule, &part);
  for (const auto& [a, b] : molecule.bonds) {
    const Point3 &from = molecule.atoms[a].at, &to = molecule.atoms[b].at;
    const Point3 middle = {(from.x + to.x) / 2, (from.y + to.y) / 2, (from.z + to.z) / 2};
    for (const uint32_t end : {a, b}) {
      for (const Point3& p : {molecule.atoms[end].at, middle}) {
        part.indices.push_back(static_cast<uint32_t>(part.positions.size()));
        AddAtomVertex(molecule, end, p, &part);
      }
    }
  }
  if (!part.positions.empty()) model->parts.push_back(std::move(part));
}

// All points of one part have the same thickness.
void AddBalls(const Molecule& molecule, MoleculeStyle style, Model* model) {
  std::map<double, Part> parts;
  for (uint32_t i = 0; i < molecule.atoms.size(); ++i) {
    const double diameter = 2 * molecule.atoms[i].element->van_der_waals *
                            (style == MoleculeStyle::kBalls ? kBallShare : 1);
    const auto [it, is_new] = parts.try_emplace(diameter);
    Part& part = it->second;
    if (is_new) {
      part.kind = Kind::kPoints;
      part.thickness = diameter;
      AddAtomAttributes(molecule, &part);
    }
    AddAtomVertex(molecule, i, molecule.atoms[i].at, &part);
  }
  for (auto& [diameter, part] : parts) model->parts.push_back(std::move(part));
}

using XyzWords = std::vector<absl::string_view>;

XyzWords XyzWordsOf(absl::string_view line) {
  return absl::StrSplit(line, absl::ByAnyChar(" \t"), absl::SkipEmpty());
}

// The lines of a text without line ends and surrounding blanks.
class XyzLines {
 public:
  explicit XyzLines(absl::string_view text) : rest_(text) {
    absl::ConsumePrefix(&rest_, "\xef\xbb\xbf");
  }
  bool Next(absl::string_view* line) {
    if (rest_.empty()) return false;
    *line = absl::StripAsciiWhitespace(TakeLine(&rest_));
    ++number_;
    return true;
  }
  size_t number() const { return number_; }

 private:
  absl::string_view rest_;
  size_t number_ = 0;
};

std::optional<uint64_t> AtomCountOf(absl::string_view line) {
  uint64_t count = 0;
  if (line.empty() || !std::all_of(line.begin(), line.end(), absl::ascii_isdigit) ||
      !absl::SimpleAtoi(line, &count))
    return std::nullopt;
  return count;
}

std::optional<double> XyzNumber(absl::string_view word) {
  std::string text(word);
  // Fortran writes double precision with a D.
  for (char& c : text) {
    if (c == 'd' || c == 'D') c = 'e';
  }
  double value = 0;
  if (!absl::SimpleAtod(text, &value)) return std::nullopt;
  return value;
}

// How the first column of chemistry's XYZ says which element an atom is.
enum class XyzSpelling : uint8_t {
  kSymbol,  // "Ca", "CL", "Fe2" or a number of protons
  kEither,  // "CA": calcium, or the alpha carbon of a protein
  kName,    // "CA1", "OW", "HG11": the element is the first letter
};

struct XyzElement {
  const ChemicalElement* element = nullptr;  // null if the word is not an element
  XyzSpelling spelling = XyzSpelling::kSymbol;
};

// Returns whether a symbol in capitals is more likely the name of an atom: a letter for the
// element, and one for the place in a residue. Symbols that are not used as names ("FE1", "CL2")
// are not among them.
bool IsXyzName(absl::string_view capitals) {
  static constexpr absl::string_view kNames =
      " CA CD CE CF CM CN HE HF HG HO HS NA NB ND NE NH NO NP OG PA PB PD SB SG ";
  return absl::StrContains(kNames, absl::StrCat(" ", capitals, " "));
}

// Returns the element of a name; UnknownElement() for dummy atoms and unknown names.
const ChemicalElement* ElementOfFirstLetter(absl::string_view word) {
  const ChemicalElement* element = FindElement(word.substr(0, 1));
  return element != nullptr ? element : &UnknownElement();
}

XyzElement XyzElementOf(absl::string_view word) {
  if (const std::optional<uint64_t> number = AtomCountOf(word))
    return {*number > 0 && *number <= 118 ? FindElement(static_cast<int>(*number)) : nullptr};
  size_t letters = 0;
  while (letters < word.size() && absl::ascii_isalpha(static_cast<unsigned char>(word[letters])))
    ++letters;
  if (letters == 0) return {};
  const ChemicalElement* symbol = FindElement(word.substr(0, letters));
  if (symbol == nullptr || (letters < word.size() && IsXyzName(word.substr(0, letters)))) {
    const ChemicalElement* element = ElementOfFirstLetter(word);
    const bool is_known = element != &UnknownElement();
    return {element, is_known ? XyzSpelling::kName : XyzSpelling::kSymbol};
  }
  return {symbol, IsXyzName(word) ? XyzSpelling::kEither : XyzSpelling::kSymbol};
}

bool IsXyzAtom(const XyzWords& words, bool by_number) {
  return words.size() >= 4 && XyzElementOf(words[0]).element != nullptr &&
         AtomCountOf(words[0]).has_value() == by_number && XyzNumber(words[1]) &&
         XyzNumber(words[2]) && XyzNumber(words[3]);
}

// The columns of extended XYZ, given by its comment.
struct XyzLayout {
  size_t element = 0, place = 1;
  std::vector<std::pair<size_t, std::string>> others;  // columns of numbers and their names
};

// Reads a comment such as Properties=species:S:1:pos:R:3:charge:R:1. Returns false if it does not
// name an element and a position.
bool ReadXyzProperties(absl::string_view comment, XyzLayout* layout) {
  const size_t begin = comment.find("Properties=");
  if (begin == absl::string_view::npos) return false;
  absl::string_view list = comment.substr(begin + 11);
  absl::ConsumePrefix(&list, "\"");
  list = list.substr(0, list.find_first_of(" \t\""));
  const XyzWords fields = absl::StrSplit(list, ':');
  size_t column = 0;
  bool has_element = false, has_place = false;
  for (size_t i = 0; i + 2 < fields.size(); i += 3) {
    uint32_t width = 0;
    if (!absl::SimpleAtoi(fields[i + 2], &width) || width == 0 || width > 64) return false;
    if (fields[i] == "species" || (fields[i] == "Z" && !has_element)) {
      layout->element = column;
      has_element = true;
    } else if (fields[i] == "pos" && width == 3) {
      layout->place = column;
      has_place = true;
    } else if (fields[i + 1] == "R" || fields[i + 1] == "I") {
      for (uint32_t k = 0; k < width; ++k) {
        layout->others.emplace_back(
            column + k, width == 1 ? std::string(fields[i]) : absl::StrCat(fields[i], "_", k + 1));
      }
    }
    column += width;
    if (column > 256) return false;
  }
  return has_element && has_place;
}

class XyzReader {
 public:
  explicit XyzReader(const SourceFile& file) : file_(file), lines_(file.bytes) {}

  absl::Status ReadFrame();
  void CountTheRest(Model* model);
  void ResolveNames(Model* model);
  Molecule Take() && { return std::move(molecule_); }

 private:
  absl::Status WrongLine(absl::string_view found, absl::string_view expected) const {
    return FileError(file_, absl::StrCat("line ", lines_.number(), " ", found), expected);
  }
  absl::Status ReadAtom(const XyzWords& words);

  const SourceFile& file_;
  XyzLines lines_;
  XyzLayout layout_;
  Molecule molecule_;
  std::vector<std::pair<size_t, absl::string_view>> either_;  // atoms that kEither holds for
  uint64_t names_ = 0;
  absl::string_view first_name_;
};

absl::Status XyzReader::ReadAtom(const XyzWords& words) {
  MoleculeAtom atom;
  if (words.size() < std::max(layout_.element + 1, layout_.place + 3)) {
    return WrongLine(absl::StrCat("has ", words.size(), " columns"),
                     "an element and its coordinates x y z are expected");
  }
  const XyzElement found = XyzElementOf(words[layout_.element]);
  atom.element = found.element;
  if (atom.element == nullptr) {
    return WrongLine(absl::StrCat("begins with \"",
                                  EscapeForTerminal(words[layout_.element].substr(0, 24)), "\""),
                     "the symbol of an element is expected");
  }
  double* const numbers[] = {&atom.at.x, &atom.at.y, &atom.at.z};
  for (size_t i = 0; i < 3; ++i) {
    const absl::string_view word = words[layout_.place + i];
    const std::optional<double> value = XyzNumber(word);
    if (!value || !(std::abs(*value) <= kFarthestAtom)) {
      return WrongLine(absl::StrCat("has \"", EscapeForTerminal(word.substr(0, 24)),
                                    "\" in column ", layout_.place + i + 1),
                       "a coordinate of the atom is expected, in ångström");
    }
    *numbers[i] = *value;
  }
  if (found.spelling == XyzSpelling::kEither)
    either_.emplace_back(molecule_.atoms.size(), words[layout_.element]);
  if (found.spelling == XyzSpelling::kName && ++names_ == 1) first_name_ = words[layout_.element];
  molecule_.atoms.push_back(atom);
  for (size_t i = 0; i < layout_.others.size(); ++i) {
    const size_t column = layout_.others[i].first;
    const std::optional<double> value =
        column < words.size() ? XyzNumber(words[column]) : std::nullopt;
    molecule_.attributes[i].values.push_back(value && std::isfinite(*value) ? *value
                                                                            : kNoAtomValue);
  }
  return absl::OkStatus();
}

absl::Status XyzReader::ReadFrame() {
  absl::string_view line, comment;
  if (!lines_.Next(&line) || !AtomCountOf(line))
    return WrongLine("is not a number", "the number of atoms is expected");
  const uint64_t count = *AtomCountOf(line);
  if (count == 0 || count > kMostAtoms) {
    return WrongLine(absl::StrCat("announces ", count, " atoms"),
                     absl::StrCat("1 to ", kMostAtoms, " are expected"));
  }
  lines_.Next(&comment);
  const bool is_named = ReadXyzProperties(comment, &layout_);
  if (!is_named) layout_ = {};
  for (uint64_t i = 0; i < count; ++i) {
    if (!lines_.Next(&line)) {
      return FileError(file_, absl::StrCat("announces ", count, " atoms and ends after ", i),
                       "a line for each atom is expected");
    }
    const XyzWords words = XyzWordsOf(line);
    if (i == 0) {
      for (size_t k = 4; !is_named && k < std::min<size_t>(words.size(), 64); ++k) {
        if (XyzNumber(words[k])) layout_.others.emplace_back(k, absl::StrCat("column ", k + 1));
      }
      for (const auto& [column, name] : layout_.others) molecule_.attributes.push_back({name, {}});
    }
    if (absl::Status status = ReadAtom(words); !status.ok()) return status;
  }
  return absl::OkStatus();
}

// A file that has names has them for all atoms, so ambiguous words are names, too.
void XyzReader::ResolveNames(Model* model) {
  if (names_ == 0) return;
  for (const auto& [atom, name] : either_)
    molecule_.atoms[atom].element = ElementOfFirstLetter(name);
  const uint64_t names = names_ + either_.size();
  AddNote(absl::StrCat(names, names == 1 ? " atom has a name" : " atoms have names", ", such as ",
                       EscapeForTerminal(first_name_.substr(0, 24)),
                       ", whose first letter is taken for the element"),
          model);
}

void XyzReader::CountTheRest(Model* model) {
  uint64_t frames = 0, others = 0;
  absl::string_view line;
  while (lines_.Next(&line)) {
    const std::optional<uint64_t> count = AtomCountOf(line);
    if (!count) {
      others += line.empty() ? 0 : 1;
      continue;
    }
    ++frames;
    for (uint64_t skipped = 0; skipped <= *count && lines_.Next(&line); ++skipped) {
    }
  }
  AddLeftOut("further models", frames, model);
  AddLeftOut("lines after the last atom", others, model);
}

}  // namespace

absl::Status DrawMolecule(const SourceFile& file, Molecule molecule, MoleculeStyle style,
                          bool attributes, Model* model) {
  if (molecule.atoms.size() > kMostAtoms) {
    return FileError(file, absl::StrCat("has more than ", kMostAtoms, " atoms"),
                     "so large a molecule is not read");
  }
  for (const MoleculeAtom& atom : molecule.atoms) {
    for (const double x : {atom.at.x, atom.at.y, atom.at.z}) {
      if (std::abs(x) <= kFarthestAtom) continue;
      return FileError(file, absl::StrCat("has an atom with the coordinate ", x),
                       "numbers in ångström, at most 1000000, are expected");
    }
  }
  if (attributes) {
    std::erase_if(molecule.attributes, [&](const Attribute& one) {
      return one.values.size() != molecule.atoms.size() ||
             std::all_of(one.values.begin(), one.values.end(),
                         [](float v) { return std::isnan(v); });
    });
    Attribute element{"element", {}};
    for (const MoleculeAtom& atom : molecule.atoms)
      element.values.push_back(static_cast<float>(atom.element->number));
    molecule.attributes.push_back(std::move(element));
  } else {
    molecule.attributes.clear();
  }
  model->path = file.path;
  model->up = Up::kZ;
  model->lit_already = true;
  model->molecule = true;
  if (style == MoleculeStyle::kBalls) {
    absl::Status status = BondSearch(molecule.atoms).Run(file, &molecule.bonds);
    if (!status.ok()) return status;
    std::erase_if(molecule.bonds, [](const auto& bond) { return bond[0] == bond[1]; });
    for (auto& bond : molecule.bonds)
      bond = {std::min(bond[0], bond[1]), std::max(bond[0], bond[1])};
    std::sort(molecule.bonds.begin(), molecule.bonds.end());
    molecule.bonds.erase(std::unique(molecule.bonds.begin(), molecule.bonds.end()),
                         molecule.bonds.end());
    AddRods(molecule, model);
  }
  AddBalls(molecule, style, model);
  return absl::OkStatus();
}

bool IsXyzMolecule(absl::string_view text) {
  XyzLines lines(text);
  absl::string_view line;
  if (!lines.Next(&line)) return false;
  const std::optional<uint64_t> count = AtomCountOf(line);
  if (!count || *count == 0 || !lines.Next(&line)) return false;
  XyzLayout layout;
  if (ReadXyzProperties(line, &layout)) return true;
  // A line of numbers is the first point of a cloud.
  const XyzWords comment = XyzWordsOf(line);
  const bool is_point = comment.size() >= 3 && XyzNumber(comment[0]) && XyzNumber(comment[1]) &&
                        XyzNumber(comment[2]);
  if (!lines.Next(&line)) return false;
  if (IsXyzAtom(XyzWordsOf(line), false)) return true;
  if (is_point) return false;
  // With atomic numbers, every line must begin with one, so that points with three coordinates and
  // a value are not taken for atoms.
  uint64_t atoms = 0;
  do {
    const XyzWords words = XyzWordsOf(line);
    if (words.size() != 4 || !IsXyzAtom(words, true)) return false;
  } while (++atoms < *count && lines.Next(&line));
  return atoms == *count;
}

absl::StatusOr<Model> ReadXyzMolecule(const SourceFile& file, MoleculeStyle style,
                                      bool attributes) {
  XyzReader reader(file);
  if (absl::Status status = reader.ReadFrame(); !status.ok()) return status;
  Model model;
  model.format = "XYZ molecule";
  reader.ResolveNames(&model);
  reader.CountTheRest(&model);
  absl::Status status = DrawMolecule(file, std::move(reader).Take(), style, attributes, &model);
  if (!status.ok()) return status;
  return model;
}

}  // namespace voxeld::voxelctl
