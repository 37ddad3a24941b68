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

// For every call of every service, also those to come: a request that was received and parsed counts
// as a message, and authorises the connection where it was parsed by gRPC. A method that takes raw
// bytes, which are parsed only later, authorises it when it first answers: Stream by Opened.
// `guard` outlives the server.
std::unique_ptr<grpc::experimental::ServerInterceptorFactoryInterface> MakeCallWatch(
    listen::Guard& guard);

}  // namespace voxeld::daemon::services
