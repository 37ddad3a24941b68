// voxeld-import, the program that reads the files that need libraries. It is an optional package.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "tools/voxelctl/import/frames.h"
#include "tools/voxelctl/import/import_options.h"
#include "tools/voxelctl/import/model.h"
#include "tools/voxelctl/process/interrupt.h"

namespace voxeld::voxelctl {

// Returns: OK if the program exists beside this one or in ../libexec/voxeld. Errors: Unimplemented
// "SUBJECT: …" with how to install it.
absl::Status CheckImporters(absl::string_view subject);

// Reads a file or folder like ImportFile, with the program.
absl::StatusOr<Model> ImportByProgram(const std::string& path, const ImportOptions& options,
                                      Interrupt* interrupt);

// Opens animation `number`, from 1, of a mesh file or skeleton (glTF, FBX, COLLADA, BVH, …), with
// frames at `fps` per second from beginning to end. Meshes follow their bones; without meshes the
// bones are lines. The program runs as long as the result lives. `interrupt` may be null. Errors:
// InvalidArgument if the animation does not exist, with the names of the existing ones; as above.
absl::StatusOr<std::unique_ptr<FrameSource>> OpenAnimation(
    const std::string& path, size_t number, double fps, OtherFiles other_files = OtherFiles::kBelow,
    Interrupt* interrupt = nullptr);

// Opens files that are frames; one run of the program reads all of them.
absl::StatusOr<std::unique_ptr<FrameSource>> OpenSequence(const std::vector<std::string>& paths,
                                                          const ImportOptions& options,
                                                          Interrupt* interrupt);

}  // namespace voxeld::voxelctl
