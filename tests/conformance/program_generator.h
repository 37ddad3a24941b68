// Random programs of implicit shapes.
#pragma once

#include "tests/conformance/scene_generator.h"

namespace voxeld::gpu::conformance {

// Fills in the program and the rings of a shape of about `size`.
void AddProgram(SceneGenerator& random, int size, ModelGeometry& g);

}  // namespace voxeld::gpu::conformance
