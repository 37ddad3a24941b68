// Arguments of the commands that set lights by number, and their checks. Within this folder, errors
// are thrown (UsageError).
#pragma once

#include <string>

#include "tools/voxelctl/cli/options.h"

namespace CLI {
class App;
}  // namespace CLI

namespace voxeld::voxelctl {

// References passed in live as long as the app.
class LightArguments {
 public:
  void Add(CLI::App* command);
  LightsOptions Read() const;

 private:
  LightsOptions options_;
  std::string size_;
};

class InputArguments {
 public:
  void Add(CLI::App* command);
  InputOptions Read() const;

 private:
  LightArguments lights_;
  InputOptions options_;
  std::string protocol_;
  double universe_ = -1, universe_channels_ = 0, a_channel_ = 0;
};

class PipeArguments {
 public:
  void Add(CLI::App* command);
  PipeOptions Read() const;

 private:
  LightArguments lights_;
  PipeOptions options_;
};

}  // namespace voxeld::voxelctl
