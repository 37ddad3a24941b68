// Displays described in files: a display's options except its name, as TOML.
#pragma once

#include <functional>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/statusor.h"

namespace voxeld::display {

struct Profile {
  std::string title;   // what it describes, for people to read
  std::string driver;  // empty: any driver that accepts the options
  std::map<std::string, std::string> options;
};

// Errors: InvalidArgument with place, value and what is expected; NotFound if the file does not
// exist.
absl::StatusOr<Profile> ReadProfile(const std::string& path);

// The same for text; messages use `name` in place of the path.
absl::StatusOr<Profile> ParseProfile(std::string_view text, const std::string& name);

// Returns the folders where profiles are searched by name, in order: $VOXELD_PROFILES,
// ../share/voxeld/profiles from the program's folder, then /usr/share/voxeld/profiles.
// `environment` returns a variable's value, empty if it is not set.
std::vector<std::string> ProfilePlaces(const std::function<std::string(const char*)>& environment,
                                       const std::string& program_folder);
// The same for this process.
std::vector<std::string> ProfilePlaces();

// Returns the names of the profiles in a folder, ascending; none if it cannot be read.
std::vector<std::string> ProfilesIn(const std::string& place);

// Returns `name` unchanged as a path if it has a '/' or ends in .toml; else NAME.toml in the first
// of those places that has it. Errors: NotFound names the places, and the existing names.
absl::StatusOr<std::string> FindProfile(const std::string& name,
                                        const std::vector<std::string>& places);
// Loads a profile from this process's places.
absl::StatusOr<Profile> LoadProfile(const std::string& name);

}  // namespace voxeld::display
