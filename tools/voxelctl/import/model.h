// The result of reading a file: parts with vertices, in the file's own axes and units until
// scene/placement.h puts them into the display.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace voxeld::voxelctl {

struct Point3 {
  double x = 0, y = 0, z = 0;
  bool operator==(const Point3&) const = default;
};

struct Rgb {
  uint8_t r = 0, g = 0, b = 0;
  bool operator==(const Rgb&) const = default;
};

inline constexpr uint32_t kNoPicture = UINT32_MAX;

enum class Kind : uint8_t { kPoints, kSegments, kTriangles };

// A value per vertex, such as a measured column, for `play --color-by`.
struct Attribute {
  std::string name;            // as in the file
  std::vector<double> values;  // as many as positions; not-a-number if missing in the file
  bool operator==(const Attribute&) const = default;
};

// Vertices of one kind. Arrays beside `positions` are empty or have the same length.
struct Part {
  Kind kind = Kind::kTriangles;
  std::vector<Point3> positions;
  std::vector<Point3> normals;  // unit vectors, or zero if missing
  std::vector<Rgb> colors;
  // Two per segment, three per triangle, none for points; all < positions.size().
  std::vector<uint32_t> indices;
  // The diameter of points, which are then balls, and of segments, which have round ends; in the
  // positions' unit. 0: one voxel.
  double thickness = 0;
  std::vector<Attribute> attributes;
  // For triangles: coordinates on a picture, with (0, 0) at its upper left corner and (1, 1) at its
  // lower right one; beyond them it repeats.
  std::vector<std::array<float, 2>> texture_coordinates;
  // The picture by which the colours are multiplied: an index into Model::pictures, or kNoPicture.
  uint32_t picture = kNoPicture;
};

// Numbers at the centres of equal cells; the first axis varies fastest, then the second.
struct SampledVolume {
  std::array<uint32_t, 3> size = {};  // each at least 1
  std::vector<float> samples;         // finite, or not-a-number for missing samples
  std::vector<Rgb> colors;            // per sample, black if missing; empty: there are only numbers
  // The corners of the whole volume: bit 0 of the index selects the far end of the first axis, bit
  // 1 that of the second, bit 2 that of the third.
  std::array<Point3, 8> corners = {};
  // The range that the file says should be visible, from dark to bright.
  std::optional<std::array<double, 2>> window;
};

// Which of the file's axes points up. The smallest rotation that brings it to +z is applied: +y up
// makes +z the front and keeps +x right; +x up keeps −y the front.
enum class Up : uint8_t { kAuto, kX, kY, kZ };

// A kind of item that a file contains and its model does not show.
struct LeftOut {
  std::string kind;  // in the plural: "cameras", "atoms at alternate locations"
  uint64_t count = 0;
  bool operator==(const LeftOut&) const = default;
};

struct Model {
  std::string path;
  std::string format;  // for people: "glTF binary", "PLY points"
  std::string note;    // information about the reading, besides what is left out; usually empty
  std::vector<LeftOut> left_out;  // one entry per kind, with counts above 0
  Up up = Up::kZ;                 // the format's own; never kAuto
  double unit = 0;                // the length of the positions' unit in metres; 0: unknown
  bool globe = false;             // on the unit sphere about the origin, already upright
  bool molecule = false;          // atoms and bonds
  bool lit_already = false;       // its colours include lighting (scans), so no shading is applied
  std::vector<Part> parts;
  std::vector<SampledVolume> volumes;
  std::vector<std::string> pictures;  // PNG or JPEG files
};

// Counts `count` items of `kind` that are left out; 0 changes nothing.
void AddLeftOut(std::string_view kind, uint64_t count, Model* model);

// Appends `text` to the note.
void AddNote(std::string_view text, Model* model);

// Returns "PATH: NOTE; left out: cameras (2), lights (1)", without empty parts; empty if there is
// nothing to report.
std::string NoteOf(const Model& model);

// The maximum size of one model, so that no file makes the tool run out of memory.
inline constexpr uint64_t kMaxModelVertices = 32'000'000;
inline constexpr uint64_t kMaxModelIndices = 192'000'000;
inline constexpr uint64_t kMaxModelSamples = uint64_t{1} << 28;

}  // namespace voxeld::voxelctl
