// The arguments of play and their checks. Within this folder, errors are thrown (UsageError).
#pragma once

#include <cmath>
#include <string>
#include <vector>

#include "tools/voxelctl/cli/options.h"

namespace CLI {
class App;
class Option;
}  // namespace CLI

namespace voxeld::voxelctl {

class PlayArguments {
 public:
  // The app must not outlive this object.
  void Add(CLI::App* command);
  // `plain` are the files after "--".
  PlayOptions Read(const std::vector<std::string>& plain);

 private:
  void ReadVolume();
  void ReadAnimation();

  PlayOptions options_;
  std::string up_ = "auto", fill_ = "surface", style_ = "balls", other_files_ = "below";
  std::string size_, type_, range_, window_;
  std::vector<std::string> animate_;  // nothing, a number, or what is really a file
  CLI::Option* animate_option_ = nullptr;
  CLI::App* command_ = nullptr;
  bool big_endian_ = false;
  double duration_ = std::nan(""), level_ = std::nan("");
};

}  // namespace voxeld::voxelctl
