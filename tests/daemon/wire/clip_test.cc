// Tests clips of boxes and cylinders that are refused, with the field and the accepted values.
#include "daemon/wire/clip.h"

#include <gmock/gmock.h>

#include <cmath>
#include <string>

#include "voxeld/v1/scene.pb.h"

namespace voxeld::daemon::wire {
namespace {

using ::testing::HasSubstr;

class ClipTest : public ::testing::Test {
 protected:
  // Returns "FIELD: MESSAGE", or an empty text if the clip is accepted.
  std::string FaultOf(const v1::Clip& message, const Limits& limits = {}) {
    Clip clip;
    const MaybeFault fault = ToClip(FieldPath("clip"), message, limits, &clip);
    return fault ? fault->field + ": " + fault->message : "";
  }
  static v1::Clip::Box* AddBox(v1::Clip& clip) {
    v1::Clip::Box* box = clip.add_boxes();
    box->mutable_size()->set_x(1);
    box->mutable_size()->set_y(2);
    box->mutable_size()->set_z(3);
    return box;
  }
  static v1::Clip::Cylinder* AddCylinder(v1::Clip& clip) {
    v1::Clip::Cylinder* cylinder = clip.add_cylinders();
    cylinder->mutable_end()->set_z(1);
    cylinder->set_radius(0.5);
    return cylinder;
  }
};

TEST_F(ClipTest, AsManyAsThereIsRoomForAreTaken) {
  v1::Clip clip;
  for (int i = 0; i < 3; ++i) AddBox(clip);
  AddCylinder(clip);
  EXPECT_EQ(FaultOf(clip), "");
  AddCylinder(clip);
  EXPECT_EQ(FaultOf(clip),
            "clip.planes: has 22 planes with those of boxes and cylinders; max_clip_planes allows "
            "20");
  clip.clear_boxes();
  for (int i = 2; i < 4; ++i) AddCylinder(clip);
  EXPECT_EQ(FaultOf(clip), "");
  AddCylinder(clip);
  EXPECT_EQ(FaultOf(clip), "clip.cylinders: has 5 cylinders; max_clip_cylinders allows 4");
  clip.clear_cylinders();
  AddBox(clip);
  EXPECT_EQ(FaultOf(clip, {.max_clip_planes = 6}), "");
  EXPECT_THAT(FaultOf(clip, {.max_clip_planes = 5}), HasSubstr("allows 5"));
}

TEST_F(ClipTest, BoxesHaveSizesAndAnInside) {
  v1::Clip clip;
  v1::Clip::Box* box = AddBox(clip);
  box->mutable_size()->set_y(0);
  EXPECT_EQ(FaultOf(clip),
            "clip.boxes[0].size: has an edge of 0; all three must be greater than 0");
  box->mutable_size()->set_y(INFINITY);
  EXPECT_THAT(FaultOf(clip), HasSubstr("clip.boxes[0].size.y: is infinity"));
  box->mutable_size()->set_y(1);
  box->mutable_center()->set_x(NAN);
  EXPECT_THAT(FaultOf(clip), HasSubstr("clip.boxes[0].center.x: is NaN"));
  box->clear_center();
  for (int i = 0; i < 12; ++i) box->mutable_transform()->add_m(i == 0 || i == 5 ? 1 : 0);
  EXPECT_THAT(FaultOf(clip), HasSubstr("clip.boxes[0].transform.m: has a singular linear part"));
}

TEST_F(ClipTest, CylindersHaveALengthAndARadius) {
  v1::Clip clip;
  v1::Clip::Cylinder* cylinder = AddCylinder(clip);
  cylinder->set_radius(0);
  EXPECT_EQ(FaultOf(clip), "clip.cylinders[0].radius: is 0; give a number greater than 0");
  cylinder->set_radius(-1);
  EXPECT_THAT(FaultOf(clip), HasSubstr("radius: is -1"));
  cylinder->set_radius(1);
  cylinder->set_radius(1e-200);
  EXPECT_THAT(FaultOf(clip), HasSubstr("too small, too large or too far away"));
  cylinder->set_radius(1);
  cylinder->mutable_start()->set_z(1);
  EXPECT_EQ(FaultOf(clip), "clip.cylinders[0].end: is where start is; the two must be apart");
  cylinder->mutable_start()->set_z(NAN);
  EXPECT_THAT(FaultOf(clip), HasSubstr("clip.cylinders[0].start.z: is NaN"));
}

}  // namespace
}  // namespace voxeld::daemon::wire
