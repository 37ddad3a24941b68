// Reads maps with GDAL: Shapefile, GPX and KML.
//
// GDAL was chosen because geographic information systems read these formats with it. Only its three
// drivers for them are registered (LIBKML, not KML, which has neither styles nor numbers). It gets
// files in memory and has neither plug-ins nor network, and neither environment variables nor
// configuration files change what it does. GeoJSON and TopoJSON, which every build reads, have
// readers of our own (geojson.h says why). GDAL ignores the visibility of KML's folders, so hidden
// placemarks are removed before it reads the file. It loses styles in other files. If points of a
// GPX track have no elevation it is 0, and times and other numbers of a track's points are not
// read.
#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "tools/voxelctl/import/model.h"
#include "tools/voxelctl/import/source_file.h"

namespace voxeld::voxelctl {

// Returns whether ReadGdalMap reads files of this extension (in lower case, without the dot).
bool IsGdalMap(absl::string_view extension);

// Returns the folders that GDAL needs besides the file: PROJ's database of coordinate systems.
std::vector<std::string> MapDataFolders();

// Reads points, lines and the outlines of areas with the colours of KML's styles and all numeric
// fields; of a Shapefile also the files .shx, .dbf, .prj and .cpg beside it. A flat map is in the
// map's own units. For a globe, projected coordinates become longitude and latitude. Errors:
// InvalidArgument with GDAL's message.
absl::StatusOr<Model> ReadGdalMap(const SourceFile& file, bool globe, bool attributes = false);

}  // namespace voxeld::voxelctl
