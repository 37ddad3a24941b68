#include "client/cpp/src/encode_parts.h"

#include <cstring>
#include <variant>

#include "client/cpp/src/wire.h"
#include "voxeld/v1/scene.pb.h"

namespace voxeld::client {

void AppendVec3(int field, const Vec3& vec, std::string* out) {
  std::string inner;
  AppendDouble(v1::Vec3::kXFieldNumber, vec.x, &inner);
  AppendDouble(v1::Vec3::kYFieldNumber, vec.y, &inner);
  AppendDouble(v1::Vec3::kZFieldNumber, vec.z, &inner);
  AppendPresentBytes(field, inner, out);
}

void AppendAffine(int field, const Affine& affine, std::string* out) {
  std::string packed, inner;
  packed.resize(sizeof affine.m);
  std::memcpy(packed.data(), affine.m.data(), sizeof affine.m);
  AppendPresentBytes(v1::Affine::kMFieldNumber, packed, &inner);
  AppendPresentBytes(field, inner, out);
}

namespace {

void AppendClipPart(const HalfSpace& half, std::string* out) {
  std::string plane;
  AppendDouble(v1::Clip::Plane::kAFieldNumber, half.a, &plane);
  AppendDouble(v1::Clip::Plane::kBFieldNumber, half.b, &plane);
  AppendDouble(v1::Clip::Plane::kCFieldNumber, half.c, &plane);
  AppendDouble(v1::Clip::Plane::kDFieldNumber, half.d, &plane);
  AppendPresentBytes(v1::Clip::kPlanesFieldNumber, plane, out);
}

void AppendClipPart(const ClipBox& in, std::string* out) {
  std::string box;
  AppendVec3(v1::Clip::Box::kCenterFieldNumber, in.center, &box);
  AppendVec3(v1::Clip::Box::kSizeFieldNumber, in.size, &box);
  AppendAffine(v1::Clip::Box::kTransformFieldNumber, in.transform, &box);
  AppendPresentBytes(v1::Clip::kBoxesFieldNumber, box, out);
}

void AppendClipPart(const ClipCylinder& in, std::string* out) {
  std::string cylinder;
  AppendVec3(v1::Clip::Cylinder::kStartFieldNumber, in.start, &cylinder);
  AppendVec3(v1::Clip::Cylinder::kEndFieldNumber, in.end, &cylinder);
  AppendDouble(v1::Clip::Cylinder::kRadiusFieldNumber, in.radius, &cylinder);
  AppendPresentBytes(v1::Clip::kCylindersFieldNumber, cylinder, out);
}

}  // namespace

void AppendClip(int field, const std::vector<ClipPart>& parts, std::string* out) {
  std::string inner;
  for (const ClipPart& part : parts) {
    std::visit([&](const auto& it) { AppendClipPart(it, &inner); }, part);
  }
  AppendPresentBytes(field, inner, out);
}

}  // namespace voxeld::client
