// The memory channel over the daemon's local socket (voxeld/v1/local.proto).
#pragma once

#include <memory>
#include <string>

#include "client/cpp/src/memory_channel.h"

namespace voxeld::client {

// Takes Opened.local_socket and local_token. Connects on its own thread; any failure there, and an
// answer that does not come within 2 s, is reported as Answer::kGone. `events` must outlive it.
std::unique_ptr<MemoryChannel> ConnectLocalSocket(std::string path, std::string token,
                                                  MemoryChannel::Events* events);

}  // namespace voxeld::client
