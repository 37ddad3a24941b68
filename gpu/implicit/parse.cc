#include "gpu/implicit/parse.h"

#include <array>
#include <charconv>
#include <cmath>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"

namespace voxeld::gpu::implicit {
namespace {

using Node = Graph::Node;

enum class Token : uint8_t { kEnd, kNumber, kName, kSymbol };

struct Symbol {
  absl::string_view text, means;
};
// Longer symbols come first.
constexpr Symbol kSymbols[] = {{"**", "^"},
                               {"<=", "<="},
                               {">=", ">="},
                               {"==", "="},
                               {"\xE2\x89\xA4", "<="},
                               {"\xE2\x89\xA5", ">="},
                               {"\xC3\x97", "*"},
                               {"\xC2\xB7", "*"},
                               {"\xC3\xB7", "/"},
                               {"\xE2\x88\x92", "-"},
                               {"+", "+"},
                               {"-", "-"},
                               {"*", "*"},
                               {"/", "/"},
                               {"^", "^"},
                               {"(", "("},
                               {")", ")"},
                               {",", ","},
                               {"<", "<="},
                               {">", ">="},
                               {"=", "="}};

struct Function {
  absl::string_view name;
  int least, most;  // numbers of arguments
  Node (*make)(Graph& g, std::span<const Node> a);
};
constexpr int kAny = 64;

template <Node (Graph::*f)(Node, Node)>
Node Fold(Graph& g, std::span<const Node> a) {
  Node result = a[0];
  for (const Node b : a.subspan(1)) result = (g.*f)(result, b);
  return result;
}
template <Node (Graph::*f)(Node)>
Node One(Graph& g, std::span<const Node> a) {
  return (g.*f)(a[0]);
}
template <Node (Graph::*f)(Node, Node)>
Node Two(Graph& g, std::span<const Node> a) {
  return (g.*f)(a[0], a[1]);
}

constexpr Function kFunctions[] = {
    {"abs", 1, 1, One<&Graph::Abs>},
    {"acos", 1, 1, One<&Graph::Acos>},
    {"asin", 1, 1, One<&Graph::Asin>},
    {"atan", 1, 1, [](Graph& g, std::span<const Node> a) { return g.Atan2(a[0], g.Constant(1)); }},
    {"atan2", 2, 2, Two<&Graph::Atan2>},
    {"cbrt", 1, 1, One<&Graph::Cbrt>},
    {"clamp", 3, 3,
     [](Graph& g, std::span<const Node> a) { return g.Min(g.Max(a[0], a[1]), a[2]); }},
    {"cos", 1, 1, One<&Graph::Cos>},
    {"cosh", 1, 1, One<&Graph::Cosh>},
    {"difference", 2, 2,
     [](Graph& g, std::span<const Node> a) { return g.Max(a[0], g.Neg(a[1])); }},
    {"exp", 1, 1, One<&Graph::Exp>},
    {"floor", 1, 1, One<&Graph::Floor>},
    {"intersection", 2, kAny, Fold<&Graph::Max>},
    {"length", 1, kAny, [](Graph& g, std::span<const Node> a) { return g.Length(a); }},
    {"ln", 1, 1, One<&Graph::Log>},
    {"log", 1, 1, One<&Graph::Log>},
    {"max", 2, kAny, Fold<&Graph::Max>},
    {"min", 2, kAny, Fold<&Graph::Min>},
    {"mod", 2, 2, Two<&Graph::Mod>},
    {"pow", 2, 2, Two<&Graph::Pow>},
    {"root", 2, 2,
     [](Graph& g, std::span<const Node> a) { return g.Pow(a[0], g.Div(g.Constant(1), a[1])); }},
    {"sin", 1, 1, One<&Graph::Sin>},
    {"sinh", 1, 1, One<&Graph::Sinh>},
    {"smax", 3, 3, [](Graph& g, std::span<const Node> a) { return g.SmoothMax(a[0], a[1], a[2]); }},
    {"smin", 3, 3, [](Graph& g, std::span<const Node> a) { return g.SmoothMin(a[0], a[1], a[2]); }},
    {"sqrt", 1, 1, One<&Graph::Sqrt>},
    {"square", 1, 1, One<&Graph::Square>},
    {"tan", 1, 1, One<&Graph::Tan>},
    {"tanh", 1, 1, One<&Graph::Tanh>},
    {"union", 2, kAny, Fold<&Graph::Min>},
};

// The value of a part of the text.
struct Value {
  enum class Is : uint8_t { kNumber, kEquation, kTruth };
  Node node = -1;  // an equation: the difference of its sides; a truth: ≤ 0 if true
  Is is = Is::kNumber;
};
using MaybeValue = absl::StatusOr<Value>;

class Parser {
 public:
  Parser(absl::string_view text, const Parameters& parameters, const ParseLimits& limits,
         Graph& graph)
      : text_(text), parameters_(parameters), limits_(limits), graph_(graph) {}

