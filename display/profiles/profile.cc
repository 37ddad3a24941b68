#include "display/profiles/profile.h"

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <set>
#include <sstream>
#include <string_view>
#include <system_error>
#include <utility>

#include "absl/status/status.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "common/text/printable.h"
#include "common/toml/parse_toml.h"
#include "display/profiles/toml_options.h"

namespace voxeld::display {
namespace {

constexpr const char* kEnding = ".toml";

absl::StatusOr<Profile> ProfileOf(const std::string& path, std::string_view text) {
  const absl::StatusOr<toml::table> parsed = ParseToml(text, path);
  if (!parsed.ok()) return parsed.status();
  Profile profile;
  for (const auto& [key, node] : *parsed) {
    const std::string name(key.str());
    const std::optional<std::string> value = OptionText(node);
    if (!value.has_value() || name == "name" || name == "profile") {
      return absl::InvalidArgumentError(absl::StrCat(
          path, ":", node.source().begin.line, ":", node.source().begin.column, ": ",
          EscapeControls(name),
          value.has_value() ? " has no place in a profile: it is given where the display is"
                            : " is no text, number, boolean, or array of these"));
    }
    if (name == "title") {
      profile.title = *value;
    } else if (name == "driver") {
      profile.driver = *value;
    } else {
      profile.options.emplace(name, *value);
    }
  }
  return profile;
}

}  // namespace

absl::StatusOr<Profile> ReadProfile(const std::string& path) {
  std::error_code error;
  if (!std::filesystem::is_regular_file(path, error)) {
    return absl::NotFoundError(absl::StrCat("there is no file ", path));
  }
  std::ifstream file(path, std::ios::binary);
  std::ostringstream text;
  if (file.peek() != std::ifstream::traits_type::eof()) text << file.rdbuf();
  if (!file || !text) return absl::UnavailableError(absl::StrCat(path, " cannot be read"));
  return ProfileOf(path, text.str());
}

absl::StatusOr<Profile> ParseProfile(std::string_view text, const std::string& name) {
  return ProfileOf(name, text);
}

std::vector<std::string> ProfilePlaces(const std::function<std::string(const char*)>& environment,
                                       const std::string& program_folder) {
  std::vector<std::string> places;
  if (std::string named = environment("VOXELD_PROFILES"); !named.empty()) places.push_back(named);
  if (!program_folder.empty()) {
    places.push_back(program_folder + "/../share/voxeld/profiles");
    // The source tree's profiles, if the program is in build/PRESET/bin.
    const std::filesystem::path source =
        std::filesystem::path(program_folder).parent_path().parent_path().parent_path() /
        "display/profiles";
    std::error_code error;
    if (std::filesystem::exists(program_folder + "/../CMakeCache.txt", error)) {
      places.push_back(source.string());
    }
  }
  places.emplace_back("/usr/share/voxeld/profiles");
  return places;
}

std::vector<std::string> ProfilePlaces() {
  const auto environment = [](const char* variable) -> std::string {
    const char* const value = std::getenv(variable);
    return value != nullptr ? value : "";
  };
  std::error_code error;
  return ProfilePlaces(
      environment, std::filesystem::read_symlink("/proc/self/exe", error).parent_path().string());
}

std::vector<std::string> ProfilesIn(const std::string& place) {
  std::vector<std::string> names;
  std::error_code error;
  std::filesystem::directory_iterator entry(place, error);
  for (const std::filesystem::directory_iterator end; !error && entry != end;
       entry.increment(error)) {
    if (entry->path().extension() == kEnding) names.push_back(entry->path().stem().string());
  }
  std::sort(names.begin(), names.end());
  return names;
}

absl::StatusOr<std::string> FindProfile(const std::string& name,
                                        const std::vector<std::string>& places) {
  if (absl::StrContains(name, "/") || absl::EndsWith(name, kEnding)) return name;
  std::set<std::string> known;
  for (const std::string& place : places) {
    std::error_code error;
    const std::filesystem::path path = std::filesystem::path(place) / (name + kEnding);
    if (std::filesystem::is_regular_file(path, error)) return path.string();
    for (std::string& one : ProfilesIn(place)) known.insert(std::move(one));
  }
  std::error_code error;
  if (std::filesystem::exists(name, error)) {
    return absl::NotFoundError(
        absl::StrCat("no profile is named \"", name, "\"; to read the file, write ./", name));
  }
  return absl::NotFoundError(
      absl::StrCat("there is no profile \"", name, "\" in ", absl::StrJoin(places, ", "),
                   known.empty() ? "; give a path, as ./rotor.toml"
                                 : absl::StrCat("; there are ", absl::StrJoin(known, ", "),
                                                ", or give a path, as ./rotor.toml")));
}

absl::StatusOr<Profile> LoadProfile(const std::string& name) {
  const absl::StatusOr<std::string> path = FindProfile(name, ProfilePlaces());
  if (!path.ok()) return path.status();
  return ReadProfile(*path);
}

}  // namespace voxeld::display
