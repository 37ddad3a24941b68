// Records what is seen on one display, and which drawn volume that is. A slice image is identified
// by its bytes alone: the volume numbers of the driver and the device are not used.
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

using Look = uint64_t;  // a hash of all slice images of a volume: equal bytes, equal looks

Look LookOf(std::span<const std::byte> bytes);
Look LookOf(const std::vector<display::Picture>& pictures);

class Eye {
 public:
  struct Drawn {
    uint64_t volume = 0;
    uint64_t snapshot = 0, oldest_snapshot = 0;  // the newest and the oldest snapshot that it may
                                                 // show
    sync::TimeNs asked_ns = 0;
    std::optional<sync::TimeNs> drawn_ns;
    Look look = 0;  // set once it is drawn
    std::optional<sync::TimeNs>
        shown;  // the start of its sweep; only where no other volume looks the same
    bool pattern = false;
  };
  struct Shown {
    Look look = 0;
    sync::TimeNs at = 0;  // the start of its sweep
  };

  explicit Eye(Look black) : black_(black) {}

  void Asked(uint64_t volume, uint64_t snapshot, bool pattern, sync::TimeNs now);
  void Drew(uint64_t volume, Look look, uint64_t oldest_snapshot, uint64_t snapshot,
            sync::TimeNs now);
  // The device shows another picture. `may_go_back`: it may show again what it showed before, or
  // black.
  // Returns: what is wrong with that; empty: nothing.
  std::string Sees(Look look, sync::TimeNs now, bool may_go_back = false);

  const std::vector<Drawn>& drawn() const { return drawn_; }
  const Drawn* Find(uint64_t volume) const;
  // Returns whether a volume with this look was shown, after `since`, in a sweep that began within
  // `tolerance` of `at`.
  bool WasShown(Look look, sync::TimeNs at, sync::TimeNs tolerance, sync::TimeNs since) const;
  bool EverShown(Look look, sync::TimeNs since) const;
  // Nobody looked from `from` to `to`.
  void Blinked(sync::TimeNs from, sync::TimeNs to);
  std::optional<Look> newest() const;
  // Returns the oldest and the newest volume with this look; nullopt: no volume has it.
  std::optional<std::pair<uint64_t, uint64_t>> VolumesLike(Look look) const;
  Look black() const { return black_; }
  size_t shows() const { return shown_.size(); }

 private:
  const Look black_;
  std::vector<Drawn> drawn_;  // in ascending order of volume
  std::map<Look, std::vector<size_t>> by_look_;
  std::vector<Shown> shown_;
  std::vector<std::pair<sync::TimeNs, sync::TimeNs>> blinks_;
  uint64_t newest_shown_ = 0;  // the oldest volume that has the look of what is shown
};

}  // namespace voxeld::simulation
