// An implicit shape in voxel space: the voxels that it covers, their colours, and what can be said
// about a box of voxels without testing each of them. Host and device.
//
// P, Φ and the colour are functions of the shape's own coordinates at a voxel's centre (solid.h). A
// voxel is inside if P ≤ 0; NaN is outside. The solid consists of the voxels that are inside. The
// surface, of half-width h voxels, consists of each voxel with
//   |P| ≤ h·|∇P|, the gradient in voxel space; for h = 0: P = 0; or with
// a neighbour on the other side whose |P| is not less (NaN is infinite),
// among the 6 neighbours that share a face (THIN) or all 26 (COVER). Of any two neighbours on
// different sides one is covered, so no path of such steps leads from one side to the other past
// the surface. Solids and surfaces cover only voxels at whose centre Φ ≤ 0 and which lie within the
// rings: the closed curves, projected along an axis, by the even-odd rule.
//
// Guarantee: if P is the distance, a solid consists of the voxels whose centres are inside the
// shape, to within 0.006 voxel (its origin is snapped to 2⁻⁸), and its volume is right within 1 %
// at a radius of 20 voxels. A surface misses no voxel nearer than h and covers none farther than h
// plus half a voxel's diagonal (√¾). Past edges shells are mitred. At any thickness no path of
// steps across faces passes through a THIN surface (6-separating), and no path at all through a
// COVER one (26-separating). A shift by whole voxels shifts the result.
#pragma once

#include "gpu/implicit/hoisted.h"
#include "gpu/implicit/program.h"
#include "gpu/primitives/source.h"

namespace voxeld::gpu::implicit {

enum class Side : uint8_t { kOutside, kInside, kMixed };

// The state of all voxels in a box.
struct BoxState {
  Side side = Side::kMixed;  // of all voxels, and of those around the box if they matter
  bool none = false;         // nothing in the box is covered
  bool all = false;          // for a solid: everything is covered
};

class Field {
 public:
  VOXELD_HD explicit Field(const Source& source)
      : solid_(source.solid),
        place_(source.implicit),
        record_(*source.record),
        positions_(source.positions),
        tint_(source.tint),
        program_{source.indices},
        hoisted_{source.implicit.hoisted} {}

  VOXELD_HD bool solid() const { return record_.fill == Fill::kSolid; }
  VOXELD_HD bool cover() const { return record_.rule == SurfaceRule::kCover; }
  VOXELD_HD float half() const { return place_.half; }

  // Computes the shape's coordinates at offsets from its origin, in voxels.
  template <class N>
  VOXELD_HD void Coordinates(const N& dx, const N& dy, const N& dz, N q[3]) const {
    for (int r = 0; r < 3; ++r) {
      const float* const row = solid_.inverse[r];
      const N sum = Add(Add(Mul(ConstantLike(dx, row[0]), dx), Mul(ConstantLike(dx, row[1]), dy)),
                        Mul(ConstantLike(dx, row[2]), dz));
      // Turn −0 into 0: its sign would depend on an axis that the coordinate does not depend on.
      q[r] = Add(sum, ConstantLike(dx, 0.0f));
    }
  }
  template <class N>
  VOXELD_HD void WithGradients(const N q[3], Dual<N> dual[3]) const {
    for (int r = 0; r < 3; ++r) {
      dual[r].value = q[r];
      for (int a = 0; a < 3; ++a) dual[r].d[a] = ConstantLike(q[0], solid_.inverse[r][a]);
    }
  }
  VOXELD_HD void CoordinatesOf(int32_t x, int32_t y, int32_t z, float q[3]) const {
    Coordinates(solid_.Distance(0, x), solid_.Distance(1, y), solid_.Distance(2, z), q);
  }

  template <class N>
  VOXELD_HD N Surface(const N q[3]) const {
    N slots[kMostSlots];
    Run(program_.surface_code(), program_.surface(), q, place_.voxel, slots);
    return slots[program_.surface_slot()];
  }
  template <class N>
  VOXELD_HD N Bound(const N q[3]) const {
    N slots[kMostSlots];
    Run(program_.bound_code(), program_.bound(), q, place_.voxel, slots);
    return slots[program_.bound_slot()];
  }

