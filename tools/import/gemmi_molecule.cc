#include "tools/import/gemmi_molecule.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <exception>
#include <gemmi/numb.hpp>
#include <gemmi/pdb.hpp>
#include <gemmi/small.hpp>
#include <gemmi/symmetry.hpp>
#include <gemmi/unitcell.hpp>
#include <initializer_list>
#include <limits>
#include <new>
#include <optional>
#include <string>
#include <unordered_map>
#include <utility>
#include <vector>

#include "absl/container/flat_hash_map.h"
#include "absl/container/flat_hash_set.h"
#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/string_view.h"
#include "absl/strings/strip.h"
#include "common/text/printable.h"
#include "tools/import/inflate.h"
#include "tools/voxelctl/import/elements.h"
#include "tools/voxelctl/import/molecule.h"

namespace voxeld::voxelctl {
namespace {

using absl::string_view;

constexpr double kFarthest = 1e6;  // Å
constexpr uint64_t kMostUnpacked = uint64_t{1} << 30;
constexpr double kNoValue = std::numeric_limits<double>::quiet_NaN();
constexpr char kFurtherModels[] = "further models";
constexpr char kOtherLocations[] = "atoms at alternate locations";
constexpr char kNoPlace[] = "atoms without coordinates";
constexpr char kCopies[] = "copies by assembly operators";
constexpr char kHelices[] = "helices";
constexpr char kStrands[] = "strands of sheets";
constexpr char kSymmetricBonds[] = "bonds to symmetry copies";
constexpr char kNcsCopies[] = "copies by non-crystallographic symmetry";
constexpr double kDefaultAngle = 90;  // of a unit cell, in degrees, by CIF's dictionary

const ChemicalElement& ElementOf(gemmi::Element element) {
  const ChemicalElement* found =
      element == gemmi::El::D ? FindElement("D") : FindElement(string_view(element.name()));
  return found != nullptr ? *found : UnknownElement();
}

double AttributeOf(double value) { return std::isfinite(value) ? value : kNoValue; }

// Counts the copies that the symmetry of a crystal makes of the atoms in the file. If the file
// lists no operators, their number is that of the space group, which is found by its name or else
// by its number. The angles tell the settings of rhombohedral groups apart.
void CountCrystalCopies(uint64_t operators, const std::string& name, const std::string& number,
                        double alpha, double gamma, Model* model) {
  if (operators == 0 && name.empty() && number.empty()) return;
  if (operators == 0) {
    int table_number = 0;
    const gemmi::SpaceGroup* group = gemmi::find_spacegroup_by_name(name, alpha, gamma);
    if (group == nullptr && absl::SimpleAtoi(number, &table_number))
      group = gemmi::find_spacegroup_by_number(table_number);
    if (group == nullptr) return AddLeftOut("space groups that are not known", 1, model);
    operators = static_cast<uint64_t>(group->operations().order());
  }
  AddLeftOut("copies by crystal symmetry", operators - 1, model);
}

// Collects atoms with their attributes, one alternate location for each residue, and finds them by
// address.
class Builder {
 public:
  // The numbers of an atom that can determine its colour.
  struct Values {
    double b_factor = kNoValue, occupancy = kNoValue, charge = kNoValue, chain = kNoValue,
           residue = kNoValue;
  };

  // Returns false, and counts the atom, if another alternate location of its residue was chosen.
  bool Chooses(char location, string_view residue) {
    if (location == ' ' || location == '\0') return true;
    if (locations_.emplace(std::string(residue), location).first->second == location) return true;
    ++other_locations_;
    return false;
  }

  uint32_t Add(const MoleculeAtom& atom, const Values& values) {
    molecule_.atoms.push_back(atom);
    values_.push_back(values);
    return static_cast<uint32_t>(molecule_.atoms.size() - 1);
  }
  size_t size() const { return molecule_.atoms.size(); }

  void AddBond(uint32_t a, uint32_t b) {
    if (a != b && molecule_.bonds.size() < kMaxModelVertices / 4) molecule_.bonds.push_back({a, b});
  }

  double ChainNumber(string_view chain) {
    return static_cast<double>(
        chains_.emplace(std::string(chain), chains_.size() + 1).first->second);
  }

  absl::Status Draw(const SourceFile& file, MoleculeStyle style, bool attributes, Model* model) && {
    AddLeftOut(kOtherLocations, other_locations_, model);
    const auto attribute = [this](const char* name, double Values::*member) {
      Attribute one{name, {}};
      one.values.reserve(values_.size());
      for (const Values& values : values_) one.values.push_back(values.*member);
      molecule_.attributes.push_back(std::move(one));
    };
    attribute("b_factor", &Values::b_factor);
    attribute("occupancy", &Values::occupancy);
    attribute("charge", &Values::charge);
    attribute("chain", &Values::chain);
    attribute("residue", &Values::residue);
    values_ = {};
    return DrawMolecule(file, std::move(molecule_), style, attributes, model);
  }

 private:
  Molecule molecule_;
  std::vector<Values> values_;
  std::unordered_map<std::string, char> locations_;  // by residue
  std::unordered_map<std::string, size_t> chains_;
  uint64_t other_locations_ = 0;
};

// Returns an atom's address: chain, residue and atom name, separated by null characters.
std::string Address(string_view chain, string_view residue, string_view insertion,
                    string_view atom) {
  return absl::StrCat(absl::StripAsciiWhitespace(chain), string_view("\0", 1),
                      absl::StripAsciiWhitespace(residue), string_view("\0", 1),
                      absl::StripAsciiWhitespace(insertion), string_view("\0", 1),
                      absl::StripAsciiWhitespace(atom));
}
using Addresses = std::unordered_map<std::string, uint32_t>;

// --- PDB ---

// Returns the columns [first, last], counted from 1 as the format does; the last may be beyond the
// line's end.
string_view ColumnsOf(string_view line, size_t first, size_t last) {
  if (line.size() < first) return "";
  return line.substr(first - 1, last - first + 1);
}

string_view Stripped(string_view line, size_t first, size_t last) {
  return absl::StripAsciiWhitespace(ColumnsOf(line, first, last));
}

bool HasElement(string_view line) { return FindElement(Stripped(line, 77, 78)) != nullptr; }

bool HasCharge(string_view line) {
  const string_view text = ColumnsOf(line, 79, 80);
  const auto is_digit = [](char c) { return c >= '0' && c <= '9'; };
  const auto is_sign = [](char c) { return c == '+' || c == '-'; };
  return text.size() == 2 &&
         ((is_digit(text[0]) && is_sign(text[1])) || (is_sign(text[0]) && is_digit(text[1])));
}

class PdbReader {
 public:
  explicit PdbReader(const SourceFile& file, string_view text) : file_(file), text_(text) {}

