#include "tools/voxelctl/import/vox_model.h"

#include <array>
#include <string>
#include <utility>
#include <vector>

#include "absl/container/flat_hash_set.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "tools/voxelctl/import/vox_chunks.h"

namespace voxeld::voxelctl {
namespace {

constexpr int kMostGroupDepth = 64;
constexpr uint64_t kMostGroupVisits = 1'000'000;
constexpr size_t kSparse = 64;  // cells per voxel

using VoxCell = std::array<int64_t, 3>;

// Where a grid's cells are placed: first rotated, then moved.
struct Place {
  VoxTurn turn;
  VoxCell move = {};

  VoxCell Turned(const VoxCell& v) const {
    VoxCell out;
    for (int r = 0; r < 3; ++r) out[r] = turn.sign[r] * v[turn.column[r]];
    return out;
  }
  // Returns the placement of `inner` within this one.
  Place operator*(const VoxNode& inner) const {
    Place out;
    for (int r = 0; r < 3; ++r) {
      out.turn.column[r] = inner.turn.column[turn.column[r]];
      out.turn.sign[r] = static_cast<int8_t>(turn.sign[r] * inner.turn.sign[turn.column[r]]);
    }
    out.move = Turned({inner.move[0], inner.move[1], inner.move[2]});
    for (int r = 0; r < 3; ++r) out.move[r] += move[r];
    return out;
  }
};

class Builder {
 public:
  Builder(const SourceFile& file, const VoxScene& scene) : file_(file), scene_(scene) {
    part_.kind = Kind::kTriangles;
  }

  absl::StatusOr<Model> Build() {
    absl::Status status;
    uint64_t frames = 0, outside = 0;
    if (scene_.nodes.empty()) {
      // Version 0.98 had no nodes and stored an animation as several models (PACK).
      status = Put(0, Place());
      frames = scene_.grids.size() - 1;
    } else {
      status = Visit(0, Place(), 0);
      for (size_t g = 0; g < scene_.grids.size(); ++g) {
        const auto number = static_cast<int32_t>(g);
        outside += known_.contains(number) || scene_.later_grids.contains(number) ? 0 : 1;
      }
    }
    if (!status.ok()) return status;
    if (part_.positions.empty()) {
      return FileError(file_, "has no voxel that is to be seen", "at least one is expected");
    }
    Model model;
    model.path = file_.path;
    model.format = "MagicaVoxel";
    model.up = Up::kZ;
    model.lit_already = true;
    model.parts.push_back(std::move(part_));
    AddLeftOut("frames after the first", frames, &model);
    AddLeftOut("key frames after the first", scene_.later_frames, &model);
    AddLeftOut("models outside the scene", outside, &model);
    AddLeftOut("hidden nodes", hidden_, &model);
    AddLeftOut("materials other than diffuse", scene_.materials, &model);
    AddLeftOut("chunks of unknown kinds", scene_.unknown_chunks, &model);
    return model;
  }

 private:
  absl::Status Visit(int32_t number, const Place& place, int depth) {
    const auto at = scene_.nodes.find(number);
    if (at == scene_.nodes.end()) {
      return FileError(file_, absl::StrCat("refers to node ", number), "there is none");
    }
    if (depth > kMostGroupDepth || ++visits_ > kMostGroupVisits) {
      return FileError(file_, "has nodes within nodes without end",
                       absl::StrCat("at most ", kMostGroupDepth, " deep are read"));
    }
    const VoxNode& node = at->second;
    if (node.hidden || scene_.hidden_layers.contains(node.layer)) {
      ++hidden_;
      PassHidden(number);
      return absl::OkStatus();
    }
    const Place here = node.kind == VoxNode::Kind::kTransform ? place * node : place;
    for (const int32_t child : node.children) {
      const absl::Status status =
          node.kind == VoxNode::Kind::kShape ? Put(child, here) : Visit(child, here, depth + 1);
      if (!status.ok()) return status;
    }
    return absl::OkStatus();
  }

  // Marks the models below a hidden node as known, so that only the node is counted.
  void PassHidden(int32_t number) {
    std::vector<int32_t> stack = {number};
    while (!stack.empty()) {
      const auto at = scene_.nodes.find(stack.back());
      stack.pop_back();
      if (at == scene_.nodes.end() || !passed_.insert(at->first).second) continue;
      const std::vector<int32_t>& children = at->second.children;
      if (at->second.kind == VoxNode::Kind::kShape) {
        known_.insert(children.begin(), children.end());
      } else {
        stack.insert(stack.end(), children.begin(), children.end());
      }
    }
  }

