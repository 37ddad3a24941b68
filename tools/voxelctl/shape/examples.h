// An example of every shape: what the gallery shows, and docs/primitives.md.
#pragma once

#include <span>

namespace voxeld::voxelctl {

struct ShapeExample {
  const char* name;  // a label
  const char* text;  // what draw takes, one beneath another
};

std::span<const ShapeExample> ShapeExamples();

}  // namespace voxeld::voxelctl