  // Returns |P| as neighbours compare it.
  VOXELD_HD static float Magnitude(float p) { return IsNan(p) ? Infinity() : Abs(p); }
  VOXELD_HD static bool IsInside(float p) { return p <= 0; }

  // Returns whether |P| ≤ h·|∇P|.
  template <class N>
  VOXELD_HD static N Slope(const Dual<N>& p) {
    return SlopeOf(p);
  }
  VOXELD_HD bool IsWithin(const Dual<float>& p) const {
    return Abs(p.value) <= place_.half * Slope(p);
  }

  // Tests Φ and the rings.
  VOXELD_HD bool IsBounded(const float q[3]) const {
    if (program_.bound() != 0 && !(Bound(q) <= 0)) return false;
    return program_.rings() == 0 || IsInRings(q);
  }

  VOXELD_HD uint32_t ColorAt(const float q[3]) const {
    const ColorBy by = program_.color_by();
    if (by == ColorBy::kUniform) return Tinted(record_.color, tint_);
    float slots[kMostSlots];
    Run(program_.color_code(), program_.color(), q, place_.voxel, slots);
    if (by == ColorBy::kTable) {
      return Tinted(program_.table()[Level(slots[program_.color_slot(0)], 256)], tint_);
    }
    uint32_t rgb = 0;
    for (uint32_t c = 0; c < 3; ++c) rgb = rgb << 8 | Level(slots[program_.color_slot(c)], 255.5f);
    return Tinted(rgb, tint_);
  }

  VOXELD_HD bool is_bounded() const { return program_.bound() != 0 || program_.rings() != 0; }
  VOXELD_HD bool is_uniform() const { return program_.color_by() == ColorBy::kUniform; }
  // Returns whether every voxel that P selects is covered, in the record's colour.
  VOXELD_HD bool is_plain() const { return !is_bounded() && is_uniform(); }

  VOXELD_HD const HoistedView& hoisted() const { return hoisted_; }
  // Evaluates the hoisted values of an axis at `d` voxels from the origin: calls f(value, number of
  // the hoisted value).
  template <class N, class F>
  VOXELD_HD void HoistedAlong(int axis, const N& d, F&& f) const {
    const N zero = ConstantLike(d, 0.0f);
    N q[3], slots[kMostSlots];
    Coordinates(axis == 0 ? d : zero, axis == 1 ? d : zero, axis == 2 ? d : zero, q);
    Run(hoisted_.axis_code(axis), hoisted_.axis_instructions(axis), q, place_.voxel, slots);
    for (uint32_t v = hoisted_.begin(axis); v < hoisted_.end(axis); ++v) {
      f(slots[hoisted_.slot(v)], v);
    }
  }
  // The same with gradients.
  template <class N, class F>
  VOXELD_HD void DualHoistedAlong(int axis, const N& d, F&& f) const {
    const N zero = ConstantLike(d, 0.0f);
    N q[3];
    Dual<N> dual[3], slots[kMostSlots];
    Coordinates(axis == 0 ? d : zero, axis == 1 ? d : zero, axis == 2 ? d : zero, q);
    WithGradients(q, dual);
    Run(hoisted_.axis_code(axis), hoisted_.axis_instructions(axis), dual, place_.voxel, slots);
    for (uint32_t v = hoisted_.begin(axis); v < hoisted_.end(axis); ++v) {
      f(slots[hoisted_.slot(v)], v);
    }
  }
  // Returns P from hoisted values. `q` is used only if they do not suffice
  // (HoistedView::needs_coordinates).
  template <class N, class Values>
  VOXELD_HD N Rest(const N q[3], Values&& values) const {
    N slots[kMostSlots];
    Run(hoisted_.rest_code(), hoisted_.rest(), q, place_.voxel, slots, values);
    return slots[hoisted_.rest_slot()];
  }

