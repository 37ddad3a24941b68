#include "tools/voxelctl/import/import_program.h"

#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <system_error>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "common/text/printable.h"
#include "tools/voxelctl/import/contained.h"
#include "tools/voxelctl/import/format.h"
#include "tools/voxelctl/import/importer.h"
#include "tools/voxelctl/import/reader_process.h"
#include "tools/voxelctl/text/not_built.h"

namespace voxeld::voxelctl {
namespace {

constexpr char kProgram[] = "voxeld-import";

// Returns: the program's path; empty if it is missing.
std::string FindProgram() {
  std::error_code error;
  const std::filesystem::path here =
      std::filesystem::read_symlink("/proc/self/exe", error).parent_path();
  if (error) return "";
  for (const std::filesystem::path& folder : {here, here.parent_path() / "libexec" / "voxeld"}) {
    const std::string program = (folder / kProgram).string();
    if (::access(program.c_str(), X_OK) == 0) return program;
  }
  return "";
}

absl::Status NoProgram(absl::string_view subject) {
#if defined(VOXELD_HAS_IMPORTERS)
  return absl::UnimplementedError(absl::StrCat(
      subject, ": files of this type need the program ", kProgram,
      ", which is not installed; install the package ", kProgram, " (voxelctl itself reads ",
      absl::StrJoin(
          OwnFormats(), " ",
          [](std::string* out, const Format& format) { absl::StrAppend(out, format.extensions); }),
      ")"));
#else
  return NotBuilt(subject, "reads STL, PLY, VOX, GeoJSON, TopoJSON and point clouds as text",
                  "more formats", "VOXELD_IMPORTERS");
#endif
}

// Returns a description of the file without contents, which the program reads.
SourceFile Unread(const std::string& path, OtherFiles other_files) {
  return {.path = path, .extension = ExtensionOf(path), .bytes = {}, .other_files = other_files};
}

// Returns the options for tools/import/main.cc.
std::vector<std::string> ArgumentsOf(const ImportOptions& options) {
  constexpr absl::string_view kOtherFiles[] = {"none", "below", "any"};
  constexpr absl::string_view kStyles[] = {"balls", "space"};
  std::vector<std::string> arguments = {
      absl::StrCat("--other-files=", kOtherFiles[static_cast<size_t>(options.other_files)]),
      absl::StrCat("--style=", kStyles[static_cast<size_t>(options.style)]),
      absl::StrCat("--pixels=", options.pixels[0], "x", options.pixels[1])};
  if (options.globe) arguments.push_back("--globe");
  if (options.attributes) arguments.push_back("--attributes");
  if (options.raw) {
    const RawLayout& raw = *options.raw;
    arguments.push_back(absl::StrCat("--size=", raw.size[0], "x", raw.size[1], "x", raw.size[2]));
    arguments.push_back(absl::StrCat("--type=", kSampleTypeNames[static_cast<size_t>(raw.type)]));
    if (raw.big_endian) arguments.push_back("--big-endian");
  }
  return arguments;
}

// `more` are further command-line options.
absl::StatusOr<std::vector<std::string>> Command(const std::vector<std::string>& paths,
                                                 const ImportOptions& options,
                                                 const std::vector<std::string>& more) {
  std::string program = FindProgram();
  if (program.empty()) {
    // Errors of the files themselves, such as a missing one, come before the missing program.
    for (const std::string& path : paths) {
      std::error_code ignored;
      if (std::filesystem::is_directory(path, ignored)) continue;
      const absl::StatusOr<SourceFile> file = ReadSourceFile(path, options.other_files);
      if (!file.ok()) return file.status();
    }
    return NoProgram(EscapeForTerminal(paths.front()));
  }
  std::vector<std::string> command = {std::move(program)};
  for (std::string& argument : ArgumentsOf(options)) command.push_back(std::move(argument));
  command.insert(command.end(), more.begin(), more.end());
  command.push_back("--");
  command.insert(command.end(), paths.begin(), paths.end());
  return command;
}

}  // namespace

absl::Status CheckImporters(absl::string_view subject) {
  return FindProgram().empty() ? NoProgram(subject) : absl::OkStatus();
}

absl::StatusOr<Model> ImportByProgram(const std::string& path, const ImportOptions& options,
                                      Interrupt* interrupt) {
  absl::StatusOr<std::vector<std::string>> command = Command({path}, options, {});
  if (!command.ok()) return command.status();
  SourceFile file = Unread(path, options.other_files);
  absl::StatusOr<Model> model = ReadContained(file, ProgramOf(*std::move(command)), interrupt);
  if (!model.ok()) return model;
  const absl::Status status = CheckModel(file, *model);
  if (!status.ok()) return status;
  return model;
}

absl::StatusOr<std::unique_ptr<FrameSource>> OpenAnimation(const std::string& path, size_t number,
                                                           double fps, OtherFiles other_files,
                                                           Interrupt* interrupt) {
  const SourceFile file = Unread(path, other_files);
  if (IsOwnFormat(file.extension)) {
    return FileError(file, absl::StrCat("is .", file.extension, ", which has no animations"),
                     "a .glb, .gltf, .fbx, .dae or .bvh is expected");
  }
  absl::StatusOr<std::vector<std::string>> command =
      Command({path}, {.other_files = other_files},
              {absl::StrCat("--animation=", number), absl::StrFormat("--fps=%.17g", fps)});
  if (!command.ok()) return command.status();
  return OpenContained(file, ProgramOf(*std::move(command)), interrupt);
}

absl::StatusOr<std::unique_ptr<FrameSource>> OpenSequence(const std::vector<std::string>& paths,
                                                          const ImportOptions& options,
                                                          Interrupt* interrupt) {
  absl::StatusOr<std::vector<std::string>> command = Command(paths, options, {"--sequence"});
  if (!command.ok()) return command.status();
  return OpenContained(Unread(paths.front(), options.other_files), ProgramOf(*std::move(command)),
                       interrupt);
}

}  // namespace voxeld::voxelctl
