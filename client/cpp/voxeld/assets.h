// Uploads content to the server once; from then on any client can name it by its hash:
//
//   auto file = UploadAsset(png, {.address = "tls:wall:7390"});
//   layer.Put("globe", Mesh{…, .texture = Texture{.picture = *file, …}});
//
// An asset can replace any Array of a shape, except the scalars of a colour scale. The server keeps
// a limited number of bytes; it evicts the least recently used assets, and a request that names an
// evicted one gets an Issue (NotFound). Existing entities have a copy and stay.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <string_view>

#include "absl/status/statusor.h"
#include "voxeld/credentials.h"
#include "voxeld/drawing.h"

namespace voxeld::client {

struct UploadOptions {
  std::string address;                     // empty: DefaultAddress()
  std::optional<Credentials> credentials;  // nothing: DefaultCredentials()
  // How long to wait without progress while the server is unreachable, or busy with another upload
  // of the same content, before giving up. The wait for a server that is reachable but accepts
  // nothing is not limited.
  std::chrono::nanoseconds patience = std::chrono::seconds(15);
  // Called with the number of bytes sent after each piece, and now and then in between, on the
  // caller's thread. Return false to stop the upload (Cancelled); the server keeps what it has
  // received, and the next upload continues from there.
  std::function<bool(uint64_t sent, uint64_t size)> progress;
};

// Returns the asset of these bytes; sends nothing.
Asset AssetOf(std::string_view bytes);

// Uploads what the server does not have yet; an interrupted upload continues where it stopped.
// Blocks. Errors: Unavailable or DeadlineExceeded without a server; else the server's error, such
// as InvalidArgument (too large), ResourceExhausted (no room) or PermissionDenied.
absl::StatusOr<Asset> UploadAsset(std::string_view bytes, const UploadOptions& options = {});

}  // namespace voxeld::client
