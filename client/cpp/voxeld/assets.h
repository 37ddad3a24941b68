// Content that is brought to the server once, and named by its hash from then on, by anybody:
//
//   auto file = UploadAsset(png, {.address = "tls:wall:7390"});
//   layer.Put("globe", Mesh{…, .texture = Texture{.picture = *file, …}});
//
// Any Array of a shape may be one, but for the scalars of a colour scale. A server keeps so many bytes of
// them; what was used least recently goes, and whoever names it then gets an Issue (NotFound). What is up
// has a copy, and stays.
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
  // How long the server may be away, or busy with another upload of the same, without a byte more being
  // there, before it is given up. A server that is there and takes nothing is waited for.
  std::chrono::nanoseconds patience = std::chrono::seconds(15);
  // Called after each piece, and now and then while there is none, in the caller's thread: bytes that have
  // been sent. False ends the upload
  // (Cancelled); what came stays there, and the next upload goes on from it.
  std::function<bool(uint64_t sent, uint64_t size)> progress;
};

// The asset of those bytes; nothing is sent.
Asset AssetOf(std::string_view bytes);

// Brings what the server does not have of it. A call that breaks off goes on where it did. Blocks.
// Unavailable, DeadlineExceeded: no server; else what the server says, as
// InvalidArgument (too large), ResourceExhausted (no room), PermissionDenied.
absl::StatusOr<Asset> UploadAsset(std::string_view bytes, const UploadOptions& options = {});

}  // namespace voxeld::client
