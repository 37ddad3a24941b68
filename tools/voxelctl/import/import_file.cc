#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <iterator>
#include <nlohmann/json.hpp>
#include <optional>
#include <system_error>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "tools/voxelctl/import/contained.h"
#include "tools/voxelctl/import/format.h"
#include "tools/voxelctl/import/geojson.h"
#include "tools/voxelctl/import/import_program.h"
#include "tools/voxelctl/import/importer.h"
#include "tools/voxelctl/import/json_text.h"
#include "tools/voxelctl/import/molecule.h"
#include "tools/voxelctl/import/ply_header.h"
#include "tools/voxelctl/import/ply_mesh.h"
#include "tools/voxelctl/import/ply_points.h"
#include "tools/voxelctl/import/ply_realign.h"
#include "tools/voxelctl/import/reader_process.h"
#include "tools/voxelctl/import/stl_mesh.h"
#include "tools/voxelctl/import/text_points.h"
#include "tools/voxelctl/import/vox_model.h"

namespace voxeld::voxelctl {
namespace {

absl::StatusOr<Model> ReadMap(const SourceFile& file, bool globe, bool attributes) {
  const absl::StatusOr<nlohmann::json> document = ParseJson(file, file.bytes);
  if (!document.ok()) return document.status();
  const auto type = document->is_object() ? document->find("type") : document->end();
  if (!document->is_object() || type == document->end() || !type->is_string()) {
    return FileError(file, "is JSON without a \"type\"", "GeoJSON or TopoJSON is expected");
  }
  return *type == "Topology" ? ReadTopoJson(file, *document, globe, attributes)
                             : ReadGeoJson(file, *document, globe, attributes);
}

absl::StatusOr<Model> ReadPly(const SourceFile& file, bool attributes) {
  const absl::StatusOr<PlyHeader> header = ParsePlyHeader(file);
  if (!header.ok()) {
    const absl::StatusOr<PlyHeader> unchecked = ParsePlyHeader(file, PlyCounts::kUnchecked);
    if (!unchecked.ok()) return header.status();
    const std::optional<RealignedPly> mended = RealignPly(file, *unchecked);
    if (!mended) return header.status();
    absl::StatusOr<Model> model = ReadPlyPoints(mended->file, *unchecked);
    if (model.ok()) {
      model->note = absl::StrCat(file.path, ": was once copied as text and lost ",
                                 mended->lost_bytes, " bytes; put in place again by its normals, ",
                                 mended->lost_entries, " points could not be made out");
    }
    return model;
  }
  return HasPlySurfaces(*header) ? ReadPlyMesh(file, *header, attributes)
                                 : ReadPlyPoints(file, *header, attributes);
}

bool IsFiniteValue(const Point3& p) {
  return std::isfinite(p.x) && std::isfinite(p.y) && std::isfinite(p.z);
}
bool IsFiniteValue(double number) { return std::isfinite(number); }

template <typename Values>
bool AllFinite(const Values& values) {
  return std::all_of(std::begin(values), std::end(values),
                     [](const auto& value) { return IsFiniteValue(value); });
}

bool HasSoundPicture(const Part& part, size_t pictures) {
  if (part.picture == kNoPicture) return part.texture_coordinates.empty();
  return part.kind == Kind::kTriangles && part.picture < pictures &&
         part.texture_coordinates.size() == part.positions.size() &&
         std::all_of(part.texture_coordinates.begin(), part.texture_coordinates.end(),
                     [](const std::array<float, 2>& at) { return AllFinite(at); });
}

// Checks the lengths of arrays, which all users rely on, because a hostile file may have taken over
// the reader.
bool IsSound(const Part& part, size_t pictures) {
  const size_t count = part.positions.size();
  const size_t each = part.kind == Kind::kPoints ? 0 : part.kind == Kind::kSegments ? 2 : 3;
  return (part.normals.empty() || part.normals.size() == count) &&
         (part.colors.empty() || part.colors.size() == count) &&
         (each == 0 ? part.indices.empty() : part.indices.size() % each == 0) &&
         std::isfinite(part.thickness) && AllFinite(part.normals) &&
         HasSoundPicture(part, pictures) &&
         std::all_of(part.attributes.begin(), part.attributes.end(),
                     [&](const Attribute& one) { return one.values.size() == count; });
}

// Returns 0 if there are none, or more than a model may hold.
uint64_t SamplesOf(const SampledVolume& volume) {
  uint64_t samples = 1;
  for (const uint32_t size : volume.size) {
    if (size == 0 || samples > kMaxModelSamples / size) return 0;
    samples *= size;
  }
  return samples;
}

}  // namespace

// Verifies what every reader promises: an error in a library must not reach the server.
absl::Status CheckModel(const SourceFile& file, const Model& model) {
  uint64_t vertices = 0, indices = 0, all_samples = 0;
  for (const Part& part : model.parts) {
    vertices += part.positions.size();
    indices += part.indices.size();
    if (!IsSound(part, model.pictures.size()))
      return FileError(file, "holds a part that is not sound", "damaged files are not read");
    for (const Point3& p : part.positions) {
      if (!std::isfinite(p.x) || !std::isfinite(p.y) || !std::isfinite(p.z)) {
        return FileError(file, absl::StrCat("holds the vertex (", p.x, ", ", p.y, ", ", p.z, ")"),
                         "coordinates must be finite");
      }
    }
    for (const uint32_t index : part.indices) {
      if (index >= part.positions.size()) {
        return FileError(file, absl::StrCat("refers to vertex ", index),
                         absl::StrCat("a part of it has ", part.positions.size()));
      }
    }
  }
  for (const SampledVolume& volume : model.volumes) {
    const uint64_t samples = SamplesOf(volume);
    all_samples += samples;
    if (!AllFinite(volume.corners) || (volume.window && !AllFinite(*volume.window))) {
      return FileError(file, "holds a volume at no place", "its corners must be finite");
    }
    if (samples == 0 || samples != volume.samples.size()) {
      return FileError(file, absl::StrCat("holds ", volume.samples.size(), " samples"),
                       absl::StrCat("its size makes ", samples));
    }
    if (!volume.colors.empty() && volume.colors.size() != samples) {
      return FileError(file, absl::StrCat("holds ", volume.colors.size(), " colours"),
                       absl::StrCat("its size makes ", samples));
    }
    if (std::none_of(volume.samples.begin(), volume.samples.end(),
                     [](float v) { return std::isfinite(v); })) {
      return FileError(file, "holds no sample that is a number", "at least one is expected");
    }
    ++vertices;
  }
  if (vertices > kMaxModelVertices || indices > kMaxModelIndices ||
      all_samples > kMaxModelSamples) {
    return FileError(file,
                     absl::StrCat("holds ", vertices, " vertices, ", indices, " indices and ",
                                  all_samples, " samples"),
                     absl::StrCat("at most ", kMaxModelVertices, ", ", kMaxModelIndices, " and ",
                                  kMaxModelSamples, " are read"));
  }
  if (vertices == 0)
    return FileError(file, "holds nothing to draw", "at least one vertex is expected");
  return absl::OkStatus();
}

bool HasExtension(const Format& format, absl::string_view extension) {
  const std::vector<absl::string_view> all = absl::StrSplit(format.extensions, ' ');
  return std::any_of(all.begin(), all.end(),
                     [extension](absl::string_view one) { return one.substr(1) == extension; });
}

const std::vector<Format>& OwnFormats() {
  static const std::vector<Format> formats = {
      {"meshes", "STL", ".stl", "",
       "ASCII and binary, several solids, the facets' colours of VisCAM, SolidView and Materialise "
       "Magics",
       "colours in ASCII files", "assimp-testmodels: 8"},
      {"meshes, points", "PLY", ".ply", "",
       "ASCII and binary of either byte order, faces and strips, colours of vertices and faces, "
       "normals, intensities of points; other properties by --color-by",
       "pictures, other elements (edges, materials)", "assimp-testmodels: 7 of 8 (one is damaged)"},
      {"voxels", "MagicaVoxel", ".vox", "", "models where the scene's nodes put them, the palette",
       "frames after the first, hidden nodes and layers, models outside the scene, materials", "–"},
      {"points, molecules", "text", ".xyz .txt .asc .pts .csv", "",
       "positions, colours, intensities and normals by the names or the number of columns, the "
       "other "
       "columns by --color-by; chemistry's XYZ as a molecule",
       "frames after the first",
       "votca-data, apbs-data, quantum-espresso-data and others: 59 .xyz"},
      {"maps", "GeoJSON, TopoJSON", ".geojson .topojson .json", "",
       "lines, points and the outlines of areas, simplestyle's colours; numbers of properties by "
       "--color-by; --globe puts them on a sphere",
       "fills of areas, widths of lines, sizes of points, heights (except by --color-by)",
       "world-atlas: 4"},
  };
  return formats;
}

bool IsOwnFormat(absl::string_view extension) {
  return std::any_of(OwnFormats().begin(), OwnFormats().end(),
                     [extension](const Format& format) { return HasExtension(format, extension); });
}

absl::StatusOr<Model> ReadOwnFormat(const SourceFile& file, const ImportOptions& options) {
  const std::string& extension = file.extension;
  if (extension == "ply") return ReadPly(file, options.attributes);
  if (extension == "stl") return ReadStlMesh(file);
  if (extension == "vox") return ReadVoxModel(file);
  if (extension == "json" || extension == "geojson" || extension == "topojson")
    return ReadMap(file, options.globe, options.attributes);
  // Chemistry and surveying use the same extension.
  if (IsXyzMolecule(file.bytes)) return ReadXyzMolecule(file, options.style, options.attributes);
  return ReadTextPoints(file, options.attributes);
}

absl::StatusOr<Model> ImportFile(const std::string& path, const ImportOptions& options,
                                 Interrupt* interrupt) {
  std::error_code ignored;
  if (!IsOwnFormat(ExtensionOf(path)) || std::filesystem::is_directory(path, ignored))
    return ImportByProgram(path, options, interrupt);
  absl::StatusOr<SourceFile> file = ReadSourceFile(path, options.other_files);
  if (!file.ok()) return file.status();
  absl::StatusOr<Model> model = ReadContained(
      *file, ReaderOf(*file, [&] { return ReadOwnFormat(*file, options); }), interrupt);
  if (!model.ok()) return model;
  const absl::Status status = CheckModel(*file, *model);
  if (!status.ok()) return status;
  return model;
}

}  // namespace voxeld::voxelctl
