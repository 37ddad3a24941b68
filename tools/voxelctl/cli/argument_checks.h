// What arguments of the command line may be. Within this folder wrong ones are thrown.
#pragma once

#include <CLI/CLI.hpp>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "common/text/printable.h"
#include "common/text/suggest.h"

namespace voxeld::voxelctl {

struct UsageError {
  std::string message;
};

template <typename T>
using Choices = std::vector<std::pair<std::string, T>>;

template <typename T>
T Choose(const char* option, const std::string& value, const Choices<T>& choices) {
  std::vector<std::string> names;
  for (const auto& [name, result] : choices) {
    if (name == value) return result;
    names.push_back(name);
  }
  throw UsageError{absl::StrCat(option, " ", EscapeForTerminal(value), " is not known",
                                Suggestion(value, names))};
}

void CheckRange(const char* option, double value, double least, double most);

// Has CLI11 refuse, before it converts, a text that is no number from `least` to `most`.
void WantNumber(CLI::Option* option, double least, double most);

// A number and its range; what it holds now is the default.
void AddNumber(CLI::App* command, const char* name, double* value, double least, double most,
               const char* about, const char* unit);

// --layer and --owner; the number of an owner is checked.
void AddFilter(CLI::App* command, std::string* layer, uint64_t* owner);

// A name that promises another format than PNG would be a lie.
void CheckPictureName(const std::string& file);

}  // namespace voxeld::voxelctl
