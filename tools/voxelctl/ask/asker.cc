#include "tools/voxelctl/ask/asker.h"

#include <algorithm>
#include <cstdint>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "common/text/printable.h"

namespace voxeld::voxelctl {

std::string Asker::Ask(const std::string& question, const std::string& fallback,
                       const Understand& understand) {
  // The default is shown after the question's first line.
  std::string shown = question;
  if (!fallback.empty()) {
    shown.insert(std::min(shown.find('\n'), shown.size()), absl::StrCat(" [", fallback, "]"));
  }
  while (!ended_) {
    console_.Say(shown);
    std::string line;
    if (!std::getline(in_, line)) {
      ended_ = true;
      break;
    }
    std::string answer(absl::StripAsciiWhitespace(line));
    if (answer.empty()) answer = fallback;
    absl::StatusOr<std::string> understood = understand(answer);
    if (understood.ok()) return *std::move(understood);
    console_.Say(absl::StrCat("  ", EscapeForTerminal(answer),
                              " will not do: ", understood.status().message()));
  }
  return "";
}

std::string Asker::Choose(const std::string& question, const std::vector<Choice>& choices) {
  std::string all = question;
  for (const Choice& choice : choices)
    absl::StrAppend(&all, "\n  ", choice.word, choice.about.empty() ? "" : ": ", choice.about);
  return Ask(
      all, choices.front().word, [&](const std::string& answer) -> absl::StatusOr<std::string> {
        std::vector<std::string> meant;
        for (const Choice& choice : choices) {
          if (absl::EqualsIgnoreCase(choice.word, answer)) return choice.word;
          if (absl::StartsWithIgnoreCase(choice.word, answer)) meant.push_back(choice.word);
        }
        if (meant.size() == 1) return meant.front();
        std::vector<std::string> words;
        words.reserve(choices.size());
        for (const Choice& choice : choices) words.push_back(choice.word);
        return absl::InvalidArgumentError(absl::StrCat("one of ", absl::StrJoin(words, ", ")));
      });
}

std::string Asker::Number(const std::string& question, const std::string& fallback, double least,
                          double most, bool whole) {
  return Ask(question, fallback, [&](const std::string& answer) -> absl::StatusOr<std::string> {
    double value = 0;
    if (absl::SimpleAtod(answer, &value) && value >= least && value <= most &&
        (!whole || value == static_cast<double>(static_cast<int64_t>(value)))) {
      return answer;
    }
    return absl::InvalidArgumentError(
        absl::StrCat("a ", whole ? "whole " : "", "number from ", least, " to ", most));
  });
}

}  // namespace voxeld::voxelctl
