#include "voxeld/expression.h"

namespace voxeld::client::expressions {

Term::Term(Op op, std::initializer_list<Term> operands) {
  for (const Term& operand : operands) {
    ops_.insert(ops_.end(), operand.ops_.begin(), operand.ops_.end());
    values_.insert(values_.end(), operand.values_.begin(), operand.values_.end());
    names_.insert(names_.end(), operand.names_.begin(), operand.names_.end());
  }
  ops_.push_back(op);
}

Term Term::Parameter(std::string name) {
  Term term(Op::kParameter);
  term.names_.push_back(std::move(name));
  return term;
}

}  // namespace voxeld::client::expressions
