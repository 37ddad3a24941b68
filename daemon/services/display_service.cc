// Implements the methods of DisplayService; each one delegates.
#include <grpcpp/support/server_callback.h>

#include <memory>
#include <utility>
#include <vector>

#include "daemon/services/audited.h"
#include "daemon/services/caller.h"
#include "daemon/services/services.h"
#include "daemon/services/status.h"
#include "daemon/services/unary_call.h"
#include "daemon/wire/convert.h"
#include "daemon/wire/encode.h"
#include "voxeld/v1/display.grpc.pb.h"

namespace voxeld::daemon::services {
namespace {

using access::Scope;
using grpc::CallbackServerContext;
using grpc::ServerUnaryReactor;

template <typename Response>
class RefusedWatch final : public grpc::ServerWriteReactor<Response> {
 public:
  explicit RefusedWatch(const absl::Status& status) { this->Finish(ToGrpc(status)); }
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
    if (absl::Status status = May(call, "ListDisplays"); !status.ok()) return Refuse(call, status);
    return DoListDisplays(call->DefaultReactor(), response);
  }

  ServerUnaryReactor* GetDisplay(CallbackServerContext* call, const v1::GetDisplayRequest* request,
                                 v1::DisplayDescription* response) override {
    if (absl::Status status = May(call, "GetDisplay"); !status.ok()) return Refuse(call, status);
    return DoGetDisplay(call->DefaultReactor(), *request, response);
  }

  ServerUnaryReactor* UpdateDisplay(CallbackServerContext* call,
                                    const v1::UpdateDisplayRequest* request,
                                    v1::DisplayDescription* response) override {
    Audited audited(context_, *call, "UpdateDisplay", *request);
    const absl::StatusOr<access::Caller> caller =
        Authorise(context_, *call, Scope::kControl, "UpdateDisplay");
    if (!caller.ok()) return Refuse(call, audited.Done(caller.status()));
    audited.By(*caller);
    if (absl::Status may = audited.MayAct(); !may.ok()) return Refuse(call, audited.Done(may));
    return DoUpdateDisplay(call->DefaultReactor(), audited, *request, response);
  }

  grpc::ServerWriteReactor<v1::Stats>* WatchStats(CallbackServerContext* call,
                                                  const v1::WatchStatsRequest* request) override {
    absl::StatusOr<access::Caller> caller = Authorise(context_, *call, Scope::kView, "WatchStats");
    if (!caller.ok()) return new RefusedWatch<v1::Stats>(caller.status());
    return NewStatsWatch(context_, *std::move(caller), *request);
  }

  grpc::ServerWriteReactor<v1::VolumeChunk>* WatchVolume(
      CallbackServerContext* call, const v1::WatchVolumeRequest* request) override {
    absl::StatusOr<access::Caller> caller = Authorise(context_, *call, Scope::kView, "WatchVolume");
    if (!caller.ok()) return new RefusedWatch<v1::VolumeChunk>(caller.status());
    return NewVolumeWatch(context_, *std::move(caller), *request);
  }

  grpc::ServerWriteReactor<v1::VolumeChunk>* CaptureVolume(
      CallbackServerContext* call, const v1::CaptureVolumeRequest* request) override {
    absl::StatusOr<access::Caller> caller =
        Authorise(context_, *call, Scope::kView, "CaptureVolume");
    if (!caller.ok()) return new RefusedWatch<v1::VolumeChunk>(caller.status());
    return NewCapture(context_, *std::move(caller), *request);
  }

 private:
  static ServerUnaryReactor* Refuse(CallbackServerContext* call, const absl::Status& status) {
    ServerUnaryReactor* reactor = call->DefaultReactor();
    reactor->Finish(ToGrpc(status));
    return reactor;
  }

  // Checks whether the caller has the scope view.
  absl::Status May(CallbackServerContext* call, const char* method) {
    return Authorise(context_, *call, Scope::kView, method).status();
  }

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

  ServerUnaryReactor* DoUpdateDisplay(ServerUnaryReactor* reactor, const Audited& audited,
                                      const v1::UpdateDisplayRequest& request,
                                      v1::DisplayDescription* response) {
    absl::StatusOr<DisplayUpdate> update = wire::FromWire(request);
    if (!update.ok()) {
      reactor->Finish(ToGrpc(audited.Done(update.status())));
      return reactor;
    }
    context_.core.UpdateDisplay(
        request.name(), *std::move(update),
        audited.Watching(Answer(UnaryCall::Begin(context_.short_calls, reactor), response)));
    return reactor;
  }

  ServiceContext& context_;
};

}  // namespace

std::unique_ptr<grpc::Service> MakeDisplayService(ServiceContext& context) {
  return std::make_unique<DisplayService>(context);
}

}  // namespace voxeld::daemon::services
