// What a program says of a command line that is wrong.
#pragma once

#include <string>
#include <vector>

namespace CLI {
class App;
class Error;
}  // namespace CLI

namespace voxeld::usage {

// "--wacth is no option here; did you mean --watch?". `word` is what was given, with its value if there is one behind a "=";
// the options of `apps` are known.
std::string UnknownOption(const std::string& word, const std::vector<const CLI::App*>& apps);

// Of CLI11's errors, with what would be right: a value that is missing, or given where none is taken, a word too many. `apps`
// as above, the one whose arguments are meant first. Not fit for a terminal where what was given is not.
std::string ExplainError(const CLI::Error& error, const std::vector<const CLI::App*>& apps);

}  // namespace voxeld::usage
