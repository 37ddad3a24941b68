// Expressions of a shape's own coordinates, for implicit shapes: as text, or built from terms.
//
//   using namespace voxeld::client::expressions;
//   session.Set("bowl", Implicit{.surface = "x^2 + y^2 - z = 0", .bound = square(x) + square(y) <= 1});
//
// docs/expressions.md describes the syntax of text. A condition is a number that is ≤ 0 where it is
// true: square(x) <= 1 is square(x) - 1, and max is "and".
#pragma once

#include <cstdint>
#include <initializer_list>
#include <string>
#include <utility>
#include <variant>
#include <vector>

namespace voxeld::client {
namespace expressions {

// The numbers of the wire's Expression.Tree.Op.
enum class Op : uint8_t {
  kConstant = 1,
  kX,
  kY,
  kZ,
  kParameter,
  kVoxel,
  kNegate,
  kAbs,
  kSquare,
  kSqrt,
  kCbrt,
  kSin,
  kCos,
  kTan,
  kAsin,
  kAcos,
  kAtan,
  kExp,
  kLog,
  kFloor,
  kAdd,
  kSubtract,
  kMultiply,
  kDivide,
  kPower,
  kAtan2,
  kModulo,
  kMin,
  kMax,
  kDifference,
  kSmoothMin,
  kSmoothMax,
};

// A number as a function of x, y and z, in postfix order; `values` and `names` are those of its
// constants and parameters, in turn. Immutable. A number that is not finite, or an invalid name, is
// rejected when the shape is sent.
class Term {
 public:
  Term(double number) : ops_{Op::kConstant}, values_{number} {}  // NOLINT: implicit
  // An operation applied to its operands.
  explicit Term(Op op, std::initializer_list<Term> operands = {});
  static Term Parameter(std::string name);

  const std::vector<Op>& ops() const { return ops_; }
  const std::vector<double>& values() const { return values_; }
  const std::vector<std::string>& names() const { return names_; }

 private:
  std::vector<Op> ops_;
  std::vector<double> values_;
  std::vector<std::string> names_;
};

inline const Term x(Op::kX), y(Op::kY), z(Op::kZ);
inline const Term voxel(Op::kVoxel);  // the edge of a voxel in the shape's units
// Names an entry of Implicit::parameters. A name has letters, digits and _, and begins with no
// digit.
inline Term parameter(std::string name) { return Term::Parameter(std::move(name)); }

inline Term operator-(const Term& a) { return Term(Op::kNegate, {a}); }
inline Term operator+(const Term& a, const Term& b) { return Term(Op::kAdd, {a, b}); }
inline Term operator-(const Term& a, const Term& b) { return Term(Op::kSubtract, {a, b}); }
inline Term operator*(const Term& a, const Term& b) { return Term(Op::kMultiply, {a, b}); }
inline Term operator/(const Term& a, const Term& b) { return Term(Op::kDivide, {a, b}); }
inline Term operator<=(const Term& a, const Term& b) { return a - b; }
inline Term operator>=(const Term& a, const Term& b) { return b - a; }

inline Term abs(const Term& a) { return Term(Op::kAbs, {a}); }
inline Term square(const Term& a) { return Term(Op::kSquare, {a}); }
inline Term sqrt(const Term& a) { return Term(Op::kSqrt, {a}); }
inline Term cbrt(const Term& a) { return Term(Op::kCbrt, {a}); }
inline Term sin(const Term& a) { return Term(Op::kSin, {a}); }
inline Term cos(const Term& a) { return Term(Op::kCos, {a}); }
inline Term tan(const Term& a) { return Term(Op::kTan, {a}); }
inline Term asin(const Term& a) { return Term(Op::kAsin, {a}); }
inline Term acos(const Term& a) { return Term(Op::kAcos, {a}); }
inline Term atan(const Term& a) { return Term(Op::kAtan, {a}); }
inline Term exp(const Term& a) { return Term(Op::kExp, {a}); }
inline Term log(const Term& a) { return Term(Op::kLog, {a}); }
inline Term floor(const Term& a) { return Term(Op::kFloor, {a}); }
inline Term pow(const Term& a, const Term& b) { return Term(Op::kPower, {a, b}); }
inline Term atan2(const Term& a, const Term& b) { return Term(Op::kAtan2, {a, b}); }
// Returns a − b·⌊a/b⌋.
inline Term mod(const Term& a, const Term& b) { return Term(Op::kModulo, {a, b}); }
// On shapes: union, intersection, and what is in a but not in b.
inline Term min(const Term& a, const Term& b) { return Term(Op::kMin, {a, b}); }
inline Term max(const Term& a, const Term& b) { return Term(Op::kMax, {a, b}); }
inline Term difference(const Term& a, const Term& b) { return Term(Op::kDifference, {a, b}); }
// The smaller and the greater value, rounded off where the two differ by less than `within`.
inline Term smooth_min(const Term& a, const Term& b, const Term& within) {
  return Term(Op::kSmoothMin, {a, b, within});
}
inline Term smooth_max(const Term& a, const Term& b, const Term& within) {
  return Term(Op::kSmoothMax, {a, b, within});
}

}  // namespace expressions

// Text, a term, or nothing.
class Expression {
 public:
  Expression() = default;
  Expression(const char* text) : form_(std::string(text)) {}      // NOLINT: implicit
  Expression(std::string text) : form_(std::move(text)) {}        // NOLINT: implicit
  Expression(expressions::Term term) : form_(std::move(term)) {}  // NOLINT: implicit

  bool empty() const {
    const std::string* const said = text();
    return term() == nullptr && (said == nullptr || said->empty());
  }
  // Null if the expression has the other form.
  const std::string* text() const { return std::get_if<std::string>(&form_); }
  const expressions::Term* term() const { return std::get_if<expressions::Term>(&form_); }

 private:
  std::variant<std::monostate, std::string, expressions::Term> form_;
};

}  // namespace voxeld::client