  absl::StatusOr<ParsedShape> Shape() {
    if (absl::Status status = Next(); !status.ok()) return status;
    MaybeValue value = Condition();
    if (!value.ok()) return value.status();
    ParsedShape shape{value->node, -1, value->is == Value::Is::kTruth};
    if (IsWord("where")) {
      if (absl::Status status = Next(); !status.ok()) return status;
      MaybeValue bound = Condition();
      if (!bound.ok()) return bound.status();
      if (absl::Status status = Require(*bound, Value::Is::kTruth, "after where"); !status.ok()) {
        return status;
      }
      shape.bound = bound->node;
    }
    if (absl::Status status = AtEnd(); !status.ok()) return status;
    return shape;
  }

  absl::StatusOr<Node> Whole(Value::Is is) {
    if (absl::Status status = Next(); !status.ok()) return status;
    MaybeValue value = Condition();
    if (!value.ok()) return value.status();
    if (absl::Status status = AtEnd(); !status.ok()) return status;
    if (absl::Status status = Require(*value, is, ""); !status.ok()) return status;
    return value->node;
  }

 private:
  absl::Status Wrong(absl::string_view what) const {
    // Count characters, not bytes.
    size_t character = 1;
    for (size_t i = 0; i < token_begin_; ++i) character += (text_[i] & 0xC0) != 0x80;
    return absl::InvalidArgumentError(absl::StrCat("at character ", character, ": ", what));
  }
  std::string Found() const {
    return token_ == Token::kEnd
               ? "the end"
               : absl::StrCat("'", Shown(text_.substr(token_begin_, at_ - token_begin_)), "'");
  }
  // Returns the text, shortened if it is longer than a word that a person would type.
  static std::string Shown(absl::string_view text) {
    constexpr size_t kMost = 64;
    return text.size() <= kMost ? std::string(text) : absl::StrCat(text.substr(0, kMost), "…");
  }
  absl::Status AtEnd() const {
    if (token_ == Token::kEnd) return absl::OkStatus();
    return Wrong(absl::StrCat("found ", Found(), " where an operator or the end would be right"));
  }
  absl::Status Require(const Value& value, Value::Is is, absl::string_view where) const {
    if (value.is == is) return absl::OkStatus();
    constexpr absl::string_view kNames[] = {"a number", "an equation", "a condition, as x <= 1"};
    return Wrong(absl::StrCat("what stands before is ", kNames[static_cast<size_t>(value.is)],
                              where.empty() ? "" : " ", where, "; ",
                              kNames[static_cast<size_t>(is)], " would be right"));
  }

  static bool IsNameCharacter(char c) {
    return absl::ascii_isalnum(static_cast<unsigned char>(c)) || c == '_';
  }

