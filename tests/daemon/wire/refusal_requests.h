// Valid requests of each kind, and the parts of them that tests make wrong.
#pragma once

#include <vector>

#include "tests/daemon/wire/requests.h"
#include "voxeld/v1/scene.pb.h"

namespace voxeld::daemon::wire {

inline v1::StreamRequest BoxRequest() {
  v1::StreamRequest request = UpsertRequest();
  v1::Box* box = PrimitiveOf(request)->mutable_box();
  for (v1::Vec3* size : {box->mutable_size()}) {
    size->set_x(1);
    size->set_y(2);
    size->set_z(3);
  }
  return request;
}

inline v1::StreamRequest SphereRequest() {
  v1::StreamRequest request = UpsertRequest();
  PrimitiveOf(request)->mutable_sphere()->set_radius(1);
  return request;
}

inline v1::StreamRequest CylinderRequest() {
  v1::StreamRequest request = UpsertRequest();
  PrimitiveOf(request)->mutable_cylinder()->set_radius(1);
  PrimitiveOf(request)->mutable_cylinder()->set_height(1);
  return request;
}

inline v1::StreamRequest LayerRequest() {
  v1::StreamRequest request;
  request.mutable_layer_state()->set_layer("layer");
  return request;
}

// Two planes, the second of which has only a b.
inline v1::StreamRequest ClipRequest() {
  v1::StreamRequest request = LayerRequest();
  request.mutable_layer_state()->mutable_clip()->add_planes()->set_a(1);
  request.mutable_layer_state()->mutable_clip()->add_planes()->set_b(1);
  return request;
}
inline v1::Clip::Plane* PlaneOf(v1::StreamRequest& request) {
  return request.mutable_layer_state()->mutable_clip()->mutable_planes(1);
}

// A region from (0, 0, 0) to (1, 1, 1).
inline v1::StreamRequest RegionRequest() {
  v1::StreamRequest request = LayerRequest();
  v1::Box3* region = request.mutable_layer_state()->mutable_region();
  region->mutable_min();
  region->mutable_max()->set_x(1);
  region->mutable_max()->set_y(1);
  region->mutable_max()->set_z(1);
  return request;
}
inline v1::Box3* RegionOf(v1::StreamRequest& request) {
  return request.mutable_layer_state()->mutable_region();
}

inline v1::StreamRequest DeleteRequest() {
  v1::StreamRequest request;
  request.mutable_delete_()->set_layer("layer");
  request.mutable_delete_()->set_id("id");
  return request;
}

inline v1::StreamRequest MoveRequest() {
  v1::StreamRequest request;
  request.mutable_set_transform()->set_layer("layer");
  request.mutable_set_transform()->set_id("id");
  return request;
}

inline v1::StreamRequest ObjectRequest() {
  v1::StreamRequest request;
  request.mutable_define_object()->set_object("object");
  for (int i = 0; i < 2; ++i) {
    request.mutable_define_object()
        ->mutable_definition()
        ->add_parts()
        ->mutable_primitive()
        ->mutable_sphere()
        ->set_radius(1);
  }
  return request;
}

inline v1::StreamRequest InstanceRequest() {
  v1::StreamRequest request = UpsertRequest();
  PrimitiveOf(request)->mutable_instance()->set_object("object");
  return request;
}

inline v1::Vertices* MeshVertices(v1::StreamRequest& request) {
  return PrimitiveOf(request)->mutable_mesh()->mutable_vertices();
}

inline void SetMatrix(v1::Affine* affine, std::vector<double> m) {
  affine->mutable_m()->Assign(m.begin(), m.end());
}

}  // namespace voxeld::daemon::wire
