// Determines whether files can be played, and how voxelctl connects to the daemon.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "daemon/address/address.h"
#include "daemon/play/play_file.h"
#include "daemon/play/player.h"

namespace voxeld::daemon::play {

struct PlaySetup {
  // Destroy it after the player and after the server that listens in it.
  std::optional<PrivateFolder> folder;
  // An additional address for gRPC, in the folder. Nothing: the player uses an address that is
  // already served.
  std::optional<Address> listen;
  std::unique_ptr<Player> player;  // null: see why_not
  std::string why_not;             // a sentence
};

// `listen` lists the gRPC addresses. The daemon's own user has all scopes over a unix socket
// regardless of the grants (access.h), so the first unix socket is used. If there is none, a
// private one is created. The program is the voxelctl in the daemon's folder.
PlaySetup SetUpPlaying(const std::vector<Address>& listen);

}  // namespace voxeld::daemon::play
