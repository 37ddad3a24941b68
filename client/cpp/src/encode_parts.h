// Messages that are fields of other messages.
#pragma once

#include <string>
#include <vector>

#include "voxeld/drawing.h"

namespace voxeld::client {

void AppendVec3(int field, const Vec3& vec, std::string* out);
void AppendAffine(int field, const Affine& affine, std::string* out);
void AppendClip(int field, const std::vector<ClipPart>& parts, std::string* out);

}  // namespace voxeld::client
