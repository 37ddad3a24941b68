// The drawing that was requested of an engine, in the terms of the plain scene.
#pragma once

#include "tests/daemon/core/model/plain_scene.h"
#include "tests/daemon/fakes/recording_engine.h"

namespace voxeld::daemon::model {

PlainScene::Picture PictureOf(const testing::SceneModel& scene);

}  // namespace voxeld::daemon::model
