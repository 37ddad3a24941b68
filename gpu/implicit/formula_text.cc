#include "gpu/implicit/formula_text.h"

#include <array>
#include <iterator>

#include "absl/strings/str_cat.h"
#include "gpu/implicit/hoisted.h"

namespace voxeld::gpu::implicit {
namespace {

Instruction At(const uint32_t* code, uint32_t i) { return {code[2 * i], code[2 * i + 1]}; }

const char* FunctionOf(Op op) {
  switch (op) {
    case Op::kNeg:
      return "Neg";
    case Op::kAbs:
      return "Abs";
    case Op::kSquare:
      return "Square";
    case Op::kSqrt:
      return "Sqrt";
    case Op::kCbrt:
      return "Cbrt";
    case Op::kSin:
      return "Sin";
    case Op::kCos:
      return "Cos";
    case Op::kExp:
      return "Exp";
    case Op::kLog:
      return "Log";
    case Op::kFloor:
      return "Floor";
    case Op::kPowI:
      return "PowI";
    case Op::kAdd:
      return "Add";
    case Op::kSub:
      return "Sub";
    case Op::kMul:
      return "Mul";
    case Op::kDiv:
      return "Div";
    case Op::kMin:
      return "Min";
    case Op::kMax:
      return "Max";
    case Op::kAtan2:
      return "Atan2";
    case Op::kConstant:
    case Op::kX:
    case Op::kY:
    case Op::kZ:
    case Op::kVoxel:
    case Op::kHoisted:
      break;
  }
  return "";
}

// Returns the approximate cost in simple operations; branches, polynomials and double precision
// cost more.
uint64_t WeightOf(Op op) {
  switch (op) {
    case Op::kSin:
    case Op::kCos:
    case Op::kExp:
    case Op::kLog:
    case Op::kAtan2:
      return 30;
    case Op::kCbrt:
      return 60;
    case Op::kPowI:
      return 20;
    case Op::kDiv:
    case Op::kSqrt:
      return 8;
    default:
      return 1;
  }
}

// Where the value of an instruction is computed.
enum class Where : uint8_t {
  kAnywhere,  // nowhere in particular: a leaf that is the same everywhere
  kRow,       // once per row
  kVoxel,
};

class Writer {
 public:
  explicit Writer(std::span<const uint32_t> hoisted)
      : view_{hoisted.data()},
        first_word_(static_cast<uint32_t>(view_.rest_code() - hoisted.data())) {
    const uint32_t count = view_.rest();
    where_.resize(count);
    arguments_.resize(count);
    kept_.resize(count);
    std::array<uint32_t, kMostSlots> last = {};
    for (uint32_t i = 0; i < count; ++i) {
      const Instruction in = At(view_.rest_code(), i);
      arguments_[i] = {last[in.a()], last[in.b()]};
      where_[i] = WhereOf(in, arguments_[i]);
      last[in.to()] = i;
      if (where_[i] != Where::kVoxel || IsLeaf(in.op())) continue;
      Keep(arguments_[i][0]);
      if (IsBinary(in.op())) Keep(arguments_[i][1]);
    }
    root_ = last[view_.rest_slot()];
    Keep(root_);
  }

  std::string Text() const {
    std::string fields, row, voxel;
    for (uint32_t i = 0; i < where_.size(); ++i) {
      if (where_[i] == Where::kAnywhere) continue;
      const bool once = where_[i] == Where::kRow;
      const std::string value = ValueOf(i, once);
      if (once && kept_[i]) {
        absl::StrAppend(&fields, "    N n", i, ";\n");
        absl::StrAppend(&row, "      n", i, " = ", value, ";\n");
      } else {
        absl::StrAppend(once ? &row : &voxel, once ? "      const N n" : "    const M n", i, " = ",
                        value, ";\n");
      }
    }
    return absl::StrCat("struct Formula {\n  template <class N>\n  struct Row {\n", fields,
                        "    template <class At>\n    VOXELD_HD explicit Row(const At& at) {\n",
                        row,
                        "    }\n  };\n  template <class M, class N, class At>\n"
                        "  static VOXELD_HD M Value(const Row<N>& row, const At& at) {\n",
                        voxel, "    return ", Argument(root_, /*once=*/false), ";\n  }\n};\n");
  }

