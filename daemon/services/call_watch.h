// Reports the progress of calls to the connection guard.
#pragma once

#include <memory>

namespace grpc::experimental {
class ServerInterceptorFactoryInterface;
}

namespace voxeld::daemon::listen {
class Guard;
}

namespace voxeld::daemon::services {

// Watches every call of every service, including future ones. The first message of a call counts as
// one; its first answer authorises the connection if the service is the daemon's own. An answer is
// a message, or a status which shows that the request was understood: OK, NOT_FOUND,
// ALREADY_EXISTS, ABORTED, FAILED_PRECONDITION. Services without access control (health,
// reflection) authorise nobody. `guard` must outlive the server.
std::unique_ptr<grpc::experimental::ServerInterceptorFactoryInterface> MakeCallWatch(
    listen::Guard& guard);

}  // namespace voxeld::daemon::services
