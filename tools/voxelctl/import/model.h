// What comes out of a file: parts with vertices, in the file's own axes and units until
// scene/normalise.h puts them into the display.
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
  std::vector<double> values;  // as many as positions; not a number where the file has none
  bool operator==(const Attribute&) const = default;
};

// Vertices of one kind. Arrays beside `positions` are empty or as long as it.
struct Part {
  Kind kind = Kind::kTriangles;
  std::vector<Point3> positions;
  std::vector<Point3> normals;  // of unit length, or zero where there is none
  std::vector<Rgb> colors;
  // Two a segment, three a triangle; none for points; all < positions.size().
  std::vector<uint32_t> indices;
  // Diameter of points, which are balls then, and of segments, which have round ends; in the positions' unit. 0: one voxel.
  double thickness = 0;
  std::vector<Attribute> attributes;
  // Of triangles: the place on a picture, (0, 0) its upper left corner and (1, 1) its lower right one; beyond them it repeats.
  std::vector<std::array<float, 2>> texture_coordinates;
  // The picture by which the colours are multiplied: an index of Model::pictures, or kNoPicture.
  uint32_t picture = kNoPicture;
};

// Numbers at the centres of equal cells, that along the first axis side by side, then rows along the second.
struct SampledVolume {
  std::array<uint32_t, 3> size = {};  // each at least 1
  std::vector<float> samples;         // finite, or not a number where there is nothing
  std::vector<Rgb> colors;  // of each, black where there is nothing; empty: there are numbers alone
  // Of the whole: bit 0 of the index is for the far end of the first axis, bit 1 for that of the second, bit 2 of the third.
  std::array<Point3, 8> corners = {};
  // What the file says is to be seen, from dark to bright.
  std::optional<std::array<double, 2>> window;
};

// Which of the file's axes points up. The smallest turn that brings it to +z is applied: +y up
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
  std::string
      note;  // what people should know of how it was read, beside what is left out; usually empty
  std::vector<LeftOut> left_out;  // one of each kind, none with a count of 0
  Up up = Up::kZ;                 // the format's own; never kAuto
  bool globe = false;             // on the unit sphere about the origin, upright already
  bool molecule = false;          // atoms and bonds
  bool lit_already = false;  // its colours carry their light (scans): no shading is baked into them
  std::vector<Part> parts;
  std::vector<SampledVolume> volumes;
  std::vector<std::string> pictures;  // PNG or JPEG files
};

// Counts `count` things of `kind` that are left out; 0 changes nothing.
void AddLeftOut(std::string_view kind, uint64_t count, Model* model);

// Adds `text` to the note, behind what stands there.
void AddNote(std::string_view text, Model* model);

// "PATH: NOTE; left out: cameras (2), lights (1)", without the parts that are empty; empty if there is nothing to say.
std::string NoteOf(const Model& model);

// What one model may hold in all, so that no file makes the tool run out of memory.
inline constexpr uint64_t kMaxModelVertices = 32'000'000;
inline constexpr uint64_t kMaxModelIndices = 192'000'000;
inline constexpr uint64_t kMaxModelSamples = uint64_t{1} << 28;

}  // namespace voxeld::voxelctl
