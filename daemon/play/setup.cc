#include "daemon/play/setup.h"

#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <system_error>
#include <utility>

#include "absl/strings/str_cat.h"

namespace voxeld::daemon::play {

PlaySetup SetUpPlaying(const std::vector<Address>& listen) {
  PlaySetup setup;
  std::error_code error;
  const std::filesystem::path self = std::filesystem::read_symlink("/proc/self/exe", error);
  const std::string program = (self.parent_path() / "voxelctl").string();
  if (error || access(program.c_str(), X_OK) != 0) {
    setup.why_not = absl::StrCat("files are played by voxelctl, and there is none beside voxeld (",
                                 program, "): install it there");
    return setup;
  }
  const auto found = std::find_if(listen.begin(), listen.end(),
                                  [](const Address& address) { return address.unix_socket; });
  std::string server;
  if (found != listen.end()) {
    server = found->ToString();
  } else {
    absl::StatusOr<PrivateFolder> folder = PrivateFolder::Make();
    if (!folder.ok()) {
      setup.why_not = std::string(folder.status().message());
      return setup;
    }
    setup.folder = *std::move(folder);
    server = absl::StrCat("unix:", setup.folder->path(), "/voxeld.sock");
    const absl::StatusOr<Address> own = ParseAddress(server);
    if (!own.ok()) {
      setup.why_not = std::string(own.status().message());
      return setup;
    }
    setup.listen = *own;
  }
  absl::StatusOr<std::unique_ptr<Player>> player =
      Player::Make({.program = program, .server = server, .remove_left = true});
  if (!player.ok()) {
    setup.listen.reset();
    setup.why_not = std::string(player.status().message());
    return setup;
  }
  setup.player = *std::move(player);
  return setup;
}

}  // namespace voxeld::daemon::play
