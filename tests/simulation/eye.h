// What an eye sees of one display, and which drawn volume that is. A picture is known by its bytes alone: what the
// driver and the device call a volume is not asked.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "display/api/display.h"
#include "display/sync/clock.h"

namespace voxeld::simulation {

using Look = uint64_t;  // of all pictures of a volume: equal bytes, equal looks

Look LookOf(std::span<const std::byte> bytes);
Look LookOf(const std::vector<display::Picture>& pictures);

class Eye {
 public:
  struct Drawn {
    uint64_t volume = 0;
    uint64_t snapshot = 0, oldest_snapshot = 0;  // the newest, and the oldest, that it may be of
    sync::TimeNs asked_ns = 0;
    std::optional<sync::TimeNs> drawn_ns;
    Look look = 0;  // once drawn
    std::optional<sync::TimeNs>
        shown;  // at its sweep's start; where no other volume looks the same
    bool pattern = false;
  };
  struct Shown {
    Look look = 0;
    sync::TimeNs at = 0;  // its sweep's start
  };

  explicit Eye(Look black) : black_(black) {}

  void Asked(uint64_t volume, uint64_t snapshot, bool pattern, sync::TimeNs now);
  void Drew(uint64_t volume, Look look, uint64_t oldest_snapshot, uint64_t snapshot,
            sync::TimeNs now);
  // The device shows another picture. What is wrong with that; empty: nothing.
  // `may_go_back`: to what it showed before, or to black.
  std::string Sees(Look look, sync::TimeNs now, bool may_go_back = false);

  const std::vector<Drawn>& drawn() const { return drawn_; }
  const Drawn* Find(uint64_t volume) const;
  // Whether something that looks so was shown in a sweep that began then, or as near as `tolerance`, after `since`.
  bool WasShown(Look look, sync::TimeNs at, sync::TimeNs tolerance, sync::TimeNs since) const;
  bool EverShown(Look look, sync::TimeNs since) const;
  // From then to then nobody looked.
  void Blinked(sync::TimeNs from, sync::TimeNs to);
  std::optional<Look> newest() const;
  // The oldest and the newest volume that look so; nothing: none does.
  std::optional<std::pair<uint64_t, uint64_t>> VolumesLike(Look look) const;
  Look black() const { return black_; }
  size_t shows() const { return shown_.size(); }

 private:
  const Look black_;
  std::vector<Drawn> drawn_;  // volumes ascend
  std::map<Look, std::vector<size_t>> by_look_;
  std::vector<Shown> shown_;
  std::vector<std::pair<sync::TimeNs, sync::TimeNs>> blinks_;
  uint64_t newest_shown_ = 0;  // a volume that looks like what is shown: the oldest that it may be
};

}  // namespace voxeld::simulation
