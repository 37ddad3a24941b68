// Error messages for an invalid command line.
#pragma once

#include <string>
#include <vector>

namespace CLI {
class App;
class Error;
}  // namespace CLI

namespace voxeld::usage {

// Returns: a message such as "--wacth is no option here; did you mean --watch?". `word` is the
// given option, with "=" and its value if present. The options of `apps` are the known ones.
std::string UnknownOption(const std::string& word, const std::vector<const CLI::App*>& apps);

// Returns: CLI11's error with the remedy: a missing value, an unexpected value or a superfluous
// word. `apps` is as above; the arguments of the first one are meant. Escape the text before
// printing it to a terminal, because it repeats input.
std::string ExplainError(const CLI::Error& error, const std::vector<const CLI::App*>& apps);

}  // namespace voxeld::usage
