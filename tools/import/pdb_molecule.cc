#include "tools/import/pdb_molecule.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <map>
#include <set>
#include <string>
#include <unordered_map>
#include <utility>
#include <vector>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/string_view.h"
#include "common/text/printable.h"
#include "tools/import/elements.h"

namespace voxeld::voxelctl {
namespace {

// In ångström.
constexpr double kFarthest = 1e6;
constexpr double kSlack = 0.45, kNearest = 0.4;  // of the length of a bond
constexpr double kCell = 3.6;                    // no bond between elements that have any is longer
constexpr double kRod = 0.3, kBall = 0.25;       // a rod's diameter; a ball's part of its atom
constexpr size_t kMostInCell = 100;              // where ten are to be expected

struct Atom {
  Point3 at;
  const ChemicalElement* element;
};

using Cell = std::array<int32_t, 3>;
struct CellHash {
  size_t operator()(const Cell& c) const {
    return static_cast<size_t>(c[0]) * 73856093u ^ static_cast<size_t>(c[1]) * 19349663u ^
           static_cast<size_t>(c[2]) * 83492791u;
  }
};

// ColumnsOf as the format counts them, from 1, of which the last may be beyond the line's end.
absl::string_view ColumnsOf(absl::string_view line, size_t first, size_t last) {
  if (line.size() < first) return "";
  return line.substr(first - 1, last - first + 1);
}

// Old files have other things in the columns of the element; then the name's place tells a calcium from a carbon.
const ChemicalElement& ElementOf(absl::string_view line) {
  const auto find = [](absl::string_view text) {
    return FindElement(absl::StripAsciiWhitespace(text));
  };
  if (const ChemicalElement* element = find(ColumnsOf(line, 77, 78))) return *element;
  const absl::string_view name = ColumnsOf(line, 13, 16);
  const bool four = name.find(' ') == absl::string_view::npos && name.size() == 4;
  if (!four || name[0] != 'H') {
    if (const ChemicalElement* element = find(name.substr(0, 2))) return *element;
  }
  for (const char c : name) {
    if (!absl::ascii_isalpha(static_cast<unsigned char>(c))) continue;
    const ChemicalElement* element = FindElement(absl::string_view(&c, 1));
    return element != nullptr ? *element : UnknownElement();
  }
  return UnknownElement();
}

class PdbReader {
 public:
  PdbReader(const SourceFile& file, MoleculeStyle style) : file_(file), style_(style) {}

  absl::StatusOr<Model> Read() {
    if (absl::Status status = ReadLines(); !status.ok()) return status;
    if (atoms_.empty()) {
      return FileError(file_,
                       absl::StrCat("is ", DescribeContents(file_.bytes), ", without an atom"),
                       "records ATOM or HETATM of the Protein Data Bank are expected");
    }
    Model model;
    model.path = file_.path;
    model.molecule = true;
    model.format = "PDB molecule";
    model.up = Up::kZ;
    model.lit_already = true;
    std::vector<std::string> notes;
    if (more_models_) notes.push_back("the first of its models is shown");
    if (other_locations_ > 0) {
      notes.push_back(absl::StrCat("atoms at alternate locations, not shown: ", other_locations_));
    }
    if (!notes.empty()) model.note = absl::StrCat(file_.path, ": ", absl::StrJoin(notes, "; "));
    if (style_ == MoleculeStyle::kBalls) {
      if (absl::Status status = FindBonds(); !status.ok()) return status;
      AddRods(&model);
    }
    AddBalls(&model);
    return model;
  }

 private:
  absl::Status WrongLine(absl::string_view found, absl::string_view expected) const {
    return FileError(file_, absl::StrCat("line ", line_, " ", found), expected);
  }

  absl::Status ReadLines() {
    absl::string_view rest = file_.bytes;
    bool ended = false;
    while (!rest.empty()) {
      const size_t end = std::min(rest.find('\n'), rest.size());
      absl::string_view line = rest.substr(0, end);
      rest.remove_prefix(std::min(end + 1, rest.size()));
      if (absl::EndsWith(line, "\r")) line.remove_suffix(1);
      ++line_;
      const absl::string_view record = ColumnsOf(line, 1, 6);
      if (absl::StartsWith(record, "ENDMDL") || absl::StripAsciiWhitespace(record) == "END") {
        ended = !atoms_.empty();
      } else if (absl::StartsWith(record, "CONECT")) {
        ReadConnections(line);
      } else if (record == "ATOM  " || record == "HETATM") {
        more_models_ |= ended;
        if (ended) continue;
        if (absl::Status status = ReadAtom(line); !status.ok()) return status;
      }
    }
    return absl::OkStatus();
  }

