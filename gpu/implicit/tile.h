// The voxels of an implicit shape in a tile, on the CPU: intervals find the parts of 4³ voxels that
// may contain some, and P is computed row by row in those parts.
#pragma once

#include <cstdint>

#include "gpu/implicit/field.h"
#include "gpu/implicit/row.h"
#include "gpu/primitives/grid.h"

namespace voxeld::gpu::implicit {

class TileField {
 public:
  // Requires: `box` is not empty and at most kTileSize along each axis.
  TileField(const Field& field, const Source& source, const Box3& box)
      : field_(field), hoisted_(field.hoisted()), solid_(source.solid), box_(box) {
    for (int a = 0; a < 3; ++a) size_[a] = box.hi[a] - box.lo[a];
  }

  // Calls f(x, y, z, rgb) for each voxel covered.
  template <class Emit>
  void EmitVoxels(Emit&& emit) {
    if (!FindParts()) return;
    FindRows();
    for (int32_t z = 0; z < size_[2]; ++z) {
      for (int32_t y = 0; y < size_[1]; ++y) EmitRow(y, z, emit);
    }
  }

 private:
  static constexpr int32_t kPart = 4;
  static constexpr size_t kRowNumbers = sizeof(Row) / sizeof(float);
  static constexpr int32_t kParts = kTileSize / kPart;
  static constexpr int32_t kRows = kTileSize + 2;

  bool is_shell() const { return !field_.solid() && field_.half() != 0; }

  // Returns false if no part has anything.
  bool FindParts() {
    if (is_shell()) reach_ = field_.ReachIn(box_);
    // P's hoisted values in each of the parts along each axis.
    Interval values[kParts][kMostHoisted], offsets[3][kParts];
    for (int a = 0; a < 3; ++a) {
      for (int32_t i = 0; i * kPart < size_[a]; ++i) {
        const int64_t lo = int64_t{box_.lo[a]} + i * kPart;
        const int64_t last = gpu::Min<int64_t>(lo + kPart, box_.hi[a]) - 1;
        offsets[a][i] = {solid_.Distance(a, lo - field_.rim()),
                         solid_.Distance(a, last + field_.rim()), false};
        field_.HoistedAlong(a, offsets[a][i],
                            [&](const Interval& value, uint32_t v) { values[i][v] = value; });
      }
    }
    bool any = false;
    for (int32_t k = 0; k * kPart < size_[2]; ++k) {
      for (int32_t j = 0; j * kPart < size_[1]; ++j) {
        for (int32_t i = 0; i * kPart < size_[0]; ++i) {
          const int32_t at[3] = {i, j, k};
          Interval q[3];
          if (hoisted_.needs_coordinates()) {
            field_.Coordinates(offsets[0][i], offsets[1][j], offsets[2][k], q);
          }
          const Interval p =
              field_.Rest(q, [&](uint32_t v) { return values[at[hoisted_.axis_of(v)]][v]; });
          BoxState& state = parts_[k][j][i];
          state = field_.StateOf(p);
          if (is_shell()) state.none = state.none && Abs(p).lo > reach_;
          any |= !state.none;
        }
      }
    }
    return any;
  }

  // Computes P in the rows of parts with anything, and of their neighbours.
  void FindRows() {
    const int32_t rim = field_.rim();
    bool needed[kRows][kRows] = {};
    for (int32_t k = 0; k * kPart < size_[2]; ++k) {
      for (int32_t j = 0; j * kPart < size_[1]; ++j) {
        bool any = false;
        for (int32_t i = 0; i * kPart < size_[0]; ++i) {
          any |= !parts_[k][j][i].none && !parts_[k][j][i].all;
        }
        if (!any) continue;
        const int32_t z1 = gpu::Min((k + 1) * kPart, size_[2]),
                      y1 = gpu::Min((j + 1) * kPart, size_[1]);
        for (int32_t z = k * kPart - rim; z < z1 + rim; ++z) {
          for (int32_t y = j * kPart - rim; y < y1 + rim; ++y) needed[z + 1][y + 1] = true;
        }
      }
    }
    dx_ = EachOf<kRowNumbers>([&](size_t i) {
      return solid_.Distance(0, int64_t{box_.lo[0]} - 1 + static_cast<int64_t>(i));
    });
    field_.HoistedAlong(0, dx_, [&](const Row& value, uint32_t v) { along_x_[v] = value; });
    for (int a = 1; a < 3; ++a) {
      for (int32_t i = -1; i <= size_[a]; ++i) {
        field_.HoistedAlong(a, solid_.Distance(a, int64_t{box_.lo[a]} + i),
                            [&](float value, uint32_t v) { across_[i + 1][v] = value; });
      }
    }
    for (int32_t z = -1; z <= size_[2]; ++z) {
      for (int32_t y = -1; y <= size_[1]; ++y) {
        if (!needed[z + 1][y + 1]) continue;
        Row q[3];
        RowCoordinates(y, z, q);
        values_[z + 1][y + 1] = field_.Rest(q, [&](uint32_t v) {
          const int axis = hoisted_.axis_of(v);
          return axis == 0 ? along_x_[v] : ConstantLike(dx_, across_[(axis == 1 ? y : z) + 1][v]);
        });
      }
    }
  }

