// The transport over gRPC.
#pragma once

#include <memory>
#include <string>

#include "client/cpp/src/transport.h"

namespace voxeld::client {

// `target` as gRPC writes it (voxeld/address.h).
std::unique_ptr<Transport> MakeGrpcTransport(std::string target);

}  // namespace voxeld::client
