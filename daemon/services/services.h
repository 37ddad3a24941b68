// The services and their long calls, for the server that binds them.
// No gRPC header is needed to know them.
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

// Reactors that own themselves until gRPC is done with them.
// Requests are read before the call returns.
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
// `response` is gRPC's, which keeps it until the call has ended. There are assets (CheckAssets).
grpc::ServerReadReactor<v1::UploadAssetRequest>* NewUpload(ServiceContext& context,
                                                           access::Caller caller,
                                                           v1::UploadAssetResponse* response);

// FailedPrecondition: this server keeps none.
absl::Status CheckAssets(const ServiceContext& context);
absl::Status ListAssets(ServiceContext& context, const v1::ListAssetsRequest& request,
                        v1::ListAssetsResponse* response);

}  // namespace voxeld::daemon::services
