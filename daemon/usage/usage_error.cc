#include "daemon/usage/usage_error.h"

#include <CLI/App.hpp>
#include <CLI/Config.hpp>
#include <CLI/Formatter.hpp>
#include <algorithm>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/string_view.h"
#include "absl/strings/strip.h"
#include "common/text/suggest.h"

namespace voxeld::usage {
namespace {

const CLI::Option* Find(absl::string_view name, const std::vector<const CLI::App*>& apps) {
  for (const CLI::App* app : apps) {
    for (const CLI::Option* option : app->get_options()) {
      if (option->check_name(std::string(name))) return option;
    }
  }
  return nullptr;
}

// Handles CLI11's "NAME: 1 required TYPE missing".
std::string MissingValue(absl::string_view what, const std::vector<const CLI::App*>& apps) {
  const size_t colon = what.find(": ");
  if (colon == absl::string_view::npos) return std::string(what);
  const CLI::Option* option = Find(what.substr(0, colon), apps);
  if (option == nullptr) return std::string(what);
  std::string about = option->get_description();
  about.resize(std::min(about.find('\n'), about.size()));
  return absl::StrCat(what.substr(0, colon), " wants a value, ", option->get_type_name(),
                      about.empty() ? "" : ": ", about);
}

// Handles CLI11's "Could not convert: --NAME = VALUE" for flags.
std::string WrongValue(absl::string_view what, const std::vector<const CLI::App*>& apps) {
  absl::string_view rest = what;
  const size_t equals = what.find(" = ");
  if (!absl::ConsumePrefix(&rest, "Could not convert: ") || equals == absl::string_view::npos) {
    return std::string(what);
  }
  const absl::string_view name = rest.substr(0, rest.find(" = "));
  const CLI::Option* option = Find(name, apps);
  if (option == nullptr) return std::string(what);
  const absl::string_view value = what.substr(equals + 3);
  if (option->get_items_expected_max() == 0) {
    return absl::StrCat(name, " is ", value, "; it takes no value");
  }
  return absl::StrCat(name, " is ", value, "; ", option->get_type_name(), " is expected");
}

}  // namespace

std::string UnknownOption(const std::string& word, const std::vector<const CLI::App*>& apps) {
  std::vector<std::string> known;
  for (const CLI::App* app : apps) {
    for (const CLI::Option* option : app->get_options()) {
      if (option->get_group().empty()) continue;
      for (const std::string& name : option->get_lnames())
        known.push_back(absl::StrCat("--", name));
    }
  }
  std::sort(known.begin(), known.end());
  known.erase(std::unique(known.begin(), known.end()), known.end());
  const std::string name = word.substr(0, word.find('='));
  return absl::StrCat(name, " is no option here", Suggestion(name, known));
}

std::string ExplainError(const CLI::Error& error, const std::vector<const CLI::App*>& apps) {
  const std::string what = error.what();
  if (dynamic_cast<const CLI::ExtrasError*>(&error) != nullptr &&
      !apps.front()->remaining().empty()) {
    const std::string extra = apps.front()->remaining(true).front();
    if (absl::StartsWith(extra, "-")) return UnknownOption(extra, apps);
    return absl::StrCat("\"", extra, "\" is one argument too many");
  }
  if (dynamic_cast<const CLI::ArgumentMismatch*>(&error) != nullptr)
    return MissingValue(what, apps);
  if (dynamic_cast<const CLI::ConversionError*>(&error) != nullptr) return WrongValue(what, apps);
  return what;
}

}  // namespace voxeld::usage
