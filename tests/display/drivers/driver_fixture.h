// The voxlink driver and a source of frames for it.
#pragma once

#include <gtest/gtest.h>

#include <map>
#include <memory>
#include <string>

#include "display/api/pixels.h"
#include "tests/display/drivers/rig.h"

namespace voxeld::display {

class Driver : public testing::Test {
 protected:
  void Make(std::map<std::string, std::string> options = {}) {
    rig_ = std::make_unique<Rig>(std::move(options));
    source_ = std::make_unique<FrameSource>(rig_->display().info().layout, 1);
  }
  void Start(std::map<std::string, std::string> options = {}) {
    Make(std::move(options));
    rig_->Start();
    ASSERT_EQ(rig_->display().state(), DisplayState::kShowing) << rig_->display().state_reason();
  }
  // Submits a volume and runs until it is presented.
  void Show(double share = 1) {
    frame_ = source_->Next(share);
    rig_->display().Submit(frame_);
    ASSERT_TRUE(rig_->RunUntilOutcome(frame_->volume));
    const VolumeOutcome& outcome = *rig_->recorder().Of(frame_->volume);
    ASSERT_EQ(outcome.kind, VolumeOutcome::Kind::kPresented) << outcome.reason;
    ASSERT_TRUE(SeesFrame());
  }
  bool SeesFrame() const {
    const auto seen = rig_->device().Seen();
    return seen.has_value() && seen->Rgb() == FrameToRgb(*frame_);
  }
  const VolumeOutcome& Newest() const { return rig_->recorder().outcomes.back(); }

  std::unique_ptr<Rig> rig_;
  std::unique_ptr<FrameSource> source_;
  SliceFramePtr frame_;
};

}  // namespace voxeld::display