  absl::Status Read(Builder* builder, Model* model);

 private:
  absl::Status WrongLine(string_view found, string_view expected) const {
    return FileError(file_, absl::StrCat("line ", line_, " ", found), expected);
  }
  template <typename Use>
  absl::Status ForEachLine(Use use);
  absl::Status Scan(Builder* builder);
  absl::Status CheckPlace(string_view line) const;
  void CountSymmetry(Model* model) const;
  std::string TextForGemmi();
  void AddNamedBonds(Builder* builder, Model* model);
  void AddLink(string_view line, const std::array<size_t, 8>& columns, const Addresses& addresses,
               Builder* builder);

  const SourceFile& file_;
  string_view text_;
  uint64_t line_ = 0, further_models_ = 0, symmetric_ = 0, unclear_ = 0;
  std::vector<string_view> atoms_;  // lines
  string_view crystal_;             // the line of the unit cell and its symmetry
  std::string others_;              // lines that describe things that are not drawn
};

template <typename Use>
absl::Status PdbReader::ForEachLine(Use use) {
  string_view rest = text_;
  line_ = 0;
  while (!rest.empty()) {
    const size_t end = std::min(rest.find('\n'), rest.size());
    string_view line = rest.substr(0, end);
    rest.remove_prefix(std::min(end + 1, rest.size()));
    absl::ConsumeSuffix(&line, "\r");
    ++line_;
    if (absl::Status status = use(line); !status.ok()) return status;
  }
  return absl::OkStatus();
}

absl::Status PdbReader::CheckPlace(string_view line) const {
  for (size_t i = 0; i < 3; ++i) {
    const string_view text = Stripped(line, 31 + 8 * i, 38 + 8 * i);
    double value = 0;
    if (!absl::SimpleAtod(text, &value) || !(std::abs(value) <= kFarthest)) {
      return WrongLine(text.empty() ? absl::StrCat("is cut off before column ", 31 + 8 * i)
                                    : absl::StrCat("has \"", EscapeForTerminal(text),
                                                   "\" in column ", 31 + 8 * i),
                       "a coordinate of the atom is expected, in ångström");
    }
  }
  return absl::OkStatus();
}

// A model ends with ENDMDL or END, or where the next one begins: some programs write MODEL alone.
bool DividesModels(string_view record) {
  const string_view name = absl::StripAsciiWhitespace(record);
  return name == "MODEL" || name == "ENDMDL" || name == "END";
}

// Keeps the lines of the first model's atoms, and counts the other models.
absl::Status PdbReader::Scan(Builder* builder) {
  bool ended = false;
  return ForEachLine([&](string_view line) -> absl::Status {
    const string_view record = ColumnsOf(line, 1, 6);
    if (DividesModels(record)) {
      ended = true;
    } else if (record == "CRYST1") {
      if (crystal_.empty()) crystal_ = line;
    } else if (absl::StartsWith(record, "ATOM") || record == "HETATM") {
      if (ended && !atoms_.empty()) ++further_models_;
      ended = false;
      if (further_models_ > 0) return absl::OkStatus();
      if (!builder->Chooses(ColumnsOf(line, 17, 17).empty() ? ' ' : line[16],
                            ColumnsOf(line, 21, 27)))
        return absl::OkStatus();
      if (atoms_.size() >= kMostAtoms) {
        return FileError(file_, absl::StrCat("has more than ", kMostAtoms, " atoms"),
                         "so large a molecule is not read");
      }
      if (absl::Status status = CheckPlace(line); !status.ok()) return status;
      atoms_.push_back(line);
    } else if (record == "HELIX " || record == "SHEET " || absl::StartsWith(record, "MTRIX") ||
               absl::StartsWith(line, "REMARK 350")) {
      if (others_.size() < kMostUnpacked / 16) absl::StrAppend(&others_, line.substr(0, 80), "\n");
    }
    return absl::OkStatus();
  });
}

// Replaces serial numbers by the atoms' indices, which identifies atoms however the file counts
// (hybrid-36, hexadecimal, stars). Atoms of a chain are kept together, because gemmi searches all
// chains whenever the chain changes.
std::string PdbReader::TextForGemmi() {
  std::vector<std::pair<std::string, uint32_t>> order;
  order.reserve(atoms_.size());
  for (uint32_t i = 0; i < atoms_.size(); ++i)
    order.emplace_back(std::string(ColumnsOf(atoms_[i], 21, 22)), i);
  std::stable_sort(order.begin(), order.end(),
                   [](const auto& a, const auto& b) { return a.first < b.first; });
  std::string text = others_;
  text.reserve(text.size() + 81 * atoms_.size());
  for (const auto& [chain, index] : order) {
    std::string line(atoms_[index].substr(0, 80));
    line.resize(80, ' ');
    for (char& c : line) {
      if (absl::ascii_iscntrl(static_cast<unsigned char>(c))) c = ' ';
    }
    if (line[0] == 'A') line.replace(4, 2, "  ");
    std::string serial(5, ' ');
    if (index < 100000) {
      serial = absl::StrFormat("%5d", index);
    } else {  // hybrid-36
      uint32_t rest = index - 100000 + 10 * 36 * 36 * 36 * 36;
      for (size_t digit = 5; digit-- > 0; rest /= 36)
        serial[digit] = "0123456789ABCDEFGHIJKLMNOPQRSTUVWXYZ"[rest % 36];
    }
    line.replace(6, 5, serial);
    // Old files use the columns of the element and of the charge for other things.
    if (!HasElement(line)) line.replace(76, 2, "  ");
    if (!HasCharge(line)) line.replace(78, 2, "  ");
    absl::StrAppend(&text, line, "\n");
  }
  return text;
}

// gemmi reads names by the columns of the format, so " CA " is carbon and "CA  " calcium. Programs
// for polymers align all names to the left: in their records (ATOM) the first letter counts, unless
// the residue is an ion.
gemmi::Element ElementOfName(const gemmi::Atom& atom, const gemmi::Residue& residue,
                             string_view line) {
  const bool is_polymer = absl::StartsWith(line, "ATOM") && atom.name != residue.name;
  if (HasElement(line) || (!is_polymer && atom.element != gemmi::El::X)) return atom.element;
  if (is_polymer && atom.name == "SE") return gemmi::El::Se;
  for (const char c : atom.name) {
    if (absl::ascii_isalpha(static_cast<unsigned char>(c)))
      return gemmi::impl::find_single_letter_element(
          absl::ascii_toupper(static_cast<unsigned char>(c)));
  }
  return atom.element;
}

void PdbReader::CountSymmetry(Model* model) const {
  double alpha = 0, gamma = 0;
  if (!absl::SimpleAtod(Stripped(crystal_, 34, 40), &alpha)) alpha = 0;
  if (!absl::SimpleAtod(Stripped(crystal_, 48, 54), &gamma)) gamma = 0;
  CountCrystalCopies(0, std::string(Stripped(crystal_, 56, 66)), "", alpha, gamma, model);
}

absl::Status PdbReader::Read(Builder* builder, Model* model) {
  if (absl::Status status = Scan(builder); !status.ok()) return status;
  if (atoms_.empty()) {
    return FileError(file_, absl::StrCat("is ", DescribeContents(text_), ", without an atom"),
                     "records ATOM or HETATM of the Protein Data Bank are expected");
  }
  const std::string text = TextForGemmi();
  const gemmi::Structure structure = gemmi::read_pdb_string(text, "molecule");
  std::vector<std::pair<MoleculeAtom, Builder::Values>> found(atoms_.size());
  for (const gemmi::Chain& chain : structure.models.at(0).chains) {
    for (const gemmi::Residue& residue : chain.residues) {
      for (const gemmi::Atom& atom : residue.atoms) {
        const auto index = static_cast<size_t>(atom.serial);
        if (index >= found.size()) continue;
        const string_view line = atoms_[index];
        auto& [place, values] = found[index];
        place.at = {atom.pos.x, atom.pos.y, atom.pos.z};
        place.element = &ElementOf(ElementOfName(atom, residue, line));
        if (!Stripped(line, 55, 60).empty()) values.occupancy = AttributeOf(atom.occ);
        if (!Stripped(line, 61, 66).empty()) values.b_factor = AttributeOf(atom.b_iso);
        if (HasCharge(line)) values.charge = atom.charge;
        if (residue.seqid.num.has_value())
          values.residue = static_cast<float>(residue.seqid.num.value);
      }
    }
  }
  for (size_t i = 0; i < found.size(); ++i) {
    found[i].second.chain = builder->ChainNumber(ColumnsOf(atoms_[i], 21, 22));
    builder->Add(found[i].first, found[i].second);
  }
  model->format = "PDB molecule";
  AddLeftOut(kFurtherModels, further_models_, model);
  AddLeftOut(kHelices, structure.helices.size(), model);
  for (const gemmi::Sheet& sheet : structure.sheets)
    AddLeftOut(kStrands, sheet.strands.size(), model);
  for (const gemmi::Assembly& assembly : structure.assemblies) {
    for (const gemmi::Assembly::Gen& part : assembly.generators) {
      AddLeftOut(kCopies,
                 static_cast<uint64_t>(std::count_if(part.operators.begin(), part.operators.end(),
                                                     [](const gemmi::Assembly::Operator& one) {
                                                       return !one.transform.is_identity();
                                                     })),
                 model);
    }
  }
  AddLeftOut(kNcsCopies,
             static_cast<uint64_t>(std::count_if(structure.ncs.begin(), structure.ncs.end(),
                                                 [](const auto& op) { return !op.given; })),
             model);
  CountSymmetry(model);
  AddNamedBonds(builder, model);
  return absl::OkStatus();
}

// `columns` holds, for each of two atoms, the columns of chain, residue number and (0 if the record
// has none) name; then those of the symmetry operators.
void PdbReader::AddLink(string_view line, const std::array<size_t, 8>& columns,
                        const Addresses& addresses, Builder* builder) {
  if (Stripped(line, columns[6], columns[6] + 5) != Stripped(line, columns[7], columns[7] + 5)) {
    ++symmetric_;
    return;
  }
  std::array<uint32_t, 2> ends = {};
  for (size_t i = 0; i < 2; ++i) {
    const size_t chain = columns[3 * i], number = columns[3 * i + 1], name = columns[3 * i + 2];
    const auto found = addresses.find(Address(ColumnsOf(line, chain - 1, chain),
                                              ColumnsOf(line, number, number + 3),
                                              ColumnsOf(line, number + 4, number + 4),
                                              name == 0 ? "SG" : ColumnsOf(line, name, name + 3)));
    if (found == addresses.end()) return;  // an atom of another alternate location
    ends[i] = found->second;
  }
  builder->AddBond(ends[0], ends[1]);
}

void PdbReader::AddNamedBonds(Builder* builder, Model* model) {
  constexpr uint32_t kTwice = UINT32_MAX;
  absl::flat_hash_map<string_view, uint32_t> serials;
  Addresses addresses;
  const bool has_links = absl::StrContains(text_, "LINK") || absl::StrContains(text_, "SSBOND");
  for (uint32_t i = 0; i < atoms_.size(); ++i) {
    const string_view line = atoms_[i];
    const auto [at, is_new] = serials.emplace(Stripped(line, 7, 11), i);
    if (!is_new) at->second = kTwice;
    if (has_links) {
      addresses.emplace(Address(ColumnsOf(line, 21, 22), ColumnsOf(line, 23, 26),
                                ColumnsOf(line, 27, 27), ColumnsOf(line, 13, 16)),
                        i);
    }
  }
  const absl::Status all = ForEachLine([&](string_view line) {
    const string_view record = ColumnsOf(line, 1, 6);
    if (record == "CONECT") {
      const auto find = [&](size_t first) {
        const string_view serial = Stripped(line, first, first + 4);
        const auto found = serials.find(serial);
        return serial.empty() || found == serials.end() ? std::optional<uint32_t>() : found->second;
      };
      const std::optional<uint32_t> from = find(7);
      for (size_t column = 12; from && column <= 27; column += 5) {
        // Atoms that were left out may be named, so an unknown atom is not an error.
        const std::optional<uint32_t> to = find(column);
        if (!to) continue;
        if (*from == kTwice || *to == kTwice) {
          ++unclear_;
        } else {
          builder->AddBond(*from, *to);
        }
      }
    } else if (record == "LINK  ") {
      AddLink(line, {22, 23, 13, 52, 53, 43, 60, 67}, addresses, builder);
    } else if (record == "SSBOND") {
      AddLink(line, {16, 18, 0, 30, 32, 0, 60, 67}, addresses, builder);
    }
    return absl::OkStatus();
  });
  (void)all;
  AddLeftOut("bonds by serial numbers that several atoms have", unclear_, model);
  AddLeftOut(kSymmetricBonds, symmetric_, model);
}

// --- CIF ---

// Tokenises the syntax of CIF 1.1. Values stay as they are written, with their quotation marks.
class CifTokens {
 public:
  enum class Type : uint8_t { kEnd, kValue, kTag, kData, kLoop, kSave, kOther };

