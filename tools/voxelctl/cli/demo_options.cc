#include "tools/voxelctl/cli/demo_options.h"

#include <CLI/App.hpp>
#include <CLI/Config.hpp>
#include <CLI/Formatter.hpp>

#include "absl/algorithm/container.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "tools/voxelctl/cli/argument_checks.h"
#include "tools/voxelctl/demo/scene_names.h"

namespace voxeld::voxelctl {

void AddDemoOptions(CLI::App* command, DemoOptions* options) {
  command->add_option("SCENE", options->scenes, "Only these (default: all)")
      ->type_name(absl::StrJoin(kSceneNames, "|"))
      ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
  command->add_flag("--list", options->list,
                    "Say what there is, and what is missing on this machine; needs no daemon");
  AddNumber(command, "--seconds", &options->seconds, 0.1, 86400,
            "How long each is up, 0.1 to 86400", "N");
  command->add_flag("--once", options->once, "End after the last one, instead of at Ctrl-C");
  command
      ->add_option("--display", options->display,
                   "Fill this display's volume (default: fit into all)")
      ->type_name("NAME");
  command->add_option("--data", options->data, "Look for the scenes' files here first")
      ->type_name("DIR");
}

DemoOptions ReadDemoOptions(DemoOptions options, const std::vector<std::string>& plain) {
  options.scenes.insert(options.scenes.end(), plain.begin(), plain.end());
  const std::vector<std::string> names(kSceneNames.begin(), kSceneNames.end());
  for (const std::string& scene : options.scenes) {
    if (absl::c_linear_search(names, scene)) continue;
    throw UsageError{absl::StrCat("there is no scene \"", EscapeForTerminal(scene), "\"",
                                  Suggestion(scene, names), "; there are ",
                                  absl::StrJoin(names, ", "))};
  }
  return options;
}

}  // namespace voxeld::voxelctl
