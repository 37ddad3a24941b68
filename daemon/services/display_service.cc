// DisplayService: every method one line over what it does.
#include <grpcpp/support/server_callback.h>

#include <memory>
#include <utility>
#include <vector>

#include "daemon/services/services.h"
#include "daemon/services/status.h"
#include "daemon/services/unary_call.h"
#include "daemon/wire/convert.h"
#include "daemon/wire/encode.h"
#include "voxeld/v1/display.grpc.pb.h"

namespace voxeld::daemon::services {
namespace {

using grpc::CallbackServerContext;
using grpc::ServerUnaryReactor;

class RefusedWatch final : public grpc::ServerWriteReactor<v1::VolumeChunk> {
 public:
  RefusedWatch() {
    Finish(ToGrpc(absl::UnimplementedError(
        "WatchVolume is not implemented in this version of the server: use CaptureVolume")));
  }
  void OnDone() override { delete this; }
};

Core::Reply<DisplayDescription> Answer(std::shared_ptr<UnaryCall> call,
                                       v1::DisplayDescription* response) {
  return [call = std::move(call), response](const absl::StatusOr<DisplayDescription>& result) {
    call->Answer(result.status(), [&] {
      if (result.ok()) wire::Encode(*result, response);
    });
  };
}

class DisplayService final : public v1::DisplayService::CallbackService {
 public:
  explicit DisplayService(ServiceContext& context) : context_(context) {}

  ServerUnaryReactor* ListDisplays(CallbackServerContext* call, const v1::ListDisplaysRequest*,
                                   v1::ListDisplaysResponse* response) override {
    return DoListDisplays(call->DefaultReactor(), response);
  }

  ServerUnaryReactor* GetDisplay(CallbackServerContext* call, const v1::GetDisplayRequest* request,
                                 v1::DisplayDescription* response) override {
    return DoGetDisplay(call->DefaultReactor(), *request, response);
  }

  ServerUnaryReactor* UpdateDisplay(CallbackServerContext* call,
                                    const v1::UpdateDisplayRequest* request,
                                    v1::DisplayDescription* response) override {
    return DoUpdateDisplay(call->DefaultReactor(), *request, response);
  }

  grpc::ServerWriteReactor<v1::Stats>* WatchStats(CallbackServerContext*,
                                                  const v1::WatchStatsRequest* request) override {
    return NewStatsWatch(context_, *request);
  }

  grpc::ServerWriteReactor<v1::VolumeChunk>* WatchVolume(CallbackServerContext*,
                                                         const v1::WatchVolumeRequest*) override {
    return new RefusedWatch;
  }

  grpc::ServerWriteReactor<v1::VolumeChunk>* CaptureVolume(
      CallbackServerContext*, const v1::CaptureVolumeRequest* request) override {
    return NewCapture(context_, *request);
  }

 private:
  ServerUnaryReactor* DoListDisplays(ServerUnaryReactor* reactor,
                                     v1::ListDisplaysResponse* response) {
    context_.core.ListDisplays(
        [call = UnaryCall::Begin(context_.short_calls, reactor),
         response](const absl::StatusOr<std::vector<DisplayDescription>>& displays) {
          call->Answer(displays.status(), [&] {
            if (!displays.ok()) return;
            for (const DisplayDescription& display : *displays) {
              wire::Encode(display, response->add_displays());
            }
          });
        });
    return reactor;
  }

  ServerUnaryReactor* DoGetDisplay(ServerUnaryReactor* reactor,
                                   const v1::GetDisplayRequest& request,
                                   v1::DisplayDescription* response) {
    context_.core.GetDisplay(request.name(),
                             Answer(UnaryCall::Begin(context_.short_calls, reactor), response));
    return reactor;
  }

  ServerUnaryReactor* DoUpdateDisplay(ServerUnaryReactor* reactor,
                                      const v1::UpdateDisplayRequest& request,
                                      v1::DisplayDescription* response) {
    absl::StatusOr<DisplayUpdate> update = wire::FromWire(request);
    if (!update.ok()) {
      reactor->Finish(ToGrpc(update.status()));
      return reactor;
    }
    context_.core.UpdateDisplay(request.name(), *std::move(update),
                                Answer(UnaryCall::Begin(context_.short_calls, reactor), response));
    return reactor;
  }

  ServiceContext& context_;
};

}  // namespace

std::unique_ptr<grpc::Service> MakeDisplayService(ServiceContext& context) {
  return std::make_unique<DisplayService>(context);
}

}  // namespace voxeld::daemon::services
