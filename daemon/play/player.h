// Plays a file with `voxelctl play` in a separate process, because code that parses clients' files
// must not run in the daemon. It plays one file at a time; the next one replaces it. The content
// that a process displays is removed with its session.
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
  std::string server;   // the daemon's address, in the syntax of --server
  // Time between asking the process to exit and killing it. Its content is removed in either case.
  sync::TimeNs grace_ns = 500 * sync::kMillisecond;
  // First removes, on the player's thread, the files of daemons that were killed
  // (PrivateFolder::RemoveLeft).
  bool remove_left = false;
};

struct Playing {
  std::string name;    // of the file; empty: nothing is playing
  std::string failed;  // the last file that could not be played; empty: none since
  std::string why;     // a sentence of at most kLongestWhy bytes; may contain any text
  bool operator==(const Playing&) const = default;
};
inline constexpr size_t kLongestWhy = 600;

// Thread-safe. The process has its own process group and environment, and inherits no descriptor
// from the daemon. It ends with the player, and with the daemon in any case if setpriv(1) exists.
// It is the first to be killed if memory is short.
class Player {
 public:
  // Errors: ResourceExhausted if the system has no descriptor or thread left.
  static absl::StatusOr<std::unique_ptr<Player>> Make(PlayerOptions options);
  ~Player();
  Player(const Player&) = delete;
  Player& operator=(const Player&) = delete;

  // Stops the current file, then plays `file`. Does not block.
  void Play(PlayFile file);
  // Stops playing. Does not block.
  void Stop();
  // Stops playing for good. Blocks for at most grace_ns.
  void End();

  Playing state() const;
  // Sets the callback for state changes. It runs on the player's thread, or in the thread that
  // calls Play or Stop. After this function has returned for an empty callback, only a call that is
  // already running may still be active.
  void SetOnChange(std::function<void()> on_change);

 private:
  class Impl;
  explicit Player(std::unique_ptr<Impl> impl);
  const std::unique_ptr<Impl> impl_;
};

}  // namespace voxeld::daemon::play
