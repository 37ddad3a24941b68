// Who makes a call, and whether they may.
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

// The property of a connection's AuthContext that has its user's number, where it is a unix socket's.
inline constexpr char kUserProperty[] = "voxeld_user";

// A call's caller, if it may do what `scope` names. Else Unauthenticated (nobody in particular; a token
// would help), PermissionDenied (somebody who may not) or Unavailable, counted and, as often as the
// log's gate allows, logged. Every method of every service of the daemon begins with it.
absl::StatusOr<access::Caller> Authorise(ServiceContext& context,
                                         const grpc::CallbackServerContext& call,
                                         access::Scope scope, const char* method);

// Where the call came from, as listen::PeerName has it.
std::string PeerOf(const grpc::CallbackServerContext& call);

}  // namespace voxeld::daemon::services