  // Returns the state of voxels whose P lies in the interval.
  VOXELD_HD BoxState StateOf(const Interval& p) const {
    BoxState state;
    if (p.lo > 0) {
      state.side = Side::kOutside;
    } else if (!p.nan && (p.hi < 0 || (solid() && p.hi <= 0))) {
      state.side = Side::kInside;
    }
    state.none = state.side == Side::kOutside || (!solid() && state.side == Side::kInside);
    state.all = solid() && state.side == Side::kInside;
    return state;
  }
  // For surfaces, the sides of voxels up to one beyond a box matter.
  VOXELD_HD int32_t rim() const { return solid() ? 0 : 1; }

  // Returns what is known about the voxels in a box. Requires: the box has at least one voxel along
  // each axis.
  VOXELD_HD VOXELD_DEVICE_NOINLINE BoxState StateOf(const Box3& box) const {
    Interval q[3];
    if (program_.bound() != 0) {
      CoordinatesOf(box, 0, q);
      if (IntervalOf(program_.bound_code(), program_.bound(), program_.bound_slot(), q).lo > 0)
        return {Side::kMixed, true, false};
    }
    CoordinatesOf(box, rim(), q);
    const Interval p =
        IntervalOf(program_.surface_code(), program_.surface(), program_.surface_slot(), q);
    BoxState state = StateOf(p);
    if (state.none && !solid() && place_.half != 0) state.none = Abs(p).lo > ReachIn(box);
    return state;
  }
  // Returns a bound: no voxel in the box with a greater |P| is covered by |P| ≤ h·|∇P|. Requires: 0
  // < h.
  VOXELD_HD VOXELD_DEVICE_NOINLINE float ReachIn(const Box3& box) const {
    Interval q[3];
    CoordinatesOf(box, 0, q);
    Dual<Interval> dual[3];
    WithGradients(q, dual);
    const Dual<Interval> p = Surface(dual);
    const Interval reach = Mul(ConstantLike(p.value, place_.half), Slope(p));
    return reach.hi;
  }

 private:
  // Maps 0 to 1 onto steps; 1 itself belongs to the last step.
  VOXELD_HD static uint32_t Level(float value, float steps) {
    if (!(value > 0)) return 0;
    if (value >= 1) return 255;
    const float scaled = steps == 256 ? value * 256.0f : value * 255.0f + 0.5f;
    return static_cast<uint32_t>(scaled);
  }

  VOXELD_HD void CoordinatesOf(const Box3& box, int32_t rim, Interval q[3]) const {
    Interval d[3];
    for (int a = 0; a < 3; ++a) {
      d[a] = {solid_.Distance(a, int64_t{box.lo[a]} - rim),
              solid_.Distance(a, int64_t{box.hi[a]} - 1 + rim), false};
    }
    Coordinates(d[0], d[1], d[2], q);
  }

  VOXELD_HD VOXELD_DEVICE_NOINLINE Interval IntervalOf(const uint32_t* code, uint32_t count,
                                                       uint32_t slot, const Interval q[3]) const {
    Interval slots[kMostSlots];
    Run(code, count, q, place_.voxel, slots);
    return slots[slot];
  }

  VOXELD_HD bool IsInRings(const float q[3]) const {
    const uint32_t axis = program_.ring_axis(), across = axis == 2 ? 0 : axis + 1,
                   up = axis == 0 ? 2 : axis - 1;
    const float u = q[across], v = q[up];
    bool in = false;
    uint32_t begin = 0;
    for (uint32_t r = 0; r < program_.rings(); ++r) {
      const uint32_t end = program_.ring_ends()[r];
      for (uint32_t i = begin; i < end; ++i) {
        const float* const a = positions_ + size_t{i} * 3;
        const float* const b = positions_ + size_t{i + 1 < end ? i + 1 : begin} * 3;
        if ((a[up] > v) == (b[up] > v)) continue;
        const float at = a[across] + (v - a[up]) / (b[up] - a[up]) * (b[across] - a[across]);
        in ^= u < at;
      }
      begin = end;
    }
    return in;
  }

  const Solid& solid_;
  const ImplicitPlace& place_;
  const GeometryRecord& record_;
  const float* positions_;
  uint32_t tint_;
  ProgramView program_;
  HoistedView hoisted_;
};

}  // namespace voxeld::gpu::implicit