  CifTokens(const SourceFile& file, string_view text) : file_(file), text_(text) {
    if (absl::StartsWith(text_, "\xef\xbb\xbf")) at_ = 3;
  }
  absl::Status Next();
  Type type() const { return type_; }
  string_view text() const { return token_; }
  uint64_t line() const { return line_; }
  absl::Status Wrong(string_view found, string_view expected) const {
    return FileError(file_, absl::StrCat("line ", line_, " ", found), expected);
  }

 private:
  void SkipBlanks();
  absl::Status TakeText();
  absl::Status TakeQuoted();
  void TakeWord();
  void TakeTo(size_t end) {
    token_ = text_.substr(at_, end - at_);
    at_ = end;
    type_ = Type::kValue;
  }
  // Some programs end a file with NUL characters.
  static bool IsBlank(char c) {
    return c == ' ' || c == '\t' || c == '\n' || c == '\r' || c == '\0';
  }

  const SourceFile& file_;
  string_view text_, token_;
  size_t at_ = 0;
  uint64_t line_ = 1, lines_in_token_ = 0;
  Type type_ = Type::kEnd;
};

void CifTokens::SkipBlanks() {
  while (at_ < text_.size()) {
    if (text_[at_] == '#') {
      at_ = std::min(text_.find('\n', at_), text_.size());
    } else if (IsBlank(text_[at_])) {
      line_ += text_[at_] == '\n' ? 1 : 0;
      ++at_;
    } else {
      return;
    }
  }
}

// Reads a text between lines that begin with a semicolon.
absl::Status CifTokens::TakeText() {
  const size_t end = text_.find("\n;", at_);
  if (end == string_view::npos)
    return Wrong("begins a text that does not end", "a line that begins with \";\" ends it");
  TakeTo(end + 2);
  lines_in_token_ = static_cast<uint64_t>(std::count(token_.begin(), token_.end(), '\n'));
  return absl::OkStatus();
}

absl::Status CifTokens::TakeQuoted() {
  const char quote = text_[at_];
  for (size_t i = at_ + 1; i < text_.size() && text_[i] != '\n'; ++i) {
    if (text_[i] != quote || (i + 1 < text_.size() && !IsBlank(text_[i + 1]))) continue;
    TakeTo(i + 1);
    return absl::OkStatus();
  }
  return Wrong("has a quotation mark that is not closed",
               "a value in quotation marks ends in its line");
}

void CifTokens::TakeWord() {
  size_t end = at_;
  while (end < text_.size() && !IsBlank(text_[end])) ++end;
  TakeTo(end);
  if (token_[0] == '_') {
    type_ = Type::kTag;
  } else if (absl::StartsWithIgnoreCase(token_, "data_")) {
    type_ = Type::kData;
  } else if (absl::EqualsIgnoreCase(token_, "loop_")) {
    type_ = Type::kLoop;
  } else if (absl::StartsWithIgnoreCase(token_, "save_")) {
    type_ = Type::kSave;
  } else if (absl::EqualsIgnoreCase(token_, "global_") || absl::EqualsIgnoreCase(token_, "stop_")) {
    type_ = Type::kOther;
  }
}

absl::Status CifTokens::Next() {
  line_ += std::exchange(lines_in_token_, 0);
  SkipBlanks();
  type_ = Type::kEnd;
  token_ = "";
  if (at_ >= text_.size()) return absl::OkStatus();
  const char c = text_[at_];
  if (c == ';' && (at_ == 0 || text_[at_ - 1] == '\n')) return TakeText();
  if (c == '\'' || c == '"') return TakeQuoted();
  TakeWord();
  return absl::OkStatus();
}

// Returns whether a table of a block is drawn, or describes something that is not drawn.
bool IsKept(string_view tag) {
  static constexpr string_view kKept[] = {"_atom_site.cartn_",    "_atom_site.type_symbol",
                                          "_atom_site.label_",    "_atom_site.auth_",
                                          "_atom_site.pdbx_pdb_", "_atom_site.occupancy",
                                          "_atom_site.b_iso",     "_atom_site.pdbx_formal_charge",
                                          "_atom_site_label",     "_atom_site_type_symbol",
                                          "_atom_site_fract_",    "_atom_site_u_iso",
                                          "_atom_site_b_iso",     "_atom_site_occupancy",
                                          "_atom_site_disorder_", "_cell_length_",
                                          "_cell_angle_",         "_cell.angle_",
                                          "_symmetry_",           "_symmetry.",
                                          "_space_group_",        "_space_group.",
                                          "_chem_comp_atom.",     "_chem_comp_bond.",
                                          "_struct_conn.",        "_struct_conf.",
                                          "_struct_sheet_range.", "_pdbx_struct_oper_list.",
                                          "_struct_ncs_oper."};
  return std::any_of(std::begin(kKept), std::end(kKept),
                     [tag](string_view kept) { return absl::StartsWithIgnoreCase(tag, kept); });
}

bool IsPlace(string_view tag) {
  return absl::EqualsIgnoreCase(tag, "_atom_site.Cartn_x") ||
         absl::EqualsIgnoreCase(tag, "_atom_site_fract_x") ||
         absl::EqualsIgnoreCase(tag, "_chem_comp_atom.x") ||
         absl::EqualsIgnoreCase(tag, "_chem_comp_atom.model_Cartn_x") ||
         absl::EqualsIgnoreCase(tag, "_chem_comp_atom.pdbx_model_Cartn_x_ideal");
}

// Columns of _atom_site, in the order in which CifReader::Read requests them: those of mmCIF, and
// below them those of small molecules.
enum : size_t {
  kX,
  kY,
  kZ,
  kSymbol,
  kName,
  kAuthName,
  kAlt,
  kComp,
  kAuthComp,
  kAsym,
  kAuthAsym,
  kSeq,
  kAuthSeq,
  kInsertion,
  kModel,
  kOccupancy,
  kB,
  kCharge
};
enum : size_t {
  kFractX,
  kFractY,
  kFractZ,
  kLabel,
  kType,
  kUIso,
  kBIso,
  kSiteOccupancy,
  kAssembly,
  kGroup
};
constexpr size_t kMostPairs = 10000, kMostLoops = 1000;

// Returns the value that is written so; empty if it is unknown (?) or does not apply (.).
std::string ValueOf(string_view written) {
  if (written == "." || written == "?") return "";
  if (written.size() > 1 && (written[0] == '\'' || written[0] == '"'))
    return std::string(written.substr(1, written.size() - 2));
  if (absl::ConsumePrefix(&written, ";")) absl::ConsumeSuffix(&written, "\n;");
  return std::string(written);
}

double NumberOf(const std::string& value) {
  return value.empty() ? std::numeric_limits<double>::quiet_NaN() : gemmi::cif::as_number(value);
}

struct CifTable {
  std::vector<std::string> tags;    // in lower case
  std::vector<std::string> values;  // row after row
};

// Some columns of a table; missing columns have empty values.
class CifColumns {
 public:
  CifColumns() = default;
  CifColumns(const CifTable* table, std::vector<size_t> places)
      : table_(table), places_(std::move(places)) {}

