#include "tools/ros/options.h"

#include <CLI/App.hpp>
#include <CLI/Config.hpp>
#include <CLI/Formatter.hpp>
#include <algorithm>

#include "absl/strings/str_cat.h"
#include "common/text/printable.h"
#include "daemon/usage/usage_error.h"
#include "tools/voxelctl/cli/server_options.h"

namespace voxeld::ros1 {
namespace {

constexpr const char* kAbout =
    "Shows what ROS 1's programs send to their viewers (visualization_msgs/MarkerArray and "
    "Marker), "
    "until Ctrl-C.\n"
    "Data goes to standard output, words to standard error; --json makes the data JSON.";

std::string ChooseMaster(const RosOptions& given, const client::Environment& environment) {
  if (!given.master.empty()) return given.master;
  if (const auto at = given.remappings.find("__master"); at != given.remappings.end()) {
    return at->second;
  }
  std::string master = environment("ROS_MASTER_URI");
  return master.empty() ? "http://localhost:11311" : master;
}

ParsedCommandLine Usage(const std::string& what) {
  ParsedCommandLine result;
  result.exit_code = kExitUsage;
  result.err = absl::StrCat("voxeld-ros: ", EscapeForTerminal(what),
                            "\nvoxeld-ros --help says what there is\n");
  return result;
}

}  // namespace

ParsedCommandLine ParseCommandLine(const std::vector<std::string>& arguments,
                                   const client::Environment& environment) {
  Options options;
  CLI::App app(kAbout, "voxeld-ros");
  app.set_version_flag("--version", absl::StrCat("voxeld-ros ", VOXELD_VERSION),
                       "Print the version and end");
  app.option_defaults()->multi_option_policy(CLI::MultiOptionPolicy::TakeLast);
  voxelctl::AddServerOptions(app, &options.server, &options.credentials);
  app.add_flag("--json", options.json, "Write data as JSON, a line each");
  app.add_option("--topic", options.ros.topics,
                 "Only this one; may be given again. Else all of the two types that are published")
      ->type_name("NAME")
      ->expected(1)
      ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
  app.add_option("--layer", options.layer, "The layer that they are put into")
      ->type_name("NAME")
      ->capture_default_str();
  app.add_option("--master", options.ros.master,
                 "The ROS master (default: ROS_MASTER_URI, else http://localhost:11311)")
      ->type_name("URI");
  std::vector<std::string> words;  // CLI11 takes them from the back
  for (const std::string& word : arguments) {
    if (const size_t at = word.find(":="); at != std::string::npos) {
      options.ros.remappings[word.substr(0, at)] = word.substr(at + 2);
    } else {
      words.push_back(word);
    }
  }
  std::reverse(words.begin(), words.end());
  ParsedCommandLine result;
  try {
    app.parse(std::move(words));
  } catch (const CLI::CallForHelp&) {
    result.out = app.help();
    return result;
  } catch (const CLI::CallForVersion& version) {
    result.out = absl::StrCat(version.what(), "\n");
    return result;
  } catch (const CLI::Error& error) {
    return Usage(usage::ExplainError(error, {&app}));
  }
  if (options.layer.empty()) return Usage("--layer wants a name");
  if (std::count(options.ros.topics.begin(), options.ros.topics.end(), "") > 0) {
    return Usage("--topic wants a name");
  }
  options.ros.master = ChooseMaster(options.ros, environment);
  result.options = std::move(options);
  return result;
}

}  // namespace voxeld::ros1
