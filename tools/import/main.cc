// voxeld-import: reads one file, or the frames of a sequence or animation, for the process that
// started it, which is voxelctl (tools/voxelctl/import/import_program.h). It confines itself before
// it reads a file's contents.
#include <fcntl.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>
#include <vector>

#include "daemon/usage/standard_output.h"
#include "tools/import/gdal_map.h"
#include "tools/import/read_any.h"
#include "tools/import/rsvg_drawing.h"
#include "tools/voxelctl/import/frames.h"
#include "tools/voxelctl/import/import_options.h"
#include "tools/voxelctl/import/reader_process.h"

namespace voxeld::voxelctl {
namespace {

struct Wanted {
  std::vector<std::string> files;
  ImportOptions options;
  bool sequence = false;
  size_t animation = 0;  // 0: none
  double fps = 20;
};

// Files that are read when they are requested.
class SequenceFrames final : public FrameSource {
 public:
  explicit SequenceFrames(Wanted wanted) : wanted_(std::move(wanted)) {}
  int64_t count() const override { return static_cast<int64_t>(wanted_.files.size()); }
  absl::StatusOr<Model> Read(int64_t frame) override {
    if (frame < 0 || frame >= count()) return absl::InvalidArgumentError("there is no such frame");
    const absl::StatusOr<SourceFile> file =
        ReadSourceFile(wanted_.files[static_cast<size_t>(frame)], wanted_.options.other_files);
    if (!file.ok()) return file.status();
    return ReadAny(*file, wanted_.options);
  }

