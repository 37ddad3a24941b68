// "Did you mean …?"
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace voxeld::daemon {

// The one of `known` that `wrong` is most like, if it is like any (at most a third of it, and at
// least one character, added, left out, changed or exchanged with its neighbour); else empty.
std::string Nearest(std::string_view wrong, const std::vector<std::string>& known);

// "; did you mean X?", or "; known are …" if nothing is near.
std::string Suggestion(std::string_view wrong, const std::vector<std::string>& known);

}  // namespace voxeld::daemon
