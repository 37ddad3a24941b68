#include "daemon/scene/clip.h"

#include <cmath>

namespace voxeld::daemon {
namespace {

bool IsSound(const gpu::ClipPlane& p) {
  return std::isfinite(p.a) && std::isfinite(p.b) && std::isfinite(p.c) && std::isfinite(p.d) &&
         (p.a != 0 || p.b != 0 || p.c != 0);
}

// Adds the half-space n · p ≥ `least`.
bool AddPlane(const double n[3], double least, gpu::LayerRecord& record) {
  gpu::ClipPlane& plane = record.planes[record.plane_count++];
  plane = {n[0], n[1], n[2], -least};
  return IsSound(plane);
}

// Adds the slab `least` ≤ n · p ≤ `most`.
bool AddSlab(const double n[3], double least, double most, gpu::LayerRecord& record) {
  const double opposite[3] = {-n[0], -n[1], -n[2]};
  return AddPlane(n, least, record) && AddPlane(opposite, -most, record);
}

bool AddBox(const ClipBox& box, gpu::LayerRecord& record) {
  const double* const m = box.transform.m;
  const double determinant = gpu::Determinant(box.transform);
  bool is_sound = std::isnormal(determinant);
  for (int a = 0; a < 3; ++a) {
    // The box coordinate a of a scene point p is n · p − shift.
    double n[3], shift = 0;
    for (int c = 0; c < 3; ++c) {
      n[c] = gpu::Cofactor(box.transform, c, a) / determinant;
      shift += n[c] * m[c * 4 + 3];
    }
    const double middle = shift + box.center[a];
    is_sound = AddSlab(n, middle - box.size[a] / 2, middle + box.size[a] / 2, record) && is_sound;
  }
  return is_sound;
}

double Dot(const double a[3], const double b[3]) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

void Cross(const double a[3], const double b[3], double out[3]) {
  for (int i = 0; i < 3; ++i) {
    const int j = (i + 1) % 3, k = (i + 2) % 3;
    out[i] = a[j] * b[k] - a[k] * b[j];
  }
}

void SetLength(double length, double v[3]) {
  const double by = length / std::hypot(v[0], v[1], v[2]);
  for (int a = 0; a < 3; ++a) v[a] *= by;
}

bool AddCylinder(const ClipCylinder& cylinder, gpu::LayerRecord& record) {
  double axis[3], beside[3] = {}, across[2][3];
  for (int a = 0; a < 3; ++a) axis[a] = cylinder.end[a] - cylinder.start[a];
  SetLength(1, axis);
  // Picks the scene axis that is farthest from parallel to the cylinder.
  int farthest = 0;
  for (int a = 1; a < 3; ++a) {
    if (std::fabs(axis[a]) < std::fabs(axis[farthest])) farthest = a;
  }
  beside[farthest] = 1;
  Cross(axis, beside, across[0]);
  SetLength(cylinder.radius, across[0]);
  Cross(axis, across[0], across[1]);
  double* const m = record.cylinders[record.cylinder_count++].unit.m;
  for (int a = 0; a < 3; ++a) {
    const double row[4] = {across[0][a], across[1][a], axis[a], cylinder.start[a]};
    std::copy_n(row, 4, m + a * 4);
  }
  // If a value is not finite, the determinant is not a normal number.
  const bool is_sound =
      std::isnormal(gpu::Determinant(record.cylinders[record.cylinder_count - 1].unit));
  return AddSlab(axis, Dot(axis, cylinder.start), Dot(axis, cylinder.end), record) && is_sound;
}

}  // namespace

bool PutClip(const Clip& clip, gpu::LayerRecord& record) {
  record.plane_count = clip.count;
  record.cylinder_count = 0;
  std::copy_n(clip.planes, clip.count, record.planes);
  bool is_sound = std::all_of(clip.planes, clip.planes + clip.count, IsSound);
  for (uint32_t i = 0; i < clip.boxes_count; ++i) {
    is_sound = AddBox(clip.boxes[i], record) && is_sound;
  }
  for (uint32_t i = 0; i < clip.cylinders_count; ++i) {
    is_sound = AddCylinder(clip.cylinders[i], record) && is_sound;
  }
  return is_sound;
}

}  // namespace voxeld::daemon