  absl::Status Put(int32_t number, const Place& place) {
    known_.insert(number);
    if (number < 0 || static_cast<size_t>(number) >= scene_.grids.size()) {
      return FileError(file_, absl::StrCat("refers to model ", number),
                       absl::StrCat("it has ", scene_.grids.size()));
    }
    if (++visits_ > kMostGroupVisits) {
      return FileError(file_, absl::StrCat("shows more than ", kMostGroupVisits, " models"),
                       "take a part of it");
    }
    const VoxGrid& grid = scene_.grids[static_cast<size_t>(number)];
    const auto index = [&grid](uint32_t x, uint32_t y, uint32_t z) {
      return (size_t{z} * grid.size[1] + y) * grid.size[0] + x;
    };
    // The cost of few voxels in many cells must not depend on the cells: a model may be shown many
    // times.
    const size_t cells = index(0, 0, grid.size[2]);
    const bool dense = grid.voxels.size() >= cells / kSparse;
    std::vector<bool> all(dense ? cells : 0);
    absl::flat_hash_set<size_t> some;
    for (const VoxVoxel& v : grid.voxels) {
      if (dense) {
        all[index(v.x, v.y, v.z)] = true;
      } else {
        some.insert(index(v.x, v.y, v.z));
      }
    }
    const auto is_filled = [&](size_t at) { return dense ? all[at] : some.contains(at); };
    for (const VoxVoxel& v : grid.voxels) {
      const std::array<uint32_t, 3> cell = {v.x, v.y, v.z};
      for (int axis = 0; axis < 3; ++axis) {
        for (const int side : {0, 1}) {
          std::array<uint32_t, 3> next = cell;
          next[axis] += side == 1 ? 1 : -1;  // wraps below the first, and is then beyond the last
          if (next[axis] < grid.size[axis] && is_filled(index(next[0], next[1], next[2]))) continue;
          if (absl::Status status = AddFace(grid, cell, axis, side, place, scene_.palette[v.color]);
              !status.ok()) {
            return status;
          }
        }
      }
    }
    return absl::OkStatus();
  }

  absl::Status AddFace(const VoxGrid& grid, const std::array<uint32_t, 3>& cell, int axis, int side,
                       const Place& place, const Rgb& color) {
    const auto first = static_cast<uint32_t>(part_.positions.size());
    if (first + 4 > kMaxModelVertices) {
      return FileError(file_,
                       absl::StrCat("has more than ", kMaxModelVertices / 4, " faces to be seen"),
                       "take a part of it");
    }
    const int u = (axis + 1) % 3, w = (axis + 2) % 3;
    for (const auto& [du, dw] : {std::pair(0, 0), {1, 0}, {1, 1}, {0, 1}}) {
      // Grids are rotated about the corner of cells that is at their centre.
      VoxCell corner;
      for (int a = 0; a < 3; ++a) corner[a] = int64_t{cell[a]} - grid.size[a] / 2;
      corner[axis] += side;
      corner[u] += du;
      corner[w] += dw;
      const VoxCell at = place.Turned(corner);
      part_.positions.push_back({static_cast<double>(at[0] + place.move[0]),
                                 static_cast<double>(at[1] + place.move[1]),
                                 static_cast<double>(at[2] + place.move[2])});
      part_.colors.push_back(color);
    }
    for (const uint32_t i : {0u, 1u, 2u, 0u, 2u, 3u}) part_.indices.push_back(first + i);
    return absl::OkStatus();
  }

  const SourceFile& file_;
  const VoxScene& scene_;
  uint64_t visits_ = 0, hidden_ = 0;
  absl::flat_hash_set<int32_t> known_;   // models that nodes of the scene show or hide
  absl::flat_hash_set<int32_t> passed_;  // hidden nodes
  Part part_;
};

}  // namespace

absl::StatusOr<Model> ReadVoxModel(const SourceFile& file) {
  const absl::StatusOr<VoxScene> scene = ReadVoxChunks(file);
  if (!scene.ok()) return scene.status();
  return Builder(file, *scene).Build();
}

}  // namespace voxeld::voxelctl
