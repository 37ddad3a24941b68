#include "tools/voxelctl/import/vox_chunks.h"

#include <algorithm>
#include <bit>
#include <cstring>
#include <iterator>
#include <optional>
#include <utility>

#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "absl/strings/string_view.h"

namespace voxeld::voxelctl {
namespace {

static_assert(std::endian::native == std::endian::little, "values are read in place");

constexpr size_t kFileHeader = 8, kChunkHeader = 12;
constexpr uint32_t kMostSide = 256;
constexpr size_t kMostNodes = 100'000, kMostGrids = 10'000;

// Reads the bytes of one chunk from the front. Reading beyond the end returns nothing and sets
// `short_`.
class Bytes {
 public:
  explicit Bytes(absl::string_view bytes) : rest_(bytes) {}

  int32_t Int() {
    int32_t value = 0;
    const absl::string_view bytes = Take(sizeof(value));
    if (bytes.size() == sizeof(value)) std::memcpy(&value, bytes.data(), sizeof(value));
    return value;
  }
  absl::string_view Take(size_t size) {
    if (size > rest_.size()) {
      short_ = true;
      return {};
    }
    const absl::string_view taken = rest_.substr(0, size);
    rest_.remove_prefix(size);
    return taken;
  }
  absl::string_view String() { return Take(static_cast<uint32_t>(Int())); }
  std::map<std::string, std::string> Dictionary() {
    std::map<std::string, std::string> out;
    const auto count = static_cast<uint32_t>(Int());
    for (uint32_t i = 0; i < count && ok(); ++i) {
      const std::string key(String());
      out[key] = std::string(String());
    }
    return out;
  }
  bool ok() const { return !short_; }

 private:
  absl::string_view rest_;
  bool short_ = false;
};

// White to black in steps of 0x33, blue before green before red, then ramps of red, green, blue and
// grey: the format's palette for files without one.
std::array<Rgb, 256> DefaultPalette() {
  std::array<Rgb, 256> out = {};
  size_t at = 1;
  for (int step = 0; step < 215; ++step) {
    const auto level = [](int down) { return static_cast<uint8_t>(255 - 51 * down); };
    out[at++] = {level(step / 36), level(step / 6 % 6), level(step % 6)};
  }
  constexpr uint8_t kRamp[] = {0xee, 0xdd, 0xbb, 0xaa, 0x88, 0x77, 0x55, 0x44, 0x22, 0x11};
  for (const uint8_t r : kRamp) out[at++] = {r, 0, 0};
  for (const uint8_t g : kRamp) out[at++] = {0, g, 0};
  for (const uint8_t b : kRamp) out[at++] = {0, 0, b};
  for (const uint8_t grey : kRamp) out[at++] = {grey, grey, grey};
  return out;
}

// Two bits for the column of row 0, two for that of row 1, three signs. Returns nothing if two rows
// have the same column.
std::optional<VoxTurn> TurnOf(uint32_t bits) {
  VoxTurn turn;
  turn.column[0] = bits & 3;
  turn.column[1] = bits >> 2 & 3;
  if (turn.column[0] > 2 || turn.column[1] > 2 || turn.column[0] == turn.column[1]) {
    return std::nullopt;
  }
  turn.column[2] = static_cast<uint8_t>(3 - turn.column[0] - turn.column[1]);
  for (int r = 0; r < 3; ++r) turn.sign[r] = (bits >> (4 + r) & 1) != 0 ? -1 : 1;
  return turn;
}

bool ReadMove(const std::string& text, std::array<int32_t, 3>* out) {
  const std::vector<std::string> words = absl::StrSplit(text, ' ', absl::SkipEmpty());
  constexpr int32_t kFar = 1 << 24;
  if (words.size() != 3) return false;
  for (int a = 0; a < 3; ++a) {
    if (!absl::SimpleAtoi(words[a], &(*out)[a]) || std::abs((*out)[a]) > kFar) return false;
  }
  return true;
}

// Returns: the frame of a key frame; 0 if it names none.
int32_t FrameOf(const std::map<std::string, std::string>& attributes) {
  int32_t frame = 0;
  const auto at = attributes.find("_f");
  return at != attributes.end() && absl::SimpleAtoi(at->second, &frame) ? frame : 0;
}

bool IsHidden(const std::map<std::string, std::string>& attributes) {
  const auto hidden = attributes.find("_hidden");
  return hidden != attributes.end() && hidden->second == "1";
}

// Returns whether the chunk only controls how MagicaVoxel shows a scene and does not describe the
// scene: cameras, rendering, names of colours, the order of its palette on the screen.
bool IsForTheEditor(absl::string_view id) {
  static constexpr absl::string_view kThese[] = {"PACK", "rCAM", "rOBJ", "NOTE", "IMAP"};
  return std::ranges::find(kThese, id) != std::end(kThese);
}

class VoxReader {
 public:
  explicit VoxReader(const SourceFile& file) : file_(file) { scene_.palette = DefaultPalette(); }

