// Commands that are about the program itself: how shells complete it, and its manual.
#pragma once

#include <string>

#include "tools/voxelctl/cli/options.h"

namespace CLI {
class App;
}  // namespace CLI

namespace voxeld::voxelctl {

// What is given lives as long as the app.
class CompletionArguments {
 public:
  // `completion`, which is for people; two that are hidden: `__complete KIND [BEGINNING]`, which scripts call, and `__manual DIR`, which
  // the build calls.
  void Add(CLI::App* completion, CLI::App* complete, CLI::App* manual);

  // The script that `completion` prints. Wrong arguments are thrown (UsageError).
  std::string Script(const CLI::App& app) const;
  CompleteOptions ReadComplete() const { return complete_; }
  // Pages of the program and of each command, by their files' names.
  ManualOptions ReadManual(const CLI::App& app) const;

 private:
  std::string shell_;
  CompleteOptions complete_;
  ManualOptions manual_;
};

}  // namespace voxeld::voxelctl
