// An SVG element's attributes, and the curves that its shape has ("Scalable Vector Graphics 1.1", section 9).
#pragma once

#include <libxml/tree.h>

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "tools/import/svg_path.h"

namespace voxeld::voxelctl {

absl::string_view SvgName(const xmlNode* node);
// Empty if there is none.
std::string SvgAttribute(const xmlNode* node, const char* name);
// href, with or without XLink's namespace.
std::string SvgReference(const xmlNode* node);
// In the units of the drawing; a share of nothing that is known counts as nothing.
double SvgLength(const xmlNode* node, const char* name, double otherwise);

// Of path, rect, circle, ellipse, line, polyline and polygon; of others none. InvalidArgument says "FOUND; EXPECTED";
// ResourceExhausted: more than `most` points.
absl::StatusOr<std::vector<Polyline>> SvgShape(const xmlNode* node, size_t most);

}  // namespace voxeld::voxelctl