  absl::StatusOr<VoxScene> Read() {
    absl::string_view rest = file_.bytes;
    if (!absl::StartsWith(rest, "VOX ") || rest.size() < kFileHeader + kChunkHeader ||
        rest.substr(kFileHeader, 4) != "MAIN") {
      return FileError(file_, absl::StrCat("is ", DescribeContents(rest)),
                       "a MagicaVoxel file is expected");
    }
    rest.remove_prefix(kFileHeader);
    Bytes main(rest.substr(4));
    const auto own = static_cast<uint32_t>(main.Int());
    rest.remove_prefix(std::min<size_t>(kChunkHeader + size_t{own}, rest.size()));
    while (!rest.empty()) {
      if (rest.size() < kChunkHeader) return CutOff("the file");
      const std::string id(rest.substr(0, 4));
      Bytes head(rest.substr(4));
      const auto size = static_cast<uint32_t>(head.Int()),
                 children = static_cast<uint32_t>(head.Int());
      rest.remove_prefix(kChunkHeader);
      if (size > rest.size() || children > rest.size() - size) return CutOff(Named(id));
      if (absl::Status status = Take(id, Bytes(rest.substr(0, size))); !status.ok()) return status;
      rest.remove_prefix(size + children);
    }
    if (scene_.grids.empty()) return FileError(file_, "has no model", "one at least is expected");
    return std::move(scene_);
  }

 private:
  static std::string Named(const std::string& id) {
    const bool plain = std::ranges::all_of(id, [](char c) { return c > ' ' && c <= '~'; });
    return absl::StrCat("its chunk ", plain ? id : "without a name");
  }
  absl::Status CutOff(absl::string_view what) const {
    return FileError(file_, absl::StrCat(what, " is cut off", TextModeHint(file_.bytes)),
                     "the file is truncated or damaged");
  }

  absl::Status Take(const std::string& id, Bytes bytes) {
    absl::Status status;
    if (id == "SIZE") {
      status = TakeSize(&bytes);
    } else if (id == "XYZI") {
      status = TakeVoxels(&bytes);
    } else if (id == "RGBA") {
      for (size_t i = 0; i < 255 && bytes.ok(); ++i) {
        const absl::string_view c = bytes.Take(4);
        if (!c.empty()) {
          scene_.palette[i + 1] = {static_cast<uint8_t>(c[0]), static_cast<uint8_t>(c[1]),
                                   static_cast<uint8_t>(c[2])};
        }
      }
    } else if (id == "nTRN" || id == "nGRP" || id == "nSHP") {
      status = TakeNode(id, &bytes);
    } else if (id == "LAYR") {
      const int32_t layer = bytes.Int();
      if (IsHidden(bytes.Dictionary()) && layer >= 0) scene_.hidden_layers.insert(layer);
    } else if (id == "MATL") {
      bytes.Int();  // the resulting colour
      const auto attributes = bytes.Dictionary();
      const auto type = attributes.find("_type");
      if (type != attributes.end() && type->second != "_diffuse") ++scene_.materials;
    } else if (id == "MATT") {
      bytes.Int();
      if (bytes.Int() != 0) ++scene_.materials;
    } else if (!IsForTheEditor(id)) {
      ++scene_.unknown_chunks;
    }
    if (status.ok() && !bytes.ok()) return CutOff(Named(id));
    return status;
  }

  absl::Status TakeSize(Bytes* bytes) {
    VoxGrid grid;
    for (uint32_t& side : grid.size) {
      side = static_cast<uint32_t>(bytes->Int());
      if (bytes->ok() && (side < 1 || side > kMostSide)) {
        return FileError(file_, absl::StrCat("has a model of ", side, " voxels along an axis"),
                         absl::StrCat("1 to ", kMostSide, " are read"));
      }
    }
    if (scene_.grids.size() >= kMostGrids) {
      return FileError(file_, absl::StrCat("has more than ", kMostGrids, " models"),
                       "take a part of it");
    }
    scene_.grids.push_back(std::move(grid));
    return absl::OkStatus();
  }

