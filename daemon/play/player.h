// Plays a file by `voxelctl play`, in a process of its own: whatever reads files of others is not in the daemon. One at a time;
// the next one takes the place of the last, and what a process has up goes with its session.
#pragma once

#include <functional>
#include <memory>
#include <string>

#include "absl/status/statusor.h"
#include "daemon/play/play_file.h"
#include "display/sync/clock.h"

namespace voxeld::daemon::play {

struct PlayerOptions {
  std::string program;  // voxelctl's path
  std::string server;   // where it finds the daemon, as --server has it
  // From being asked to end to being killed. What it has up goes either way.
  sync::TimeNs grace_ns = 500 * sync::kMillisecond;
  // Before all else, on its thread: removes what players of daemons that were killed have left (PrivateFolder::RemoveLeft).
  bool remove_left = false;
};

struct Playing {
  std::string name;    // of the file; empty: nothing plays
  std::string failed;  // of the file that could not be played last; empty: none since
  std::string why;     // a sentence, at most kLongestWhy bytes; anything may be in it
  bool operator==(const Playing&) const = default;
};
inline constexpr size_t kLongestWhy = 600;

// Thread-safe. The process has a process group and an environment of its own, and no descriptor of the daemon's; it ends with
// the player, and where there is setpriv(1) also with the daemon, however that ends. When memory is short it goes first.
class Player {
 public:
  // ResourceExhausted if the system has no descriptor or no thread for it.
  static absl::StatusOr<std::unique_ptr<Player>> Make(PlayerOptions options);
  ~Player();
  Player(const Player&) = delete;
  Player& operator=(const Player&) = delete;

  // Ends what plays, then plays `file`. Does not wait.
  void Play(PlayFile file);
  // Does not wait.
  void Stop();
  // Ends what plays, for good: nothing is played any more. Waits, grace_ns at the most.
  void End();

  Playing state() const;
  // Called on the player's thread, or on that which calls Play or Stop, when the state is another. Not once this has returned
  // with nothing, but for a call that is under way.
  void SetOnChange(std::function<void()> on_change);

 private:
  class Impl;
  explicit Player(std::unique_ptr<Impl> impl);
  const std::unique_ptr<Impl> impl_;
};

}  // namespace voxeld::daemon::play
