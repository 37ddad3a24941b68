// Suggests known words for a misspelt one: "Did you mean …?"
#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

namespace voxeld {

// Returns: the number of single characters to insert, delete, replace, or swap with their
// neighbour, to turn one text into the other. Ignores case.
size_t EditDistance(std::string_view a, std::string_view b);

// Returns: the word of `known` that is most similar to `wrong`, or of which `wrong` is the
// beginning, if it is similar enough; else an empty string.
std::string Nearest(std::string_view wrong, const std::vector<std::string>& known);

// Returns: "; did you mean X?", or "; known are …" if nothing is similar.
std::string Suggestion(std::string_view wrong, const std::vector<std::string>& known);

}  // namespace voxeld
