// Finds the contents of COLLADA files that assimp does not read or replaces by its own values.
#pragma once

#include <cstdint>
#include <map>
#include <string>

#include "tools/voxelctl/import/model.h"
#include "tools/voxelctl/import/source_file.h"

namespace voxeld::voxelctl {

struct ColladaContents {
  // By the names that assimp gives to materials: whether the effect has a diffuse colour or texture.
  // assimp gives a grey to the others.
  std::map<std::string, bool> has_diffuse;
  uint64_t holes = 0;  // of polygons
};

// Reads the file with libxml2 up to the first error, which assimp reports. Counts other scenes,
// splines, convex meshes, NURBS, solids, holes of polygons and colours that are parameters as left
// out of `model`, and adds a note if elements have no material.
ColladaContents ScanCollada(const SourceFile& file, Model* model);

// Returns the file with blanks in place of the holes of polygons, which assimp refuses; empty if it
// has none.
std::string WithoutColladaHoles(const SourceFile& file);

}  // namespace voxeld::voxelctl
