// Whether files can be played here, and how voxelctl comes to the daemon.
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
  // Goes after the player, and after whoever listens in it.
  std::optional<PrivateFolder> folder;
  // To be listened on for gRPC beside the others, in the folder; nothing: it is among those that are already.
  std::optional<Address> listen;
  std::unique_ptr<Player> player;  // none: see why_not
  std::string why_not;             // a sentence
};

// `listen`: where gRPC is to be served. The daemon's own user may do everything over a unix socket, whatever its grants are
// (access.h), so the first one of these is taken; where there is none one is made that nobody else can reach. The program is
// the voxelctl beside this one.
PlaySetup SetUpPlaying(const std::vector<Address>& listen);

}  // namespace voxeld::daemon::play
