// Arguments of the commands that make pictures and files of what a display shows, and their checks.
// Within this folder, errors are thrown (UsageError).
#pragma once

#include <string>

#include "tools/voxelctl/cli/options.h"

namespace CLI {
class App;
}  // namespace CLI

namespace voxeld::voxelctl {

// References passed in live as long as the app.
class SnapshotArguments {
 public:
  void Add(CLI::App* command);
  // `file` is the argument after "--", if there is one.
  SnapshotOptions Read(const CLI::App& command) const;
  std::string* file() { return &options_.file; }

 private:
  SnapshotOptions options_;
  std::string size_ = "1200x1000";
};

class RenderArguments {
 public:
  void Add(CLI::App* command);
  TurntableOptions Read(const CLI::App& command) const;
  std::string* file() { return &options_.file; }

 private:
  TurntableOptions options_;
  std::string size_;
  double frames_ = 72;
};

void AddGalleryOptions(CLI::App* command, GalleryOptions* options);
void CheckGalleryOptions(const GalleryOptions& options);

class ExportArguments {
 public:
  void Add(CLI::App* command);
  ExportOptions Read() const;
  std::string* file() { return &options_.file; }

 private:
  ExportOptions options_;
};

}  // namespace voxeld::voxelctl
