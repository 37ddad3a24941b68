// Questions to a person: on the console, and answers a line each.
#pragma once

#include <functional>
#include <istream>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "tools/voxelctl/commands/console.h"

namespace voxeld::voxelctl {

// What an answer comes to, or what would be right.
using Understand = std::function<absl::StatusOr<std::string>(const std::string& answer)>;

struct Choice {
  std::string word;   // what is typed, or its beginning
  std::string about;  // what it means
};

// What an answer cannot be is said, and asked again.
class Asker {
 public:
  Asker(std::istream& in, Console& console) : in_(in), console_(console) {}

  // The answers have ended: what comes back from here on means nothing.
  bool ended() const { return ended_; }

  // An empty answer is `fallback`.
  std::string Ask(const std::string& question, const std::string& fallback,
                  const Understand& understand);
  // One of `choices`, by a beginning that no other has; its word. The first is the fallback.
  std::string Choose(const std::string& question, const std::vector<Choice>& choices);
  std::string Number(const std::string& question, const std::string& fallback, double least,
                     double most, bool whole);

 private:
  std::istream& in_;
  Console& console_;
  bool ended_ = false;
};

}  // namespace voxeld::voxelctl