  size_t rows() const {
    return table_ == nullptr ? 0 : table_->values.size() / table_->tags.size();
  }
  const std::string& Text(size_t row, size_t column) const {
    static const std::string kNone;
    const size_t place = places_[column];
    return place == SIZE_MAX ? kNone : table_->values[row * table_->tags.size() + place];
  }
  double Number(size_t row, size_t column) const { return NumberOf(Text(row, column)); }
  bool HasNumbers(size_t column) const {
    for (size_t row = 0; row < rows(); ++row) {
      if (!std::isnan(Number(row, column))) return true;
    }
    return false;
  }

 private:
  const CifTable* table_ = nullptr;
  std::vector<size_t> places_;
};

struct CifBlock {
  CifTable pairs;  // one row
  std::vector<CifTable> loops;

  // Returns: the columns `names` after `prefix` of the table that has the first of them; no rows if
  // no table has it.
  CifColumns Find(string_view prefix, const std::vector<string_view>& names) const {
    const auto place = [&](const CifTable& table, string_view name) {
      const auto at = std::find(table.tags.begin(), table.tags.end(),
                                absl::AsciiStrToLower(absl::StrCat(prefix, name)));
      return at == table.tags.end() ? SIZE_MAX : static_cast<size_t>(at - table.tags.begin());
    };
    const CifTable* found = place(pairs, names[0]) != SIZE_MAX ? &pairs : nullptr;
    for (const CifTable& loop : loops) {
      if (found == nullptr && place(loop, names[0]) != SIZE_MAX) found = &loop;
    }
    if (found == nullptr) return {};
    std::vector<size_t> places;
    places.reserve(names.size());
    for (const string_view name : names) places.push_back(place(*found, name));
    return {found, std::move(places)};
  }
};

class CifReader {
 public:
  CifReader(const SourceFile& file, string_view text)
      : file_(file), text_(text), tokens_(file, text) {}

