#include "daemon/scene/clip.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace voxeld::daemon {
namespace clip_test {

// Returns whether a point of the scene is in all parts of the record.
bool Has(const gpu::LayerRecord& record, const double (&p)[3]) {
  for (uint32_t i = 0; i < record.plane_count; ++i) {
    const gpu::ClipPlane& plane = record.planes[i];
    if (plane.a * p[0] + plane.b * p[1] + plane.c * p[2] + plane.d < 0) return false;
  }
  for (uint32_t i = 0; i < record.cylinder_count; ++i) {
    // unit · q = p by Cramer's rule.
    const gpu::Affine& unit = record.cylinders[i].unit;
    double square = 0;
    for (int column = 0; column < 2; ++column) {
      gpu::Affine replaced = unit;
      for (int row = 0; row < 3; ++row) {
        replaced.m[row * 4 + column] = p[row] - unit.m[row * 4 + 3];
      }
      const double q = gpu::Determinant(replaced) / gpu::Determinant(unit);
      square += q * q;
    }
    if (square > 1) return false;
  }
  return true;
}

class ClipTest : public testing::Test {
 protected:
  double Real(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random_);
  }

  std::mt19937_64 random_{2};
};

TEST_F(ClipTest, BoxesAreSixPlanesUnderTheirTransform) {
  Clip clip;
  clip.boxes_count = 1;
  ClipBox& box = clip.boxes[0];
  box = {{1, 0, -1}, {2, 4, 6}, {{0, -2, 0, 5, 1, 0, 0.5, -3, 0, 0, 3, 1}}};
  gpu::LayerRecord record;
  ASSERT_TRUE(PutClip(clip, record));
  EXPECT_EQ(record.plane_count, 6u);
  EXPECT_EQ(record.cylinder_count, 0u);
  int inside = 0;
  for (int i = 0; i < 10'000; ++i) {
    double q[3], p[3];  // in the box's coordinates, and in the scene's
    bool is_in = true;
    for (int a = 0; a < 3; ++a) {
      q[a] = box.center[a] + Real(-0.8, 0.8) * box.size[a];
      is_in = is_in && std::fabs(q[a] - box.center[a]) <= box.size[a] / 2;
    }
    const double* m = box.transform.m;
    for (int r = 0; r < 3; ++r) {
      p[r] = m[r * 4] * q[0] + m[r * 4 + 1] * q[1] + m[r * 4 + 2] * q[2] + m[r * 4 + 3];
    }
    EXPECT_EQ(Has(record, p), is_in);
    inside += is_in ? 1 : 0;
  }
  EXPECT_GT(inside, 1000);
}

TEST_F(ClipTest, CylindersGoFromPointToPoint) {
  for (int turn = 0; turn < 20; ++turn) {
    Clip clip;
    clip.cylinders_count = 1;
    ClipCylinder& cylinder = clip.cylinders[0];
    for (int a = 0; a < 3; ++a) {
      cylinder.start[a] = Real(-2, 2);
      cylinder.end[a] = turn < 6 && a != turn % 3 ? cylinder.start[a] : Real(3, 5);
    }
    cylinder.radius = Real(0.5, 2);
    gpu::LayerRecord record;
    ASSERT_TRUE(PutClip(clip, record));
    EXPECT_EQ(record.plane_count, 2u);
    EXPECT_EQ(record.cylinder_count, 1u);
    int inside = 0;
    for (int i = 0; i < 5000; ++i) {
      double p[3], along = 0, length = 0, beside = 0;
      for (int a = 0; a < 3; ++a) {
        p[a] = Real(-4, 7);
        const double d = cylinder.end[a] - cylinder.start[a];
        along += (p[a] - cylinder.start[a]) * d;
        length += d * d;
      }
      for (int a = 0; a < 3; ++a) {
        const double foot =
            cylinder.start[a] + along / length * (cylinder.end[a] - cylinder.start[a]);
        beside += (p[a] - foot) * (p[a] - foot);
      }
      const bool is_in =
          along >= 0 && along <= length && beside <= cylinder.radius * cylinder.radius;
      EXPECT_EQ(Has(record, p), is_in) << turn;
      inside += is_in ? 1 : 0;
    }
    EXPECT_GT(inside, 1) << turn;
  }
}

TEST_F(ClipTest, WhatHasNoInsideIsNotSound) {
  gpu::LayerRecord record;
  Clip flat;
  flat.boxes_count = 1;
  flat.boxes[0] = {{0, 0, 0}, {1, 1, 1}, {{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0}}};
  EXPECT_FALSE(PutClip(flat, record));
  Clip far;
  far.cylinders_count = 1;
  far.cylinders[0] = {{0, 0, 0}, {1e200, 0, 0}, 1e200};
  EXPECT_FALSE(PutClip(far, record));
  EXPECT_TRUE(PutClip({}, record));
  EXPECT_EQ(record.plane_count + record.cylinder_count, 0u);
}

}  // namespace clip_test
}  // namespace voxeld::daemon
