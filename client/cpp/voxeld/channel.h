// Makes a gRPC channel as the client does, for callers that use the generated stubs directly.
#pragma once

#include <memory>
#include <string>

#include "absl/status/statusor.h"
#include "voxeld/credentials.h"

namespace grpc {
class Channel;
class ChannelArguments;
}  // namespace grpc

namespace voxeld::client {

// Makes a channel to `address`: HOST:PORT, tls:HOST:PORT or unix:PATH. Every call of the channel
// carries the token. Does not connect yet. Errors: InvalidArgument for an invalid address, or for a
// token that would be sent unencrypted; other errors are those of files.
absl::StatusOr<std::shared_ptr<grpc::Channel>> MakeChannel(const std::string& address,
                                                           const Credentials& credentials,
                                                           const grpc::ChannelArguments& arguments);

}  // namespace voxeld::client
