// A display of emulated Fadecandy boards, and the volumes that a test sends it.
#pragma once

#include <memory>

#include "display/drivers/fadecandy/fadecandy_display.h"
#include "gtest/gtest.h"
#include "tests/display/drivers/fadecandy/fadecandy_rig.h"

namespace voxeld::display::fadecandy {

using emulator::Fault;
using sync::kMillisecond;
using sync::kSecond;
using Kind = VolumeOutcome::Kind;

class Fadecandy : public testing::Test {
 protected:
  void Make(size_t boards, FadecandyDisplay::Settings settings = FadecandyRig::Straight()) {
    rig_ = std::make_unique<FadecandyRig>(boards, settings);
    source_ = std::make_unique<FrameSource>(rig_->display().info().layout, 1);
  }
  void Start(size_t boards, FadecandyDisplay::Settings settings = FadecandyRig::Straight()) {
    Make(boards, settings);
    rig_->Start();
    ASSERT_TRUE(rig_->RunUntil([&] { return state() == DisplayState::kShowing; }))
        << rig_->display().state_reason();
  }
  DisplayState state() const { return rig_->display().state(); }
  const DisplayStats& stats() const { return rig_->display().stats(); }
  void Submit(double share = 1) {
    frame_ = source_->Next(share);
    rig_->display().Submit(frame_);
  }
  // Submits a volume and runs until it is presented and lit.
  void Show(double share = 1) {
    Submit(share);
    ASSERT_TRUE(rig_->RunUntilOutcome(frame_->volume));
    ASSERT_EQ(Newest().kind, Kind::kPresented) << Newest().reason;
    rig_->RunFor(2 * kRefresh);
    ASSERT_TRUE(rig_->Sees(*frame_));
  }
  const VolumeOutcome& Newest() const { return rig_->recorder().outcomes.back(); }
  void Break(size_t board, Fault::What what, uint64_t amount = 0) {
    rig_->faults(board).Add({.when = Fault::When::kTime, .at = 0, .what = what, .amount = amount});
  }

  std::unique_ptr<FadecandyRig> rig_;
  std::unique_ptr<FrameSource> source_;
  SliceFramePtr frame_;
};

}  // namespace voxeld::display::fadecandy
