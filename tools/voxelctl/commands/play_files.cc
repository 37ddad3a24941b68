#include "tools/voxelctl/commands/play_files.h"

#include <algorithm>
#include <string>
#include <utility>

#include "absl/strings/str_join.h"
#include "common/text/printable.h"
#include "tools/voxelctl/import/import_program.h"
#include "tools/voxelctl/import/importer.h"

namespace voxeld::voxelctl {
namespace {

ImportOptions OptionsOf(const PlayOptions& options) {
  return {.globe = options.globe,
          .raw = options.raw,
          .style = options.style,
          .other_files = options.other_files};
}

}  // namespace

absl::StatusOr<std::vector<Model>> ReadFiles(const PlayOptions& options, Interrupt& interrupt,
                                             Console& console) {
  std::vector<Model> models;
  std::vector<std::string> errors;
  for (size_t i = 0; i < options.files.size(); ++i) {
    if (interrupt.requested()) return absl::CancelledError("interrupted");
    console.ProgressBar("reading",
                        static_cast<double>(i) / static_cast<double>(options.files.size()),
                        EscapeForTerminal(options.files[i]));
    absl::StatusOr<Model> model = ImportFile(options.files[i], OptionsOf(options), &interrupt);
    if (model.ok()) {
      const std::string note = NoteOf(*model);
      if (!note.empty()) console.Say(EscapeForTerminal(note));
      models.push_back(*std::move(model));
    } else {
      errors.emplace_back(model.status().message());
    }
  }
  if (!errors.empty()) {
    if (options.files.size() > errors.size())
      errors.emplace_back("nothing is put up unless all files can be");
    return absl::InvalidArgumentError(absl::StrJoin(errors, "\n"));
  }
  const auto is_globe = [](const Model& model) { return model.globe; };
  if (options.globe && std::none_of(models.begin(), models.end(), is_globe)) {
    return absl::InvalidArgumentError(
        "--globe is for maps (GeoJSON, TopoJSON), and none of the files is one");
  }
  return models;
}

absl::StatusOr<std::unique_ptr<FrameSource>> OpenFrameSource(const PlayOptions& options,
                                                             Interrupt& interrupt) {
  if (options.animation) {
    return OpenAnimation(options.files[0], *options.animation, options.fps, options.other_files,
                         &interrupt);
  }
  const bool one = options.files.size() == 1 && IsSequence(options.files[0]);
  if (!options.sequence && !one) {
    if (!options.loop) return nullptr;
    return absl::InvalidArgumentError(
        "--loop is for sequences ('frame_####.obj', or several files with --sequence) and "
        "--animate");
  }
  absl::StatusOr<std::vector<std::string>> files =
      one ? FindSequence(options.files[0])
          : absl::StatusOr<std::vector<std::string>>(options.files);
  if (!files.ok()) return files.status();
  const bool own = std::all_of(files->begin(), files->end(), [](const std::string& path) {
    return IsOwnFormat(ExtensionOf(path));
  });
  if (!own) return OpenSequence(*files, OptionsOf(options), &interrupt);
  return std::make_unique<FileFrames>(*std::move(files), OptionsOf(options), &interrupt);
}

}  // namespace voxeld::voxelctl