  absl::Status Next() {
    while (at_ < text_.size() && absl::ascii_isspace(static_cast<unsigned char>(text_[at_]))) ++at_;
    token_begin_ = at_;
    symbol_ = {};
    if (at_ == text_.size()) {
      token_ = Token::kEnd;
      return absl::OkStatus();
    }
    const char c = text_[at_];
    if (absl::ascii_isdigit(static_cast<unsigned char>(c)) || c == '.') {
      token_ = Token::kNumber;
      const char* const begin = text_.data() + at_;
      const auto [end, error] = std::from_chars(begin, text_.data() + text_.size(), number_);
      if (error != std::errc() || !std::isfinite(static_cast<float>(number_))) {
        at_ = at_ + 1;
        return Wrong("found no number that single precision holds");
      }
      at_ += static_cast<size_t>(end - begin);
      return absl::OkStatus();
    }
    if (absl::ascii_isalpha(static_cast<unsigned char>(c)) || c == '_') {
      token_ = Token::kName;
      while (at_ < text_.size() && IsNameCharacter(text_[at_])) ++at_;
      return absl::OkStatus();
    }
    for (const Symbol& symbol : kSymbols) {
      if (!absl::StartsWith(text_.substr(at_), symbol.text)) continue;
      token_ = Token::kSymbol;
      symbol_ = symbol.means;
      at_ += symbol.text.size();
      return absl::OkStatus();
    }
    return Wrong(
        "found a character that is none of an expression's; + - * / ^ ( ) , = <= >=, numbers "
        "and names are");
  }

  absl::string_view Name() const { return text_.substr(token_begin_, at_ - token_begin_); }
  bool IsWord(absl::string_view word) const { return token_ == Token::kName && Name() == word; }
  bool IsSymbol(absl::string_view symbol) const {
    return token_ == Token::kSymbol && symbol_ == symbol;
  }

  // Created once for each level of nesting.
  class Level {
   public:
    explicit Level(int& depth) : depth_(depth) { ++depth_; }
    ~Level() { --depth_; }
    Level(const Level&) = delete;
    Level& operator=(const Level&) = delete;

   private:
    int& depth_;
  };
  absl::Status CheckLimits() const {
    if (depth_ > limits_.depth) {
      return absl::ResourceExhaustedError(
          absl::StrCat("nests deeper than ", limits_.depth, " levels"));
    }
    if (graph_.size() > limits_.nodes) {
      return absl::ResourceExhaustedError(
          absl::StrCat("has more than ", limits_.nodes, " operations"));
    }
    return absl::OkStatus();
  }

  // Parses first {word first}, of truths.
  template <typename First>
  MaybeValue Joined(absl::string_view word, First&& first, Node (Graph::*join)(Node, Node)) {
    MaybeValue left = first();
    while (left.ok() && IsWord(word)) {
      if (absl::Status s = Require(*left, Value::Is::kTruth, absl::StrCat("before ", word));
          !s.ok())
        return s;
      if (absl::Status s = Next(); !s.ok()) return s;
      const MaybeValue right = first();
      if (!right.ok()) return right;
      if (absl::Status s = Require(*right, Value::Is::kTruth, absl::StrCat("after ", word));
          !s.ok())
        return s;
      left = Value{(graph_.*join)(left->node, right->node), Value::Is::kTruth};
    }
    return left;
  }
  MaybeValue Condition() {
    return Joined(
        "or", [&] { return Conjunction(); }, &Graph::Min);
  }
  MaybeValue Conjunction() {
    return Joined(
        "and", [&] { return Negation(); }, &Graph::Max);
  }
  MaybeValue Negation() {
    if (!IsWord("not")) return Relation();
    const Level level(depth_);
    if (absl::Status s = CheckLimits(); !s.ok()) return s;
    if (absl::Status s = Next(); !s.ok()) return s;
    MaybeValue value = Negation();
    if (!value.ok()) return value;
    if (absl::Status s = Require(*value, Value::Is::kTruth, "after not"); !s.ok()) return s;
    return Value{graph_.Neg(value->node), Value::Is::kTruth};
  }

  MaybeValue Relation() {
    MaybeValue left = Sum();
    if (!left.ok()) return left;
    Value whole = *left;
    bool first = true;
    while (IsSymbol("<=") || IsSymbol(">=") || IsSymbol("=")) {
      const absl::string_view symbol = symbol_;
      if (!first && (symbol == "=" || whole.is == Value::Is::kEquation)) {
        return Wrong("found a second relation beside an =; one = by itself would be right");
      }
      if (absl::Status s = Require(*left, Value::Is::kNumber, "before a relation"); !s.ok())
        return s;
      if (absl::Status s = Next(); !s.ok()) return s;
      const MaybeValue right = Sum();
      if (!right.ok()) return right;
      if (absl::Status s = Require(*right, Value::Is::kNumber, "after a relation"); !s.ok())
        return s;
      const Node difference = symbol == ">=" ? graph_.Sub(right->node, left->node)
                                             : graph_.Sub(left->node, right->node);
      if (symbol == "=") {
        whole = {difference, Value::Is::kEquation};
      } else {
        whole = {first ? difference : graph_.Max(whole.node, difference), Value::Is::kTruth};
      }
      first = false;
      left = right;
    }
    return whole;
  }

