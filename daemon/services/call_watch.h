// Tells the guard of connections what their calls come to.
#pragma once

#include <memory>

namespace grpc::experimental {
class ServerInterceptorFactoryInterface;
}

namespace voxeld::daemon::listen {
class Guard;
}

namespace voxeld::daemon::services {

// For every call of every service, also those to come: its first message counts as one; its first
// answer authorises the connection if the service is the daemon's own. An answer is a message, or a
// status that says that the request was understood: OK, NOT_FOUND, ALREADY_EXISTS, ABORTED,
// FAILED_PRECONDITION. What anybody may ask (health, reflection) authorises nobody.
// `guard` outlives the server.
std::unique_ptr<grpc::experimental::ServerInterceptorFactoryInterface> MakeCallWatch(
    listen::Guard& guard);

}  // namespace voxeld::daemon::services
