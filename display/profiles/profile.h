// Displays described in files of their own: the options of a display but for its name, as TOML.
#pragma once

#include <functional>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/statusor.h"

namespace voxeld::display {

struct Profile {
  std::string title;   // what it describes, for people
  std::string driver;  // empty: any that takes the options
  std::map<std::string, std::string> options;
};

// InvalidArgument with place, value and what would be right; NotFound: there is no such file.
absl::StatusOr<Profile> ReadProfile(const std::string& path);

// The same for text; `name` stands for the path in messages.
absl::StatusOr<Profile> ParseProfile(std::string_view text, const std::string& name);

// Where profiles are looked for by name, in order: $VOXELD_PROFILES, ../share/voxeld/profiles from
// the program's folder, then /usr/share/voxeld/profiles. `environment`: a variable's value; empty
// if it is not set.
std::vector<std::string> ProfilePlaces(const std::function<std::string(const char*)>& environment,
                                       const std::string& program_folder);
// Of this process.
std::vector<std::string> ProfilePlaces();

// The names of the profiles in a folder, ascending; none if it cannot be read.
std::vector<std::string> ProfilesIn(const std::string& place);

// A path as it is, if it has a '/' or ends in .toml; else NAME.toml in the first of those places
// that has it. NotFound names the places, and the names that there are.
absl::StatusOr<std::string> FindProfile(const std::string& name,
                                        const std::vector<std::string>& places);
// In this process's places.
absl::StatusOr<Profile> LoadProfile(const std::string& name);

}  // namespace voxeld::display
