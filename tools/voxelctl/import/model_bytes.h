// The binary form of a model, in which the confined reader of a file (reader_process.h) sends it to
// the process that requested it (contained.h).
//
// Both processes run on one machine, so numbers have its byte order and its IEEE 754 formats.
// Nothing is aligned. A list is a u64, the number of its items, followed by the items; a text is a
// list of bytes in UTF-8; a flag is a u8, 0 or 1.
//
//   answer    the eight bytes "VXMODEL" and kModelVersion; a u32, an absl::StatusCode; if that is not 0, a text, the error's message;
//             if it is 0, the result: the number of frames (an i64), or a model
//   model     path, format and note (texts); a list of what was left out; up (a u8, enum Up); unit (f64); the flags globe,
//             molecule and lit_already; a list of parts; a list of volumes; a list of pictures (each a list of bytes)
//   left out  kind (a text); count (a u64)
//   part      kind (a u8, enum Kind); thickness (f64); lists: positions and normals (3 f64 each), colours (3 u8 each), indices (u32),
//             texture coordinates (2 f32 each); the picture (a u32); a list of attributes, each a name (a text) and a list of f64
//   volume    size (3 u32); corners (8 points of 3 f64); a flag, and if it is 1 the window (2 f64); lists: samples (f32), colours
//             (3 u8 each)
//
// A change of the form changes kModelVersion: voxelctl and voxeld-import are separate packages, and
// one refuses the other's older form.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "tools/voxelctl/import/model.h"
#include "tools/voxelctl/import/source_file.h"

namespace voxeld::voxelctl {

inline constexpr char kModelVersion = 2;

// Writes a model, or the error of reading it, as an answer. The memory of its arrays is released
// while they are written, so that not both processes hold a large model. Returns: whether all of it
// could be written.
bool WriteModel(absl::StatusOr<Model> model, int descriptor);

// Writes the number of frames of a source, or the error of opening it, as an answer.
bool WriteFrameCount(const absl::StatusOr<int64_t>& count, int descriptor);

// Receives the next `size` bytes of an answer. Returns: false if they do not arrive.
using TakeBytes = std::function<bool(void* out, size_t size)>;

// Reads an answer that WriteModel has written: the model or the error. An error has a code that
// readers use. A hostile file may control the writer, so enumerations and sizes are checked;
// CheckModel checks the rest. Memory is used as bytes arrive, whatever length a list declares.
// Returns: InvalidArgument if these bytes are not an answer; FailedPrecondition if the writer has
// another version.
absl::Status ReadModel(const SourceFile& file, const TakeBytes& take, absl::StatusOr<Model>* model);

// Reads what WriteFrameCount has written. Returns: as above.
absl::Status ReadFrameCount(const SourceFile& file, const TakeBytes& take,
                            absl::StatusOr<int64_t>* count);

// Returns InvalidArgument with what happened to the reader.
absl::Status Spoilt(const SourceFile& file, absl::string_view how);

}  // namespace voxeld::voxelctl