 private:
  Where WhereOf(const Instruction& in, const std::array<uint32_t, 2>& arguments) const {
    switch (in.op()) {
      case Op::kConstant:
      case Op::kVoxel:
        return Where::kAnywhere;
      case Op::kX:
      case Op::kY:
      case Op::kZ:
        return Where::kVoxel;
      case Op::kHoisted:
        return view_.axis_of(in.immediate) == 0 ? Where::kVoxel : Where::kRow;
      default:
        break;
    }
    const bool voxel = where_[arguments[0]] == Where::kVoxel ||
                       (IsBinary(in.op()) && where_[arguments[1]] == Where::kVoxel);
    return voxel ? Where::kVoxel : Where::kRow;
  }
  void Keep(uint32_t i) { kept_[i] = where_[i] == Where::kRow; }

  // Returns the expression for a value, within the row's code (`once`) or a voxel's.
  std::string Argument(uint32_t i, bool once) const {
    if (where_[i] == Where::kAnywhere) return ValueOf(i, once);
    if (where_[i] == Where::kRow && !once) return absl::StrCat("Spread(row.n", i, ", M())");
    return absl::StrCat("n", i);
  }

  std::string ValueOf(uint32_t i, bool once) const {
    const Instruction in = At(view_.rest_code(), i);
    switch (in.op()) {
      case Op::kConstant:
        return absl::StrCat("at.Constant(", first_word_ + 2 * i + 1, ")");
      case Op::kVoxel:
        return "at.Voxel()";
      case Op::kX:
      case Op::kY:
      case Op::kZ:
        return absl::StrCat("at.Coordinate(", static_cast<int>(in.op()) - static_cast<int>(Op::kX),
                            ")");
      case Op::kHoisted:
        return absl::StrCat("at.Hoisted(", view_.axis_of(in.immediate), ", ", in.immediate, ")");
      default:
        break;
    }
    std::string value = absl::StrCat(FunctionOf(in.op()), "(", Argument(arguments_[i][0], once));
    if (IsBinary(in.op())) absl::StrAppend(&value, ", ", Argument(arguments_[i][1], once));
    if (in.op() == Op::kPowI) absl::StrAppend(&value, ", ", static_cast<int32_t>(in.immediate));
    return value + ")";
  }

  const HoistedView view_;
  const uint32_t first_word_;
  std::vector<Where> where_;
  std::vector<std::array<uint32_t, 2>> arguments_;  // by instruction: those it takes values of
  std::vector<bool> kept_;                          // of the row's values: voxels use them
  uint32_t root_ = 0;
};

}  // namespace

std::vector<uint32_t> FormulaKey(std::span<const uint32_t> hoisted) {
  const HoistedView view{hoisted.data()};
  const uint32_t* const code = view.rest_code();
  std::vector<uint32_t> key = {view.end(0), view.end(1), view.end(2), view.rest_slot(),
                               static_cast<uint32_t>(code - hoisted.data())};
  key.reserve(key.size() + 2 * view.rest());
  for (uint32_t i = 0; i < view.rest(); ++i) {
    const Instruction in = At(code, i);
    key.push_back(in.word);
    key.push_back(in.op() == Op::kConstant ? 0 : in.immediate);
  }
  return key;
}

std::string FormulaText(std::span<const uint32_t> hoisted) { return Writer(hoisted).Text(); }

uint64_t FormulaWeight(std::span<const uint32_t> hoisted) {
  const HoistedView view{hoisted.data()};
  uint64_t weight = 0;
  for (uint32_t i = 0; i < view.rest(); ++i) weight += WeightOf(At(view.rest_code(), i).op());
  return weight;
}

}  // namespace voxeld::gpu::implicit
