// Converts the server's messages to the client's types.
#pragma once

#include "voxeld/client.h"
#include "voxeld/receipt.h"
#include "voxeld/v1/scene.pb.h"

namespace voxeld::client {

Stages FromWire(const v1::Stages& stages);
Issue FromWire(const v1::Issue& issue);
Outcome FromWire(const v1::Outcome& outcome);
ServerInfo FromWire(const v1::Opened& opened);

}  // namespace voxeld::client
