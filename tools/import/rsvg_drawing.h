// Reads drawings (.svg, .svgz) with librsvg.
//
// librsvg is the renderer of GNOME. It has what our own reader lacked: CSS selectors, text,
// gradients, patterns, clips, masks, markers, nested viewports and embedded pictures. It runs no
// scripts and no animations. Filters are switched off, because some of them start threads, run for
// hours or terminate the process. Texts along paths and SVG fonts are not drawn.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "tools/voxelctl/import/model.h"
#include "tools/voxelctl/import/source_file.h"

namespace voxeld::voxelctl {

// The number of pixels of the longer side if the display is unknown.
inline constexpr uint32_t kDrawingPixels = 512;
inline constexpr uint32_t kMostDrawingPixels = 4096;

// Returns whether files with this extension, in lower case, are drawings.
bool IsDrawing(absl::string_view extension);

// Loads the configuration of fonts, and keeps gdk-pixbuf from loading plug-ins. Requires: called
// once before a drawing is read, with no other threads, before the process is confined. Takes some
// milliseconds. Returns: the folders of fonts.
std::vector<std::string> PrepareDrawings();

// Returns: the drawing as a picture, one sample thick, with at most `pixels` across and up (each
// clamped to 1 to kMostDrawingPixels). It is upright and black where nothing is drawn. As many
// pixels as voxels work best. Strokes thinner than a pixel are as bright as if they filled it.
// Opens no files except fonts. Texts are left out if no font can be read, no thread can be started,
// or one of them is larger or longer than librsvg can draw. Parts that the picture does not show
// are counted in the model. Errors: InvalidArgument if `file` is not a valid drawing, is too large,
// nests too deep or has nothing visible.
absl::StatusOr<Model> ReadSvgDrawing(const SourceFile& file, const std::array<uint32_t, 2>& pixels);

}  // namespace voxeld::voxelctl