  // Parses first {symbol first}, of numbers.
  template <typename First, typename Join>
  MaybeValue Chain(absl::string_view one, absl::string_view other, First&& first, Join&& join) {
    MaybeValue left = first();
    while (left.ok() && (IsSymbol(one) || IsSymbol(other))) {
      const absl::string_view symbol = symbol_;
      const std::string where = absl::StrCat("before ", symbol);
      if (absl::Status s = Require(*left, Value::Is::kNumber, where); !s.ok()) return s;
      if (absl::Status s = Next(); !s.ok()) return s;
      const MaybeValue right = first();
      if (!right.ok()) return right;
      if (absl::Status s = Require(*right, Value::Is::kNumber, absl::StrCat("after ", symbol));
          !s.ok())
        return s;
      left = Value{join(symbol == one, left->node, right->node), Value::Is::kNumber};
      if (absl::Status s = CheckLimits(); !s.ok()) return s;
    }
    return left;
  }
  MaybeValue Sum() {
    return Chain(
        "+", "-", [&] { return Product(); },
        [&](bool plus, Node a, Node b) { return plus ? graph_.Add(a, b) : graph_.Sub(a, b); });
  }
  MaybeValue Product() {
    return Chain(
        "*", "/", [&] { return Signed(); },
        [&](bool times, Node a, Node b) { return times ? graph_.Mul(a, b) : graph_.Div(a, b); });
  }
  MaybeValue Signed() {
    if (!IsSymbol("-") && !IsSymbol("+")) return Power();
    const bool negative = IsSymbol("-");
    const Level level(depth_);
    if (absl::Status s = CheckLimits(); !s.ok()) return s;
    if (absl::Status s = Next(); !s.ok()) return s;
    MaybeValue value = Signed();
    if (!value.ok()) return value;
    if (absl::Status s = Require(*value, Value::Is::kNumber, "after a sign"); !s.ok()) return s;
    return negative ? Value{graph_.Neg(value->node), Value::Is::kNumber} : *value;
  }
  MaybeValue Power() {
    MaybeValue base = Atom();
    if (!base.ok() || !IsSymbol("^")) return base;
    if (absl::Status s = Require(*base, Value::Is::kNumber, "before ^"); !s.ok()) return s;
    const Level level(depth_);
    if (absl::Status s = CheckLimits(); !s.ok()) return s;
    if (absl::Status s = Next(); !s.ok()) return s;
    const MaybeValue exponent = Signed();
    if (!exponent.ok()) return exponent;
    if (absl::Status s = Require(*exponent, Value::Is::kNumber, "after ^"); !s.ok()) return s;
    return Value{graph_.Pow(base->node, exponent->node), Value::Is::kNumber};
  }

  MaybeValue Atom() {
    if (absl::Status s = CheckLimits(); !s.ok()) return s;
    if (token_ == Token::kNumber) {
      const Value value{graph_.Constant(number_), Value::Is::kNumber};
      if (absl::Status s = Next(); !s.ok()) return s;
      return value;
    }
    if (token_ == Token::kName) return Named();
    if (!IsSymbol("(")) {
      return Wrong(absl::StrCat("found ", Found(), " where a number, a name or ( would be right"));
    }
    const Level level(depth_);
    if (absl::Status s = CheckLimits(); !s.ok()) return s;
    if (absl::Status s = Next(); !s.ok()) return s;
    MaybeValue value = Condition();
    if (!value.ok()) return value;
    if (!IsSymbol(")")) return Wrong(absl::StrCat("found ", Found(), " where ) would be right"));
    if (absl::Status s = Next(); !s.ok()) return s;
    return value;
  }