  // Computes the coordinates of the row's voxels, from one before the box on, if they are needed.
  void RowCoordinates(int32_t y, int32_t z, Row q[3]) const {
    if (!hoisted_.needs_coordinates()) return;
    const Row dy = ConstantLike(dx_, solid_.Distance(1, int64_t{box_.lo[1]} + y));
    const Row dz = ConstantLike(dx_, solid_.Distance(2, int64_t{box_.lo[2]} + z));
    field_.Coordinates(dx_, dy, dz, q);
  }

  float ValueAt(int32_t x, int32_t y, int32_t z) const { return values_[z + 1][y + 1].at[x + 1]; }

  // Returns whether a neighbour on the other side has no smaller |P|.
  bool IsBetweenSides(int32_t x, int32_t y, int32_t z, float p) const {
    const bool inside = Field::IsInside(p);
    const float magnitude = Field::Magnitude(p);
    const auto meets = [&](int32_t dx, int32_t dy, int32_t dz) {
      const float other = ValueAt(x + dx, y + dy, z + dz);
      return Field::IsInside(other) != inside && magnitude <= Field::Magnitude(other);
    };
    if (!field_.cover()) {
      return meets(-1, 0, 0) || meets(1, 0, 0) || meets(0, -1, 0) || meets(0, 1, 0) ||
             meets(0, 0, -1) || meets(0, 0, 1);
    }
    for (int32_t dz = -1; dz <= 1; ++dz) {
      for (int32_t dy = -1; dy <= 1; ++dy) {
        for (int32_t dx = -1; dx <= 1; ++dx) {
          if (meets(dx, dy, dz)) return true;
        }
      }
    }
    return false;
  }

  // Computes the hoisted values with their gradients.
  void FindDuals() {
    duals_known_ = true;
    field_.DualHoistedAlong(0, dx_,
                            [&](const DualRow& value, uint32_t v) { dual_along_x_[v] = value; });
    for (int a = 1; a < 3; ++a) {
      for (int32_t i = 0; i < size_[a]; ++i) {
        field_.DualHoistedAlong(
            a, solid_.Distance(a, int64_t{box_.lo[a]} + i),
            [&](const Dual<float>& value, uint32_t v) { dual_across_[i][v] = value; });
      }
    }
  }

  // Returns a bit for each voxel of the row: |P| ≤ h·|∇P|.
  uint32_t FindShell(int32_t y, int32_t z) {
    if (!duals_known_) FindDuals();
    Row q[3];
    RowCoordinates(y, z, q);
    DualRow dual[3];
    if (hoisted_.needs_coordinates()) field_.WithGradients(q, dual);
    const DualRow p = field_.Rest(dual, [&](uint32_t v) {
      const int axis = hoisted_.axis_of(v);
      if (axis == 0) return dual_along_x_[v];
      const Dual<float>& one = dual_across_[axis == 1 ? y : z][v];
      return WithGradient(ConstantLike(dx_, one.value),
                          [&](int i) { return ConstantLike(dx_, one.d[i]); });
    });
    const Row slope = Field::Slope(p);
    uint32_t bits = 0;
    for (int32_t x = 0; x < size_[0]; ++x) {
      bits |= static_cast<uint32_t>(Abs(p.value.at[x + 1]) <= field_.half() * slope.at[x + 1]) << x;
    }
    return bits;
  }

  template <class Emit>
  void EmitRow(int32_t y, int32_t z, Emit&& emit) {
    const BoxState* const parts = parts_[z / kPart][y / kPart];
    bool shell_known = false;
    uint32_t shell = 0;
    for (int32_t x = 0; x < size_[0]; ++x) {
      const BoxState& part = parts[x / kPart];
      if (part.none) {
        x |= kPart - 1;
        continue;
      }
      bool covered = part.all;
      if (!covered) {
        const float p = ValueAt(x, y, z);
        if (field_.solid()) {
          covered = Field::IsInside(p);
        } else if (field_.half() == 0) {
          covered = p == 0;
        } else if (Abs(p) <= reach_) {
          if (!shell_known) shell = FindShell(y, z);
          shell_known = true;
          covered = (shell >> x & 1) != 0;
        }
        if (!covered && !field_.solid() && part.side == Side::kMixed) {
          covered = IsBetweenSides(x, y, z, p);
        }
      }
      if (covered) EmitCovered(box_.lo[0] + x, box_.lo[1] + y, box_.lo[2] + z, emit);
    }
  }

  // Emits a voxel if it is within the bounds.
  template <class Emit>
  void EmitCovered(int32_t x, int32_t y, int32_t z, Emit&& emit) {
    float q[3] = {};
    if (!field_.is_plain()) field_.CoordinatesOf(x, y, z, q);
    if (field_.IsBounded(q)) emit(x, y, z, field_.ColorAt(q));
  }

  const Field& field_;
  const HoistedView hoisted_;
  const Solid& solid_;
  const Box3 box_;
  int32_t size_[3];
  float reach_ = 0;  // for a shell: Field::ReachIn of the box
  BoxState parts_[kParts][kParts][kParts];
  Row dx_;                             // from the origin
  Row along_x_[kMostHoisted];          // P's hoisted values: in a row,
  float across_[kRows][kMostHoisted];  // and along y and z
  Row values_[kRows][kRows];
  bool duals_known_ = false;
  DualRow dual_along_x_[kMostHoisted];
  Dual<float> dual_across_[kTileSize][kMostHoisted];
};

}  // namespace voxeld::gpu::implicit
