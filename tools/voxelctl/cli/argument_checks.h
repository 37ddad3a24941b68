// Checks of command-line arguments. Within this folder, errors are thrown.
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

// Makes CLI11 refuse, before the conversion, a text that is not a number from `least` to `most`.
void WantNumber(CLI::Option* option, double least, double most);

// Adds a number with its range; its current value is the default.
void AddNumber(CLI::App* command, const char* name, double* value, double least, double most,
               const char* about, const char* unit);

// Adds --layer and --owner; the number of an owner is checked.
void AddFilter(CLI::App* command, std::string* layer, uint64_t* owner);

// Refuses a name whose extension promises a format other than PNG.
void CheckPictureName(const std::string& file);

}  // namespace voxeld::voxelctl