  MaybeValue Named() {
    const absl::string_view name = Name();
    const size_t begin = token_begin_;
    if (absl::Status s = Next(); !s.ok()) return s;
    if (IsSymbol("(")) {
      for (const Function& function : kFunctions) {
        if (function.name == name) return Call(function);
      }
      token_begin_ = begin;
      return Wrong(
          absl::StrCat("there is no function '", Shown(name), "'; there are ",
                       absl::StrJoin(kFunctions, ", ", [](std::string* out, const Function& f) {
                         absl::StrAppend(out, f.name);
                       })));
    }
    const auto number = [](Node node) { return Value{node, Value::Is::kNumber}; };
    // A caller's parameter takes precedence over a constant of the same name.
    if (name.size() == 1 && name[0] >= 'x' && name[0] <= 'z')
      return number(graph_.Axis(name[0] - 'x'));
    if (const auto it = parameters_.find(std::string(name)); it != parameters_.end()) {
      return number(graph_.Constant(it->second));
    }
    if (name == "pi") return number(graph_.Constant(3.14159265358979324));
    if (name == "tau") return number(graph_.Constant(6.28318530717958648));
    if (name == "e") return number(graph_.Constant(2.71828182845904524));
    if (name == "voxel") return number(graph_.Voxel());
    token_begin_ = begin;
    std::string known = "x, y, z, pi, tau, e, voxel";
    constexpr int kMostNamed = 16;
    int named = 0;
    for (const auto& [parameter, value] : parameters_) {
      if (++named <= kMostNamed) absl::StrAppend(&known, ", ", Shown(parameter));
    }
    if (named > kMostNamed) absl::StrAppend(&known, " and ", named - kMostNamed, " more");
    return Wrong(absl::StrCat("there is no '", Shown(name), "'; there are ", known,
                              ", and functions with ("));
  }

  MaybeValue Call(const Function& function) {
    const Level level(depth_);
    if (absl::Status s = CheckLimits(); !s.ok()) return s;
    std::vector<Node> arguments;
    size_t conditions = 0;
    do {
      if (absl::Status s = Next(); !s.ok()) return s;
      const MaybeValue argument = Condition();
      if (!argument.ok()) return argument;
      // Unions and the like also combine conditions.
      conditions += argument->is == Value::Is::kTruth;
      if (argument->is == Value::Is::kEquation)
        return Require(*argument, Value::Is::kNumber, "within ( )");
      arguments.push_back(argument->node);
    } while (IsSymbol(","));
    if (!IsSymbol(")"))
      return Wrong(absl::StrCat("found ", Found(), " where , or ) would be right"));
    const int count = static_cast<int>(arguments.size());
    if (count < function.least || count > function.most) {
      return Wrong(absl::StrCat(function.name, " has ", count, " arguments; ",
                                function.most == kAny ? absl::StrCat(function.least, " to ", kAny)
                                                      : absl::StrCat(function.least),
                                " would be right"));
    }
    if (absl::Status s = Next(); !s.ok()) return s;
    return Value{function.make(graph_, arguments),
                 conditions == arguments.size() ? Value::Is::kTruth : Value::Is::kNumber};
  }

  absl::string_view text_;
  const Parameters& parameters_;
  const ParseLimits& limits_;
  Graph& graph_;
  size_t at_ = 0;  // after the token
  size_t token_begin_ = 0;
  Token token_ = Token::kEnd;
  double number_ = 0;
  absl::string_view symbol_;
  int depth_ = 0;
};

}  // namespace

absl::StatusOr<ParsedShape> ParseShape(absl::string_view text, const Parameters& parameters,
                                       const ParseLimits& limits, Graph& graph) {
  return Parser(text, parameters, limits, graph).Shape();
}
absl::StatusOr<Node> ParseCondition(absl::string_view text, const Parameters& parameters,
                                    const ParseLimits& limits, Graph& graph) {
  return Parser(text, parameters, limits, graph).Whole(Value::Is::kTruth);
}
absl::StatusOr<Node> ParseValue(absl::string_view text, const Parameters& parameters,
                                const ParseLimits& limits, Graph& graph) {
  return Parser(text, parameters, limits, graph).Whole(Value::Is::kNumber);
}

}  // namespace voxeld::gpu::implicit
