// An example of every shape, for the gallery and docs/primitives.md.
#pragma once

#include <span>

namespace voxeld::voxelctl {

struct ShapeExample {
  const char* name;  // a label
  const char* text;  // input of draw, one shape per line
};

std::span<const ShapeExample> ShapeExamples();

}  // namespace voxeld::voxelctl
