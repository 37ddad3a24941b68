// Identifies the caller of a call and checks its scopes.
#pragma once

#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "daemon/access/access.h"
#include "daemon/services/context.h"

namespace grpc {
class CallbackServerContext;
}

namespace voxeld::daemon::services {

// Property of an AuthContext with the user id of a unix socket's peer.
inline constexpr char kUserProperty[] = "voxeld_user";

// Returns: the caller if it has `scope`. Every method of the daemon's services calls this first.
// Errors: Unauthenticated (no identity; a token would help), PermissionDenied (the identity lacks
// the scope) or Unavailable. Errors are counted, and logged as often as the log gate allows.
absl::StatusOr<access::Caller> Authorise(ServiceContext& context,
                                         const grpc::CallbackServerContext& call,
                                         access::Scope scope, const char* method);

// Returns: the call's peer in the form of listen::PeerName.
std::string PeerOf(const grpc::CallbackServerContext& call);

}  // namespace voxeld::daemon::services
