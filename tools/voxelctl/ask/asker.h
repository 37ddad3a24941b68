// Asks a person questions on the console; each answer is one line.
#pragma once

#include <functional>
#include <istream>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "tools/voxelctl/commands/console.h"

namespace voxeld::voxelctl {

// Converts an answer to a value, or returns an error that says what would be valid.
using Understand = std::function<absl::StatusOr<std::string>(const std::string& answer)>;

struct Choice {
  std::string word;   // what is typed, or its prefix
  std::string about;  // what it means
};

// Reports an invalid answer and asks again.
class Asker {
 public:
  Asker(std::istream& in, Console& console) : in_(in), console_(console) {}

  // Returns whether the input has ended; results after that are meaningless.
  bool ended() const { return ended_; }

  // Asks a question. An empty answer means `fallback`.
  std::string Ask(const std::string& question, const std::string& fallback,
                  const Understand& understand);
  // Asks for one of `choices`, by an unambiguous prefix. Returns its word. The first choice is the
  // fallback.
  std::string Choose(const std::string& question, const std::vector<Choice>& choices);
  std::string Number(const std::string& question, const std::string& fallback, double least,
                     double most, bool whole);

 private:
  std::istream& in_;
  Console& console_;
  bool ended_ = false;
};

}  // namespace voxeld::voxelctl
