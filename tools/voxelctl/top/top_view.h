// The contents of the dashboard as lines; independent of the terminal.
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

// The latest stats and owners, with what changed since the previous ones, and which display is
// selected. Text from the server is escaped for a terminal. Not thread-safe.
class TopView {
 public:
  // Ignored while it is paused. `owners_trouble` is why owners are missing; empty: they are not.
  void Take(const v1::Stats& stats, const v1::ListOwnersResponse& owners,
            const std::string& owners_trouble);
  // Sets why no data come, until some do.
  void Lose(const std::string& why);

  void TogglePause() { paused_ = !paused_; }
  // Selects the display `step` places on, cyclically.
  void Choose(int step);
  // Selects the display of that name, if there is one.
  void Choose(const std::string& name) { chosen_ = name; }

  // Returns at most `height` lines of at most `width` columns; rows that do not fit are left out
  // from the end, which is stated.
  std::vector<TopLine> Lines(int width, int height) const;

 private:
  const v1::DisplayStats* Chosen() const;
  void AddServer(std::vector<TopLine>* out) const;
  void AddDisplays(std::vector<TopLine>* out) const;
  void AddStages(std::vector<TopLine>* out) const;
  void AddMemory(std::vector<TopLine>* out) const;
  void AddConnections(std::vector<TopLine>* out) const;
  void AddOwners(std::vector<TopLine>* out) const;
  // Returns the rate per second since the previous stats.
  double Rate(uint64_t now, uint64_t before) const;

  v1::Stats stats_, before_;
  v1::ListOwnersResponse owners_;
  std::string owners_trouble_, lost_, chosen_;
  bool any_ = false, paused_ = false;
};

// Returns the same for output without a dashboard: displays, owners, a line of the rest.
std::string TopText(const v1::Stats& stats, const v1::ListOwnersResponse& owners);

}  // namespace voxeld::voxelctl