 private:
  const Wanted wanted_;
};

absl::Status Parse(int argc, char** argv, Wanted* wanted) {
  const std::map<std::string, OtherFiles> other_files = {
      {"none", OtherFiles::kNone}, {"below", OtherFiles::kBelow}, {"any", OtherFiles::kAny}};
  const std::map<std::string, MoleculeStyle> styles = {{"balls", MoleculeStyle::kBalls},
                                                       {"space", MoleculeStyle::kSpace}};
  std::map<std::string, SampleType> types;
  for (size_t i = 0; i < std::size(kSampleTypeNames); ++i)
    types[std::string(kSampleTypeNames[i])] = static_cast<SampleType>(i);
  CLI::App app;
  std::vector<uint64_t> size;
  RawLayout raw;
  app.add_option("FILE", wanted->files)->required();
  app.add_option("--other-files", wanted->options.other_files)
      ->transform(CLI::Transformer(other_files));
  app.add_option("--style", wanted->options.style)->transform(CLI::Transformer(styles));
  app.add_option("--pixels", wanted->options.pixels)->delimiter('x');
  app.add_flag("--globe", wanted->options.globe);
  app.add_flag("--attributes", wanted->options.attributes);
  app.add_option("--size", size)->delimiter('x')->expected(3);
  app.add_option("--type", raw.type)->transform(CLI::Transformer(types));
  app.add_flag("--big-endian", raw.big_endian);
  app.add_flag("--sequence", wanted->sequence);
  app.add_option("--animation", wanted->animation);
  app.add_option("--fps", wanted->fps);
  try {
    app.parse(argc, argv);
  } catch (const CLI::Error& error) {
    return absl::InvalidArgumentError(error.what());
  }
  if (size.size() == 3) {
    std::copy(size.begin(), size.end(), raw.size.begin());
    wanted->options.raw = raw;
  }
  return absl::OkStatus();
}

// Returns the files and folders to read besides the first file's folder. Loads what drawings need.
std::vector<std::string> ReadablesOf(const Wanted& wanted) {
  std::vector<std::string> folders;
  if (std::any_of(wanted.files.begin(), wanted.files.end(),
                  [](const std::string& file) { return IsDrawing(ExtensionOf(file)); })) {
    folders = PrepareDrawings();
  }
  if (std::any_of(wanted.files.begin(), wanted.files.end(),
                  [](const std::string& file) { return IsGdalMap(ExtensionOf(file)); })) {
    for (const std::string& folder : MapDataFolders()) folders.push_back(folder);
  }
  if (!wanted.sequence) return folders;
  if (wanted.options.other_files == OtherFiles::kNone) {
    folders.insert(folders.end(), wanted.files.begin(), wanted.files.end());
    return folders;
  }
  for (const std::string& file : wanted.files) {
    const std::string folder = std::filesystem::path(file).parent_path().string();
    folders.push_back(folder.empty() ? "." : folder);
  }
  std::sort(folders.begin(), folders.end());
  folders.erase(std::unique(folders.begin(), folders.end()), folders.end());
  return folders;
}

[[noreturn]] void Run(Wanted wanted) {
  const std::string& path = wanted.files.front();
  const bool frames = wanted.sequence || wanted.animation > 0;
  std::error_code ignored;
  const bool unread = wanted.sequence || std::filesystem::is_directory(path, ignored);
  absl::StatusOr<SourceFile> file = unread ? SourceFile{.path = path,
                                                        .extension = {},
                                                        .bytes = {},
                                                        .other_files = wanted.options.other_files}
                                           : ReadSourceFile(path, wanted.options.other_files);
  const SourceFile nothing{
      .path = path, .extension = {}, .bytes = {}, .other_files = wanted.options.other_files};
  if (!ConfineReader(file.ok() ? *file : nothing, ReadablesOf(wanted))) {
    ::_exit(kNotConfined);
  }
  if (wanted.sequence) {
    ServeFrames([&]() -> absl::StatusOr<std::unique_ptr<FrameSource>> {
      return std::make_unique<SequenceFrames>(std::move(wanted));
    });
  }
  if (frames) {
    ServeFrames([&]() -> absl::StatusOr<std::unique_ptr<FrameSource>> {
      if (!file.ok()) return file.status();
      return OpenAnimationHere(*std::move(file), wanted.animation, wanted.fps);
    });
  }
  AnswerModel([&]() -> absl::StatusOr<Model> {
    if (!file.ok()) return file.status();
    if (unread) return ReadFolder(path);
    absl::StatusOr<Model> model = ReadAny(*file, wanted.options);
    // Frees the file's bytes, because only the model is needed while it is sent.
    file->bytes = std::string();
    return model;
  });
}

// Prints the table of docs/files.md.
void PrintFormats() {
  std::puts(
      "| type | format | extensions | read | not read | library | tested with |\n"
      "|---|---|---|---|---|---|---|");
  const auto text = [](absl::string_view cell) { return std::string(cell.empty() ? "–" : cell); };
  for (const Format& format : AllFormats()) {
    std::printf("| %s | %s | %s | %s | %s | %s | %s |\n", text(format.what).c_str(),
                text(format.name).c_str(), text(format.extensions).c_str(),
                text(format.read).c_str(), text(format.not_read).c_str(),
                text(format.library).c_str(), text(format.tried).c_str());
  }
}

int Main(int argc, char** argv) {
  Wanted wanted;
  if (argc == 2 && std::string_view(argv[1]) == "--formats") {
    PrintFormats();
    return usage::CheckedExit("voxeld-import", 0);
  }
  if (::fcntl(kAnswerDescriptor, F_GETFD) < 0) {
    std::fprintf(
        stderr,
        "voxeld-import is started by voxelctl; to show a file, run "
        "`voxelctl play FILE`; to list the formats that are read, run `voxeld-import --formats`\n");
    return 2;
  }
  if (const absl::Status status = Parse(argc, argv, &wanted); !status.ok()) {
    AnswerModel([&]() -> absl::StatusOr<Model> { return status; });
  }
  Run(std::move(wanted));
}

}  // namespace
}  // namespace voxeld::voxelctl

int main(int argc, char** argv) { return voxeld::voxelctl::Main(argc, argv); }
