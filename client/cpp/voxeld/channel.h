// A gRPC channel as the client makes its own, for calls of one's own over the generated stubs.
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

// `address`: HOST:PORT, tls:HOST:PORT or unix:PATH. Every call of the channel carries the token. Does not
// connect yet. InvalidArgument for an address that is none or a token that would be readable on its way;
// other errors are those of files.
absl::StatusOr<std::shared_ptr<grpc::Channel>> MakeChannel(const std::string& address,
                                                           const Credentials& credentials,
                                                           const grpc::ChannelArguments& arguments);

}  // namespace voxeld::client
