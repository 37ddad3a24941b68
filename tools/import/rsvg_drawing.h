// Drawings (.svg, .svgz), drawn by librsvg.
//
// librsvg is the renderer of GNOME. It has what a reader of our own lacked: CSS selectors, text, gradients, patterns, clips, masks, markers,
// nested viewports and embedded pictures. It runs no scripts and no animations. Filters are switched off, since some of them start
// threads, run for hours or end the process; texts along paths and SVG fonts are not drawn.
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

// Pixels of the longer side if the display is unknown.
inline constexpr uint32_t kDrawingPixels = 512;
inline constexpr uint32_t kMostDrawingPixels = 4096;

// Whether files with this extension, in lower case, are drawings.
bool IsDrawing(absl::string_view extension);

// Loads the configuration of fonts, and keeps gdk-pixbuf from loading plug-ins. Call it once before a drawing is read, with
// no other threads, before the process is confined. Takes some milliseconds. Returns: the folders of fonts.
std::vector<std::string> PrepareDrawings();

// Returns: the drawing as a picture, one sample thick and with at most `pixels` across and up (each 1 to kMostDrawingPixels, else the
// nearest of these); upright, black where nothing is drawn. It is best to have as many pixels as voxels. Strokes that are thinner than a pixel
// are as bright as if they filled it. Opens no files but fonts. Texts are left out where no font can be read, no thread can be
// started, or one of them is larger or longer than librsvg can draw. What the picture does not show is counted in the model.
// Errors: InvalidArgument: `file` is not a valid drawing, is too large or nests too deep, or nothing of it can be seen.
absl::StatusOr<Model> ReadSvgDrawing(const SourceFile& file, const std::array<uint32_t, 2>& pixels);

}  // namespace voxeld::voxelctl
