#include "tools/voxelctl/commands/play_files.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/string_view.h"
#include "common/text/printable.h"
#include "tools/voxelctl/import/import_program.h"
#include "tools/voxelctl/import/importer.h"

namespace voxeld::voxelctl {
namespace {

// The share of a display that placement fills. A drawing gets one pixel per voxel in it.
constexpr double kFilled = 0.97;

ImportOptions OptionsOf(const PlayOptions& options, const Room& room) {
  const auto filled = [](uint32_t voxels) {
    return static_cast<uint32_t>(std::max(1.0, std::floor(voxels * kFilled)));
  };
  return {.globe = options.globe,
          .raw = options.raw,
          .style = options.style,
          .attributes = !options.color_by.empty(),
          .pixels = {filled(room.voxels[0]), filled(room.voxels[1])},
          .other_files = options.other_files};
}

}  // namespace

absl::StatusOr<std::vector<Model>> ReadFiles(const PlayOptions& options, const Room& room,
                                             Interrupt& interrupt, Console& console) {
  std::vector<Model> models;
  std::vector<std::string> errors;
  for (size_t i = 0; i < options.files.size(); ++i) {
    if (interrupt.requested()) return absl::CancelledError("interrupted");
    console.ProgressBar("reading",
                        static_cast<double>(i) / static_cast<double>(options.files.size()),
                        EscapeForTerminal(options.files[i]));
    absl::StatusOr<Model> model =
        ImportFile(options.files[i], OptionsOf(options, room), &interrupt);
    if (model.ok()) {
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
  if (absl::Status status = CheckOptions(options, models); !status.ok()) return status;
  return models;
}

absl::Status CheckOptions(const PlayOptions& options, std::span<const Model> models) {
  const auto any = [&models](const std::function<bool(const Model&)>& is) {
    return std::any_of(models.begin(), models.end(), is);
  };
  const bool volume = any([](const Model& model) { return !model.volumes.empty(); });
  const struct {
    absl::string_view option;
    bool applies;
    absl::string_view what;
  } wants[] = {
      {"--globe", any([](const Model& model) { return model.globe; }),
       "maps (GeoJSON, TopoJSON, Shapefile, GPX, KML)"},
      {"--style", any([](const Model& model) { return model.molecule; }),
       "molecules (PDB, mmCIF, XYZ)"},
      {"--fill", any([](const Model& model) {
         return std::any_of(model.parts.begin(), model.parts.end(),
                            [](const Part& part) { return part.kind == Kind::kTriangles; });
       }),
       "meshes"},
      {"--colormap", volume || !options.color_by.empty(), "volumes and --color-by"},
      {"--window", volume, "volumes"},
      {"--level", volume, "volumes"},
      {"--size", any([](const Model& model) { return ExtensionOf(model.path) == "raw"; }),
       ".raw files"},
  };
  for (const auto& [option, applies, what] : wants) {
    const bool given =
        std::find(options.given.begin(), options.given.end(), option) != options.given.end();
    if (!given || applies) continue;
    return absl::InvalidArgumentError(
        absl::StrCat(option, " is for ", what, ", and has no effect on these files"));
  }
  return absl::OkStatus();
}

absl::StatusOr<std::unique_ptr<FrameSource>> OpenFrameSource(const PlayOptions& options,
                                                             const Room& room,
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
  if (!own) return OpenSequence(*files, OptionsOf(options, room), &interrupt);
  return std::make_unique<FileFrames>(*std::move(files), OptionsOf(options, room), &interrupt);
}

}  // namespace voxeld::voxelctl
