// Declares the services and their streaming calls for the server, without gRPC headers.
#pragma once

#include <memory>

#include "daemon/services/context.h"

namespace grpc {
class ByteBuffer;
class Service;
template <class Request, class Response>
class ServerBidiReactor;
template <class Request>
class ServerReadReactor;
template <class Response>
class ServerWriteReactor;
}  // namespace grpc

namespace voxeld::v1 {
class CaptureVolumeRequest;
class ListAssetsRequest;
class ListAssetsResponse;
class Stats;
class UploadAssetRequest;
class UploadAssetResponse;
class VolumeChunk;
class WatchSceneRequest;
class WatchStatsRequest;
class WatchVolumeRequest;
}  // namespace voxeld::v1

namespace voxeld::daemon::services {

std::unique_ptr<grpc::Service> MakeSceneService(ServiceContext& context);
std::unique_ptr<grpc::Service> MakeDisplayService(ServiceContext& context);

// The reactors own themselves until gRPC has finished with them. Requests are read before the call
// returns.
grpc::ServerBidiReactor<grpc::ByteBuffer, grpc::ByteBuffer>* NewStream(ServiceContext& context,
                                                                       access::Caller caller);
grpc::ServerWriteReactor<grpc::ByteBuffer>* NewSceneWatch(ServiceContext& context,
                                                          access::Caller caller,
                                                          const v1::WatchSceneRequest& request);
grpc::ServerWriteReactor<v1::Stats>* NewStatsWatch(ServiceContext& context, access::Caller caller,
                                                   const v1::WatchStatsRequest& request);
grpc::ServerWriteReactor<v1::VolumeChunk>* NewCapture(ServiceContext& context,
                                                      access::Caller caller,
                                                      const v1::CaptureVolumeRequest& request);
grpc::ServerWriteReactor<v1::VolumeChunk>* NewVolumeWatch(ServiceContext& context,
                                                          access::Caller caller,
                                                          const v1::WatchVolumeRequest& request);
// gRPC owns `response` and keeps it until the call has ended. Requires: CheckAssets has returned
// OK.
grpc::ServerReadReactor<v1::UploadAssetRequest>* NewUpload(ServiceContext& context,
                                                           access::Caller caller,
                                                           v1::UploadAssetResponse* response);

// Errors: FailedPrecondition if this server stores no assets.
absl::Status CheckAssets(const ServiceContext& context);
absl::Status ListAssets(ServiceContext& context, const v1::ListAssetsRequest& request,
                        v1::ListAssetsResponse* response);

}  // namespace voxeld::daemon::services