  absl::Status TakeVoxels(Bytes* bytes) {
    if (scene_.grids.empty()) {
      return FileError(file_, "has voxels before a size", "a chunk SIZE is expected before XYZI");
    }
    VoxGrid& grid = scene_.grids.back();
    const auto count = static_cast<uint32_t>(bytes->Int());
    for (uint32_t i = 0; i < count; ++i) {
      const absl::string_view v = bytes->Take(4);
      if (v.empty()) break;
      const VoxVoxel voxel{static_cast<uint8_t>(v[0]), static_cast<uint8_t>(v[1]),
                           static_cast<uint8_t>(v[2]), static_cast<uint8_t>(v[3])};
      if (voxel.x >= grid.size[0] || voxel.y >= grid.size[1] || voxel.z >= grid.size[2]) {
        return FileError(
            file_, absl::StrCat("has a voxel at (", voxel.x, ", ", voxel.y, ", ", voxel.z, ")"),
            absl::StrCat("its model is ", grid.size[0], " by ", grid.size[1], " by ",
                         grid.size[2]));
      }
      if (voxel.color != 0) grid.voxels.push_back(voxel);
    }
    return absl::OkStatus();
  }

  absl::Status TakeNode(const std::string& id, Bytes* bytes) {
    const int32_t number = bytes->Int();
    const auto attributes = bytes->Dictionary();
    VoxNode node;
    node.hidden = IsHidden(attributes);
    if (id == "nTRN") {
      node.kind = VoxNode::Kind::kTransform;
      node.children = {bytes->Int()};
      (void)bytes->Int();  // reserved
      node.layer = bytes->Int();
      const auto frames = static_cast<uint32_t>(bytes->Int());
      std::map<std::string, std::string> frame;
      for (uint32_t i = 0; i < frames && bytes->ok(); ++i) {
        auto key = bytes->Dictionary();
        if (i == 0 || FrameOf(key) < FrameOf(frame)) frame = std::move(key);
      }
      if (frames > 0) {
        scene_.later_frames += frames - 1;
        const auto move = frame.find("_t"), turn = frame.find("_r");
        if (move != frame.end() && !ReadMove(move->second, &node.move)) {
          return FileError(file_, "has a node that is moved by no three numbers",
                           "_t is \"x y z\", within 2²⁴");
        }
        uint32_t bits = 0;
        if (turn != frame.end()) {
          const auto read = absl::SimpleAtoi(turn->second, &bits) ? TurnOf(bits) : std::nullopt;
          if (!read.has_value()) {
            return FileError(file_, "has a node that is turned by no rotation",
                             "_r has two columns that differ, and three signs");
          }
          node.turn = *read;
        }
      }
    } else {
      node.kind = id == "nGRP" ? VoxNode::Kind::kGroup : VoxNode::Kind::kShape;
      const auto count = static_cast<uint32_t>(bytes->Int());
      int32_t first = 0;
      for (uint32_t i = 0; i < count && bytes->ok(); ++i) {
        const int32_t child = bytes->Int();
        if (node.kind == VoxNode::Kind::kGroup) {
          node.children.push_back(child);
          continue;
        }
        // An animated shape has a model for each key frame.
        const int32_t frame = FrameOf(bytes->Dictionary());
        if (i > 0) {
          ++scene_.later_frames;
          scene_.later_grids.insert(frame >= first ? child : node.children[0]);
          if (frame >= first) continue;
        }
        node.children = {child};
        first = frame;
      }
    }
    if (!bytes->ok()) return absl::OkStatus();
    if (scene_.nodes.size() >= kMostNodes) {
      return FileError(file_, absl::StrCat("has more than ", kMostNodes, " nodes"),
                       "take a part of it");
    }
    scene_.nodes[number] = std::move(node);
    return absl::OkStatus();
  }

  const SourceFile& file_;
  VoxScene scene_;
};

}  // namespace

absl::StatusOr<VoxScene> ReadVoxChunks(const SourceFile& file) { return VoxReader(file).Read(); }

}  // namespace voxeld::voxelctl
