// Random programs of implicit shapes.
#pragma once

#include "tests/conformance/scene_generator.h"

namespace voxeld::gpu::conformance {

// Fills in program and rings of a shape of about `size`.
void AddProgram(SceneGenerator& random, int size, ModelGeometry& g);

}  // namespace voxeld::gpu::conformance