  absl::Status ReadAtom(absl::string_view line) {
    // All atoms of a residue are taken from its first alternate location.
    const absl::string_view location = ColumnsOf(line, 17, 17);
    if (!location.empty() && location != " ") {
      const auto chosen =
          locations_.emplace(std::string(ColumnsOf(line, 22, 27)), location[0]).first->second;
      if (chosen != location[0]) {
        ++other_locations_;
        return absl::OkStatus();
      }
    }
    if (atoms_.size() >= kMaxModelVertices / 5) {
      return FileError(file_, absl::StrCat("has more than ", kMaxModelVertices / 5, " atoms"),
                       "so large a molecule is not read");
    }
    Atom atom{.at = {}, .element = &ElementOf(line)};
    double* const numbers[] = {&atom.at.x, &atom.at.y, &atom.at.z};
    for (size_t i = 0; i < 3; ++i) {
      const absl::string_view text =
          absl::StripAsciiWhitespace(ColumnsOf(line, 31 + 8 * i, 38 + 8 * i));
      if (!absl::SimpleAtod(text, numbers[i]) || !(std::abs(*numbers[i]) <= kFarthest)) {
        return WrongLine(text.empty() ? absl::StrCat("is cut off before column ", 31 + 8 * i)
                                      : absl::StrCat("has \"", EscapeForTerminal(text),
                                                     "\" in column ", 31 + 8 * i),
                         "a coordinate of the atom is expected, in ångström");
      }
    }
    serials_.emplace(absl::StripAsciiWhitespace(ColumnsOf(line, 7, 11)), atoms_.size());
    atoms_.push_back(atom);
    return absl::OkStatus();
  }

  // Atoms that were left out may be named, so unknown ones are no fault.
  void ReadConnections(absl::string_view line) {
    const auto find = [&](size_t first) {
      return serials_.find(
          std::string(absl::StripAsciiWhitespace(ColumnsOf(line, first, first + 4))));
    };
    const auto from = find(7);
    if (from == serials_.end()) return;
    for (size_t column = 12; column <= 27; column += 5) {
      const auto to = find(column);
      if (to != serials_.end()) AddBond(from->second, to->second);
    }
  }

  void AddBond(size_t a, size_t b) {
    if (a != b && bonds_.size() < kMaxModelVertices / 8) bonds_.insert(std::minmax(a, b));
  }

  absl::Status FindBonds() {
    std::unordered_map<Cell, std::vector<size_t>, CellHash> cells;
    const auto cell_of = [](const Point3& p) {
      return Cell{static_cast<int32_t>(std::floor(p.x / kCell)),
                  static_cast<int32_t>(std::floor(p.y / kCell)),
                  static_cast<int32_t>(std::floor(p.z / kCell))};
    };
    for (size_t i = 0; i < atoms_.size(); ++i) {
      if (!atoms_[i].element->bonds) continue;
      std::vector<size_t>& cell = cells[cell_of(atoms_[i].at)];
      cell.push_back(i);
      if (cell.size() > kMostInCell) {
        const Point3& p = atoms_[i].at;
        return FileError(file_,
                         absl::StrCat("has more than ", kMostInCell, " atoms near (", p.x, ", ",
                                      p.y, ", ", p.z, ")"),
                         "coordinates in ångström are expected");
      }
    }
    for (const auto& [cell, here] : cells) {
      for (int32_t n = 0; n < 27; ++n) {
        const auto there =
            cells.find({cell[0] + n % 3 - 1, cell[1] + n / 3 % 3 - 1, cell[2] + n / 9 - 1});
        if (there == cells.end()) continue;
        for (const size_t a : here) {
          for (const size_t b : there->second) {
            if (a < b && AreBound(atoms_[a], atoms_[b])) AddBond(a, b);
          }
        }
      }
    }
    return absl::OkStatus();
  }

  static bool AreBound(const Atom& a, const Atom& b) {
    const bool hydrogens = a.element->covalent < 0.35 && b.element->covalent < 0.35;
    const double apart = std::hypot(a.at.x - b.at.x, a.at.y - b.at.y, a.at.z - b.at.z);
    return !hydrogens && apart > kNearest &&
           apart < a.element->covalent + b.element->covalent + kSlack;
  }

  void AddRods(Model* model) const {
    Part part{.kind = Kind::kSegments};
    part.thickness = kRod;
    for (const auto& [a, b] : bonds_) {
      const Point3 &from = atoms_[a].at, &to = atoms_[b].at;
      const Point3 middle = {(from.x + to.x) / 2, (from.y + to.y) / 2, (from.z + to.z) / 2};
      for (const size_t end : {a, b}) {
        for (const Point3& p : {atoms_[end].at, middle}) {
          part.indices.push_back(static_cast<uint32_t>(part.positions.size()));
          part.positions.push_back(p);
          part.colors.push_back(atoms_[end].element->color);
        }
      }
    }
    if (!part.positions.empty()) model->parts.push_back(std::move(part));
  }

  // Points of one part are equally thick.
  void AddBalls(Model* model) const {
    std::map<double, Part> parts;
    for (const Atom& atom : atoms_) {
      const double diameter =
          2 * atom.element->van_der_waals * (style_ == MoleculeStyle::kBalls ? kBall : 1);
      Part& part = parts[diameter];
      part.kind = Kind::kPoints;
      part.thickness = diameter;
      part.positions.push_back(atom.at);
      part.colors.push_back(atom.element->color);
    }
    for (auto& [diameter, part] : parts) model->parts.push_back(std::move(part));
  }

  const SourceFile& file_;
  const MoleculeStyle style_;
  uint64_t line_ = 0;
  bool more_models_ = false;
  std::unordered_map<std::string, char> locations_;  // by residue
  uint64_t other_locations_ = 0;
  std::vector<Atom> atoms_;
  std::unordered_map<std::string, size_t> serials_;
  std::set<std::pair<size_t, size_t>> bonds_;
};

}  // namespace

absl::StatusOr<Model> ReadPdbMolecule(const SourceFile& file, MoleculeStyle style) {
  return PdbReader(file, style).Read();
}

}  // namespace voxeld::voxelctl
