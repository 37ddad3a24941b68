// What the dashboard shows, as lines; knows no terminal.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "voxeld/v1/display.pb.h"
#include "voxeld/v1/scene.pb.h"

namespace voxeld::voxelctl {

enum class TopStyle : uint8_t { kPlain, kTitle, kHeading, kChosen, kGood, kWarning, kBad, kFaint };

struct TopLine {
  std::string text;
  TopStyle style = TopStyle::kPlain;
};

// Stats and owners as they came last, with what changed since those before; which display is looked at. What the
// server chose is made fit for a terminal. Not thread-safe.
class TopView {
 public:
  // Left out while it is paused. `owners_trouble`: why there are none; empty: there are.
  void Take(const v1::Stats& stats, const v1::ListOwnersResponse& owners,
            const std::string& owners_trouble);
  // Why nothing comes, until something does.
  void Lose(const std::string& why);

  void TogglePause() { paused_ = !paused_; }
  // The display so many places on, round and round.
  void Choose(int step);
  // The display of that name, if there is one.
  void Choose(const std::string& name) { chosen_ = name; }

  // At most `height` lines of at most `width` columns; what has no room is left out from the end, and said.
  std::vector<TopLine> Lines(int width, int height) const;

 private:
  const v1::DisplayStats* Chosen() const;
  void AddServer(std::vector<TopLine>* out) const;
  void AddDisplays(std::vector<TopLine>* out) const;
  void AddStages(std::vector<TopLine>* out) const;
  void AddMemory(std::vector<TopLine>* out) const;
  void AddConnections(std::vector<TopLine>* out) const;
  void AddOwners(std::vector<TopLine>* out) const;
  // Since the stats before, a second.
  double Rate(uint64_t now, uint64_t before) const;

  v1::Stats stats_, before_;
  v1::ListOwnersResponse owners_;
  std::string owners_trouble_, lost_, chosen_;
  bool any_ = false, paused_ = false;
};

// The same for who cannot be shown a dashboard: displays, owners, a line of the rest.
std::string TopText(const v1::Stats& stats, const v1::ListOwnersResponse& owners);

}  // namespace voxeld::voxelctl