  absl::Status Read(Builder* builder, Model* model);

 private:
  using Type = CifTokens::Type;

  absl::Status ReadBlocks();
  absl::Status ReadPair();
  absl::Status ReadLoop();
  void EndBlock();
  absl::Status ReadAtoms(const CifColumns& table, Builder* builder, Model* model);
  void ReadComponent(Builder* builder, Model* model);
  absl::Status ReadCrystal(const CifColumns& sites, Builder* builder, Model* model);
  void AddConnections(Builder* builder, Model* model);
  void AddComponentBonds(Builder* builder);
  void CountTheRest(Model* model);
  std::string FirstOf(std::initializer_list<const char*> tags) const;
  void CountSymmetry(Model* model) const;

  // The atoms of a residue with their names, in the order of the file.
  struct ResidueAtoms {
    std::string component;
    std::vector<std::pair<std::string, uint32_t>> atoms;
  };

  const SourceFile& file_;
  const string_view text_;
  CifTokens tokens_;
  CifBlock block_;  // the first block with atoms, once everything is read
  std::optional<CifBlock> first_;
  bool has_atoms_ = false, in_frame_ = false;
  uint64_t further_blocks_ = 0;
  std::vector<ResidueAtoms> residues_;
  Addresses by_author_, by_label_;
};

void CifReader::EndBlock() {
  if (has_atoms_ && first_) ++further_blocks_;
  if (has_atoms_ && !first_) first_ = std::move(block_);
  block_ = {};
  has_atoms_ = false;
}

absl::Status CifReader::ReadPair() {
  const std::string tag = absl::AsciiStrToLower(tokens_.text());
  if (absl::Status status = tokens_.Next(); !status.ok()) return status;
  if (tokens_.type() != Type::kValue) {
    return tokens_.Wrong(
        absl::StrCat("follows the tag ", EscapeForTerminal(tag.substr(0, 60)), " without a value"),
        "a value is expected");
  }
  if (!in_frame_ && IsKept(tag)) {
    has_atoms_ |= IsPlace(tag);
    if (!first_ && block_.pairs.tags.size() < kMostPairs) {
      block_.pairs.tags.push_back(tag);
      block_.pairs.values.push_back(ValueOf(tokens_.text()));
    }
  }
  return tokens_.Next();
}

absl::Status CifReader::ReadLoop() {
  const uint64_t line = tokens_.line();
  CifTable table;
  std::vector<bool> is_kept;
  absl::Status status = tokens_.Next();
  for (; status.ok() && tokens_.type() == Type::kTag; status = tokens_.Next()) {
    is_kept.push_back(!in_frame_ && IsKept(tokens_.text()));
    if (is_kept.back()) {
      table.tags.push_back(absl::AsciiStrToLower(tokens_.text()));
      has_atoms_ |= IsPlace(table.tags.back());
    }
  }
  if (!status.ok()) return status;
  if (is_kept.empty()) return tokens_.Wrong("follows loop_ without a tag", "a tag is expected");
  uint64_t count = 0;
  for (; status.ok() && tokens_.type() == Type::kValue; status = tokens_.Next()) {
    if (is_kept[count++ % is_kept.size()] && !first_)
      table.values.push_back(ValueOf(tokens_.text()));
  }
  if (!status.ok()) return status;
  if (count % is_kept.size() != 0) {
    return FileError(file_,
                     absl::StrCat("the loop of line ", line, " has ", count, " values and ",
                                  is_kept.size(), " tags"),
                     "the same number of values for each tag is expected");
  }
  if (!table.tags.empty() && !first_ && block_.loops.size() < kMostLoops)
    block_.loops.push_back(std::move(table));
  return absl::OkStatus();
}

absl::Status CifReader::ReadBlocks() {
  absl::Status status = tokens_.Next();
  if (!status.ok()) return status;
  if (tokens_.type() != Type::kData && tokens_.type() != Type::kOther) {
    return FileError(file_, absl::StrCat("is ", DescribeContents(text_)),
                     "a CIF file begins with data_ and a name");
  }
  while (status.ok() && tokens_.type() != Type::kEnd) {
    switch (tokens_.type()) {
      case Type::kData:
        EndBlock();
        in_frame_ = false;
        status = tokens_.Next();
        break;
      case Type::kSave:
        in_frame_ = tokens_.text().size() > 5;
        status = tokens_.Next();
        break;
      case Type::kOther:
        status = tokens_.Next();
        break;
      case Type::kTag:
        status = ReadPair();
        break;
      case Type::kLoop:
        status = ReadLoop();
        break;
      default:
        return tokens_.Wrong(
            absl::StrCat("has \"", EscapeForTerminal(tokens_.text().substr(0, 24)), "\""),
            "a tag, loop_ or data_ is expected");
    }
  }
  if (!status.ok()) return status;
  EndBlock();
  if (!first_) {
    return FileError(file_, "is a CIF file without coordinates",
                     "a table _atom_site or _chem_comp_atom with coordinates is expected");
  }
  block_ = std::move(*first_);
  return absl::OkStatus();
}

absl::Status CifReader::Read(Builder* builder, Model* model) {
  if (absl::Status status = ReadBlocks(); !status.ok()) return status;
  const CifColumns atoms =
      block_.Find("_atom_site.",
                  {"Cartn_x", "Cartn_y", "Cartn_z", "type_symbol", "label_atom_id", "auth_atom_id",
                   "label_alt_id", "label_comp_id", "auth_comp_id", "label_asym_id", "auth_asym_id",
                   "label_seq_id", "auth_seq_id", "pdbx_PDB_ins_code", "pdbx_PDB_model_num",
                   "occupancy", "B_iso_or_equiv", "pdbx_formal_charge"});
  const CifColumns sites = block_.Find(
      "_atom_site_", {"fract_x", "fract_y", "fract_z", "label", "type_symbol", "U_iso_or_equiv",
                      "B_iso_or_equiv", "occupancy", "disorder_assembly", "disorder_group"});
  CountSymmetry(model);
  absl::Status status;
  if (atoms.rows() > 0) {
    status = ReadAtoms(atoms, builder, model);
  } else if (sites.rows() > 0) {
    status = ReadCrystal(sites, builder, model);
  } else {
    ReadComponent(builder, model);
  }
  if (!status.ok()) return status;
  if (builder->size() == 0) {
    return FileError(file_, "has no atom with coordinates",
                     "numbers are expected in the tables of atoms");
  }
  AddLeftOut("further blocks with atoms", further_blocks_, model);
  AddConnections(builder, model);
  AddComponentBonds(builder);
  CountTheRest(model);
  return absl::OkStatus();
}

absl::Status CifReader::ReadAtoms(const CifColumns& table, Builder* builder, Model* model) {
  model->format = "mmCIF molecule";
  const bool has_links = block_.Find("_struct_conn.", {"conn_type_id"}).rows() > 0;
  std::string last_model, last_residue;
  absl::flat_hash_set<string_view> further;
  uint64_t nowhere = 0;
  for (size_t row = 0; row < table.rows(); ++row) {
    const auto text = [&](size_t column) -> const std::string& { return table.Text(row, column); };
    const auto first_of = [&](size_t one, size_t other) -> const std::string& {
      return text(one).empty() ? text(other) : text(one);
    };
    if (text(kModel) != table.Text(0, kModel)) {
      further.insert(text(kModel));
      continue;
    }
    const std::string &asym = first_of(kAuthAsym, kAsym), &seq = first_of(kAuthSeq, kSeq);
    const std::string residue = Address(asym, seq, text(kInsertion), "");
    if (!builder->Chooses(text(kAlt).empty() ? ' ' : text(kAlt)[0], residue)) continue;
    const Point3 at = {table.Number(row, kX), table.Number(row, kY), table.Number(row, kZ)};
    if (std::isnan(at.x) || std::isnan(at.y) || std::isnan(at.z)) {
      ++nowhere;
      continue;
    }
    if (builder->size() >= kMostAtoms) {
      return FileError(file_, absl::StrCat("has more than ", kMostAtoms, " atoms"),
                       "so large a molecule is not read");
    }
    const std::string& name = first_of(kName, kAuthName);
    const gemmi::Element element(text(kSymbol).empty() ? name.substr(0, 1) : text(kSymbol));
    double number = 0;
    const uint32_t index =
        builder->Add({at, &ElementOf(element)},
                     {.b_factor = AttributeOf(table.Number(row, kB)),
                      .occupancy = AttributeOf(table.Number(row, kOccupancy)),
                      .charge = AttributeOf(table.Number(row, kCharge)),
                      .chain = builder->ChainNumber(asym),
                      .residue = absl::SimpleAtod(seq, &number) ? AttributeOf(number) : kNoValue});
    if (residue != last_residue || residues_.empty()) {
      residues_.push_back({first_of(kComp, kAuthComp), {}});
      last_residue = residue;
    }
    if (has_links) {
      by_author_.emplace(Address(asym, seq, text(kInsertion), name), index);
      by_label_.emplace(Address(text(kAsym), text(kSeq), "", name), index);
    }
    residues_.back().atoms.emplace_back(name, index);
  }
  AddLeftOut(kFurtherModels, further.size(), model);
  AddLeftOut(kNoPlace, nowhere, model);
  return absl::OkStatus();
}

// A component may have several kinds of coordinates; the first kind is shown.
void CifReader::ReadComponent(Builder* builder, Model* model) {
  model->format = "CIF chemical component";
  using Names = std::vector<string_view>;
  uint64_t kinds = 0, nowhere = 0;
  for (const Names& names :
       {Names{"x", "y", "z", "type_symbol", "atom_id", "charge"},
        Names{"model_Cartn_x", "model_Cartn_y", "model_Cartn_z", "type_symbol", "atom_id",
              "charge"},
        Names{"pdbx_model_Cartn_x_ideal", "pdbx_model_Cartn_y_ideal", "pdbx_model_Cartn_z_ideal",
              "type_symbol", "atom_id", "charge"}}) {
    const CifColumns table = block_.Find("_chem_comp_atom.", names);
    if (!table.HasNumbers(0) || ++kinds > 1) continue;
    residues_.emplace_back();
    for (size_t row = 0; row < table.rows(); ++row) {
      const Point3 at = {table.Number(row, 0), table.Number(row, 1), table.Number(row, 2)};
      if (std::isnan(at.x) || std::isnan(at.y) || std::isnan(at.z)) {
        ++nowhere;
        continue;
      }
      const uint32_t index = builder->Add({at, &ElementOf(gemmi::Element(table.Text(row, 3)))},
                                          {.charge = AttributeOf(table.Number(row, 5))});
      residues_.back().atoms.emplace_back(table.Text(row, 4), index);
    }
  }
  AddLeftOut(kFurtherModels, kinds > 0 ? kinds - 1 : 0, model);
  AddLeftOut(kNoPlace, nowhere, model);
}

// Returns the first value of these tags that the block has; empty if it has none.
std::string CifReader::FirstOf(std::initializer_list<const char*> tags) const {
  for (const char* tag : tags) {
    const CifColumns one = block_.Find("", {tag});
    if (one.rows() > 0 && !one.Text(0, 0).empty()) return one.Text(0, 0);
  }
  return "";
}

// Looks for the names of CIF's core dictionary and, with a point, of mmCIF's.
void CifReader::CountSymmetry(Model* model) const {
  uint64_t operators = 0;
  for (const char* tag : {"_space_group_symop_operation_xyz", "_symmetry_equiv_pos_as_xyz",
                          "_space_group_symop.operation_xyz", "_symmetry_equiv.pos_as_xyz"})
    operators = std::max<uint64_t>(operators, block_.Find("", {tag}).rows());
  CountCrystalCopies(operators,
                     FirstOf({"_space_group_name_H-M_alt", "_symmetry_space_group_name_H-M",
                              "_space_group.name_H-M_alt", "_symmetry.space_group_name_H-M"}),
                     FirstOf({"_space_group_IT_number", "_symmetry_Int_Tables_number",
                              "_space_group.IT_number", "_symmetry.Int_Tables_number"}),
                     NumberOf(FirstOf({"_cell_angle_alpha", "_cell.angle_alpha"})),
                     NumberOf(FirstOf({"_cell_angle_gamma", "_cell.angle_gamma"})), model);
}

// Reads the atoms of a crystal's asymmetric unit; where they are disordered, those of the first
// group of each assembly.
absl::Status CifReader::ReadCrystal(const CifColumns& sites, Builder* builder, Model* model) {
  model->format = "CIF crystal";
  gemmi::UnitCell cell;
  const double a = NumberOf(FirstOf({"_cell_length_a"})), b = NumberOf(FirstOf({"_cell_length_b"})),
               c = NumberOf(FirstOf({"_cell_length_c"}));
  std::array<double, 3> angles = {};
  size_t missing = 0;
  for (size_t i = 0; i < 3; ++i) {
    const char* const kTags[] = {"_cell_angle_alpha", "_cell_angle_beta", "_cell_angle_gamma"};
    const std::string written = FirstOf({kTags[i]});
    angles[i] = written.empty() ? kDefaultAngle : NumberOf(written);
    missing += written.empty() ? 1 : 0;
  }
  if (!(a > 0 && b > 0 && c > 0 && angles[0] > 0 && angles[1] > 0 && angles[2] > 0)) {
    return FileError(file_, "has fractional coordinates without a unit cell",
                     "numbers in _cell_length_a to _cell_angle_gamma are expected");
  }
  if (missing > 0) AddNote("angles of the unit cell that it does not have are 90°", model);
  cell.set(a, b, c, angles[0], angles[1], angles[2]);
  absl::flat_hash_map<string_view, string_view> groups;  // the first of each assembly
  uint64_t nowhere = 0, others = 0;
  for (size_t row = 0; row < sites.rows(); ++row) {
    const std::string& group = sites.Text(row, kGroup);
    if (!group.empty() &&
        groups.emplace(sites.Text(row, kAssembly), group).first->second != group) {
      ++others;
      continue;
    }
    const gemmi::Position at = cell.orthogonalize(gemmi::Fractional(
        sites.Number(row, kFractX), sites.Number(row, kFractY), sites.Number(row, kFractZ)));
    if (std::isnan(at.x) || std::isnan(at.y) || std::isnan(at.z)) {
      ++nowhere;
      continue;
    }
    if (builder->size() >= kMostAtoms) break;
    gemmi::SmallStructure::Site site;
    const std::string& symbol = sites.Text(row, sites.Text(row, kType).empty() ? kLabel : kType);
    if (!symbol.empty()) gemmi::split_element_and_charge(symbol, &site);
    const double u = sites.Number(row, kUIso);
    builder->Add(
        {{at.x, at.y, at.z}, &ElementOf(site.element)},
        {.b_factor = AttributeOf(std::isnan(u) ? sites.Number(row, kBIso) : u * gemmi::u_to_b()),
         .occupancy = AttributeOf(sites.Number(row, kSiteOccupancy)),
         .charge = static_cast<double>(site.charge)});
  }
  AddLeftOut(kOtherLocations, others, model);
  AddLeftOut(kNoPlace, nowhere, model);
  return absl::OkStatus();
}

void CifReader::AddConnections(Builder* builder, Model* model) {
  const CifColumns table = block_.Find(
      "_struct_conn.",
      {"conn_type_id", "ptnr1_label_asym_id", "ptnr1_label_seq_id", "ptnr1_label_atom_id",
       "ptnr1_auth_asym_id", "ptnr1_auth_seq_id", "pdbx_ptnr1_PDB_ins_code", "ptnr1_symmetry",
       "ptnr2_label_asym_id", "ptnr2_label_seq_id", "ptnr2_label_atom_id", "ptnr2_auth_asym_id",
       "ptnr2_auth_seq_id", "pdbx_ptnr2_PDB_ins_code", "ptnr2_symmetry"});
  for (size_t row = 0; row < table.rows(); ++row) {
    const auto text = [&](size_t column) -> const std::string& { return table.Text(row, column); };
    const std::string type = absl::AsciiStrToLower(text(0));
    if (absl::StartsWith(type, "hydrog")) {
      AddLeftOut("hydrogen bonds", 1, model);
      continue;
    }
    if (!absl::StartsWith(type, "coval") && type != "disulf" && type != "metalc" &&
        type != "modres") {
      AddLeftOut("other contacts", 1, model);
      continue;
    }
    if (text(7) != text(14)) {
      AddLeftOut(kSymmetricBonds, 1, model);
      continue;
    }
    std::array<std::optional<uint32_t>, 2> ends;
    for (size_t end = 0; end < 2; ++end) {
      const size_t at = 7 * end;
      const bool is_author = !text(at + 4).empty() && !text(at + 5).empty();
      const Addresses& addresses = is_author ? by_author_ : by_label_;
      const auto found =
          addresses.find(is_author ? Address(text(at + 4), text(at + 5), text(at + 6), text(at + 3))
                                   : Address(text(at + 1), text(at + 2), "", text(at + 3)));
      if (found != addresses.end()) ends[end] = found->second;
    }
    if (ends[0] && ends[1]) builder->AddBond(*ends[0], *ends[1]);
  }
}

void CifReader::AddComponentBonds(Builder* builder) {
  const CifColumns table = block_.Find("_chem_comp_bond.", {"atom_id_1", "atom_id_2", "comp_id"});
  absl::flat_hash_map<string_view, std::vector<size_t>> bonds;  // row numbers by component
  for (size_t row = 0; row < table.rows(); ++row) bonds[table.Text(row, 2)].push_back(row);
  absl::flat_hash_map<string_view, uint32_t> atoms;
  for (const ResidueAtoms& residue : residues_) {
    // A component's own table of atoms does not repeat its name.
    const auto named = residue.component.empty() ? bonds.begin() : bonds.find(residue.component);
    if (named == bonds.end()) continue;
    // If a component has many more bonds than a residue has atoms, checking them for each residue
    // would take too long.
    if (residues_.size() > 1 && named->second.size() > 1000) continue;
    atoms.clear();
    for (const auto& [name, index] : residue.atoms) atoms.emplace(name, index);
    for (const size_t row : named->second) {
      const auto from = atoms.find(table.Text(row, 0)), to = atoms.find(table.Text(row, 1));
      if (from != atoms.end() && to != atoms.end()) builder->AddBond(from->second, to->second);
    }
  }
}

// Counts what the file describes and the drawing does not show.
void CifReader::CountTheRest(Model* model) {
  const CifColumns parts = block_.Find("_struct_conf.", {"conf_type_id"});
  for (size_t row = 0; row < parts.rows(); ++row) {
    const std::string type = absl::AsciiStrToUpper(parts.Text(row, 0));
    if (absl::StartsWith(type, "HELX")) AddLeftOut(kHelices, 1, model);
    if (absl::StartsWith(type, "STRN")) AddLeftOut(kStrands, 1, model);
    if (absl::StartsWith(type, "TURN")) AddLeftOut("turns", 1, model);
  }
  AddLeftOut(kStrands, block_.Find("_struct_sheet_range.", {"sheet_id"}).rows(), model);
  const std::vector<string_view> columns = {
      "matrix[1][1]", "matrix[1][2]", "matrix[1][3]", "vector[1]",    "matrix[2][1]",
      "matrix[2][2]", "matrix[2][3]", "vector[2]",    "matrix[3][1]", "matrix[3][2]",
      "matrix[3][3]", "vector[3]",    "code"};
  const auto count = [&](const char* prefix, const char* kind) {
    const CifColumns table = block_.Find(prefix, columns);
    for (size_t row = 0; row < table.rows(); ++row) {
      bool is_identity = table.Text(row, 12) == "given";
      if (!is_identity) {
        is_identity = true;
        for (size_t k = 0; k < 12; ++k)
          is_identity = is_identity && std::abs(table.Number(row, k) - (k % 5 == 0 ? 1 : 0)) < 1e-6;
      }
      AddLeftOut(kind, is_identity ? 0 : 1, model);
    }
  };
  count("_pdbx_struct_oper_list.", kCopies);
  count("_struct_ncs_oper.", kNcsCopies);
}

absl::StatusOr<Model> ReadText(const SourceFile& file, string_view extension, string_view text,
                               MoleculeStyle style, bool attributes) {
  Builder builder;
  Model model;
  absl::Status status = extension == "pdb" || extension == "ent"
                            ? PdbReader(file, text).Read(&builder, &model)
                            : CifReader(file, text).Read(&builder, &model);
  if (!status.ok()) return status;
  status = std::move(builder).Draw(file, style, attributes, &model);
  if (!status.ok()) return status;
  return model;
}

}  // namespace

absl::StatusOr<Model> ReadMolecule(const SourceFile& file, MoleculeStyle style, bool attributes) {
  try {
    if (file.extension != "gz")
      return ReadText(file, file.extension, file.bytes, style, attributes);
    const absl::StatusOr<std::string> text = Inflate(file, file.bytes, kMostUnpacked + 1);
    if (!text.ok()) return text.status();
    if (text->size() > kMostUnpacked) {
      return FileError(file, absl::StrCat("has more than ", kMostUnpacked, " bytes of text"),
                       "so large a molecule is not read");
    }
    const bool is_pdb = absl::EndsWithIgnoreCase(file.path, ".pdb.gz") ||
                        absl::EndsWithIgnoreCase(file.path, ".ent.gz");
    return ReadText(file, is_pdb ? "pdb" : "cif", *text, style, attributes);
  } catch (const std::bad_alloc&) {
    throw;  // the reading process is responsible for its memory
  } catch (const std::exception& error) {
    return FileError(file,
                     absl::StrCat("gemmi cannot read it (", EscapeForTerminal(error.what()), ")"),
                     "a molecule as the Protein Data Bank writes it is expected");
  }
}

}  // namespace voxeld::voxelctl
