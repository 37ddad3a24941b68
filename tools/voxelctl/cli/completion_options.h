// Commands about the program itself: shell completion and the manual.
#pragma once

#include <string>

#include "tools/voxelctl/cli/options.h"

namespace CLI {
class App;
}  // namespace CLI

namespace voxeld::voxelctl {

// References passed in live as long as the app.
class CompletionArguments {
 public:
  // Adds `completion`, which is for people, and two hidden commands: `__complete KIND [BEGINNING]`,
  // which scripts call, and `__manual DIR`, which the build calls.
  void Add(CLI::App* completion, CLI::App* complete, CLI::App* manual);

  // Returns the script that `completion` prints. Throws UsageError for wrong arguments.
  std::string Script(const CLI::App& app) const;
  CompleteOptions ReadComplete() const { return complete_; }
  // Returns the pages of the program and of each command, by their file names.
  ManualOptions ReadManual(const CLI::App& app) const;

 private:
  std::string shell_;
  CompleteOptions complete_;
  ManualOptions manual_;
};

}  // namespace voxeld::voxelctl
