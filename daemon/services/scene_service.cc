// Implements the methods of SceneService; each one delegates.
#include <grpcpp/support/byte_buffer.h>
#include <grpcpp/support/server_callback.h>
#include <grpcpp/support/slice.h>

#include <algorithm>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "daemon/services/apply_update.h"
#include "daemon/services/audited.h"
#include "daemon/services/caller.h"
#include "daemon/services/explain_entity.h"
#include "daemon/services/services.h"
#include "daemon/services/status.h"
#include "daemon/services/unary_call.h"
#include "daemon/wire/convert.h"
#include "daemon/wire/encode.h"
#include "voxeld/v1/scene.grpc.pb.h"

namespace voxeld::daemon::services {
namespace {

using access::Caller;
using access::Scope;
using grpc::CallbackServerContext;
using grpc::ServerUnaryReactor;

constexpr uint32_t kPageSize = 1000;

// Reactors for calls that are rejected; they finish at once.
class RefusedStream final : public grpc::ServerBidiReactor<grpc::ByteBuffer, grpc::ByteBuffer> {
 public:
  explicit RefusedStream(const absl::Status& status) { Finish(ToGrpc(status)); }
  void OnDone() override { delete this; }
};

template <typename Request>
class RefusedReads final : public grpc::ServerReadReactor<Request> {
 public:
  explicit RefusedReads(const absl::Status& status) { this->Finish(ToGrpc(status)); }
  void OnDone() override { delete this; }
};

template <typename Response>
class RefusedWrites final : public grpc::ServerWriteReactor<Response> {
 public:
  explicit RefusedWrites(const absl::Status& status) { this->Finish(ToGrpc(status)); }
  void OnDone() override { delete this; }
};

// Stores the core's answer in `response`, which gRPC keeps until the call has finished.
template <typename T, typename Response>
Core::Reply<T> Answer(std::shared_ptr<UnaryCall> call, Response* response) {
  return [call = std::move(call), response](const absl::StatusOr<T>& result) {
    call->Answer(result.status(), [&] {
      if (result.ok()) wire::Encode(*result, response);
    });
  };
}

using SceneStub = v1::SceneService;
using SceneBase = SceneStub::WithRawCallbackMethod_Stream<
    SceneStub::WithRawCallbackMethod_ApplyUpdate<SceneStub::WithRawCallbackMethod_WatchScene<
        SceneStub::WithCallbackMethod_ListEntities<SceneStub::WithCallbackMethod_GetEntity<
            SceneStub::WithCallbackMethod_ExplainEntity<SceneStub::WithCallbackMethod_ClearLayer<
                SceneStub::WithCallbackMethod_ListOwners<SceneStub::WithCallbackMethod_ControlOwner<
                    SceneStub::WithCallbackMethod_UploadAsset<
                        SceneStub::WithCallbackMethod_ListAssets<SceneStub::Service>>>>>>>>>>>;

class SceneService final : public SceneBase {
 public:
  explicit SceneService(ServiceContext& context) : context_(context) {}

  grpc::ServerBidiReactor<grpc::ByteBuffer, grpc::ByteBuffer>* Stream(
      CallbackServerContext* call) override {
    absl::StatusOr<Caller> caller = Authorise(context_, *call, Scope::kDraw, "Stream");
    if (!caller.ok()) return new RefusedStream(caller.status());
    return NewStream(context_, *std::move(caller));
  }

  ServerUnaryReactor* ApplyUpdate(CallbackServerContext* call, const grpc::ByteBuffer* request,
                                  grpc::ByteBuffer* response) override {
    absl::StatusOr<Caller> caller = Authorise(context_, *call, Scope::kDraw, "ApplyUpdate");
    if (!caller.ok()) return Refuse(call, caller.status());
    return DoApplyUpdate(call->DefaultReactor(), *std::move(caller), *request, response);
  }

  grpc::ServerWriteReactor<grpc::ByteBuffer>* WatchScene(CallbackServerContext* call,
                                                         const grpc::ByteBuffer* request) override {
    absl::StatusOr<Caller> caller = Authorise(context_, *call, Scope::kView, "WatchScene");
    if (!caller.ok()) return new RefusedWrites<grpc::ByteBuffer>(caller.status());
    return DoWatchScene(*std::move(caller), *request);
  }

  ServerUnaryReactor* ListEntities(CallbackServerContext* call,
                                   const v1::ListEntitiesRequest* request,
                                   v1::ListEntitiesResponse* response) override {
    if (absl::Status status = May(call, Scope::kView, "ListEntities"); !status.ok()) {
      return Refuse(call, status);
    }
    return DoListEntities(call->DefaultReactor(), *request, response);
  }

  ServerUnaryReactor* GetEntity(CallbackServerContext* call, const v1::GetEntityRequest* request,
                                v1::GetEntityResponse* response) override {
    if (absl::Status status = May(call, Scope::kView, "GetEntity"); !status.ok()) {
      return Refuse(call, status);
    }
    return DoGetEntity(call->DefaultReactor(), *request, response);
  }

  ServerUnaryReactor* ExplainEntity(CallbackServerContext* call,
                                    const v1::ExplainEntityRequest* request,
                                    v1::ExplainEntityResponse* response) override {
    absl::Status status = May(call, Scope::kView, "ExplainEntity");
    if (status.ok()) status = CheckKey(request->key());
    if (!status.ok()) return Refuse(call, status);
    ServerUnaryReactor* reactor = call->DefaultReactor();
    services::ExplainEntity(
        context_, *request,
        [answer = UnaryCall::Begin(context_.short_calls, reactor), response](
            const absl::Status& explained, const v1::ExplainEntityResponse& explanation) {
          answer->Answer(explained, [&] { *response = explanation; });
        });
    return reactor;
  }

  ServerUnaryReactor* ClearLayer(CallbackServerContext* call, const v1::ClearLayerRequest* request,
                                 v1::ClearLayerResponse* response) override {
    absl::StatusOr<Caller> caller = Authorise(context_, *call, Scope::kDraw, "ClearLayer");
    if (!caller.ok()) return Refuse(call, caller.status());
    return DoClearLayer(call, *std::move(caller), *request, response);
  }

  ServerUnaryReactor* ListOwners(CallbackServerContext* call, const v1::ListOwnersRequest*,
                                 v1::ListOwnersResponse* response) override {
    if (absl::Status status = May(call, Scope::kView, "ListOwners"); !status.ok()) {
      return Refuse(call, status);
    }
    ServerUnaryReactor* reactor = call->DefaultReactor();
    context_.core.ListOwners(
        Answer<std::vector<OwnerInfo>>(UnaryCall::Begin(context_.short_calls, reactor), response));
    return reactor;
  }

  ServerUnaryReactor* ControlOwner(CallbackServerContext* call,
                                   const v1::ControlOwnerRequest* request,
                                   v1::OwnerInfo* response) override {
    Audited audited(context_, *call, "ControlOwner", *request);
    const absl::StatusOr<Caller> caller =
        Authorise(context_, *call, Scope::kControl, "ControlOwner");
    if (!caller.ok()) return Refuse(call, audited.Done(caller.status()));
    audited.By(*caller);
    if (absl::Status may = audited.MayAct(); !may.ok()) return Refuse(call, audited.Done(may));
    ServerUnaryReactor* reactor = call->DefaultReactor();
    context_.core.ControlOwner(wire::FromWire(*request),
                               audited.Watching(Answer<OwnerInfo>(
                                   UnaryCall::Begin(context_.short_calls, reactor), response)));
    return reactor;
  }

  grpc::ServerReadReactor<v1::UploadAssetRequest>* UploadAsset(
      CallbackServerContext* call, v1::UploadAssetResponse* response) override {
    absl::StatusOr<Caller> caller = Authorise(context_, *call, Scope::kDraw, "UploadAsset");
    absl::Status status = caller.status();
    if (status.ok()) status = CheckAssets(context_);
    if (!status.ok()) return new RefusedReads<v1::UploadAssetRequest>(status);
    return NewUpload(context_, *std::move(caller), response);
  }

  ServerUnaryReactor* ListAssets(CallbackServerContext* call, const v1::ListAssetsRequest* request,
                                 v1::ListAssetsResponse* response) override {
    absl::Status status = May(call, Scope::kView, "ListAssets");
    if (status.ok()) status = services::ListAssets(context_, *request, response);
    return Refuse(call, status);
  }

 private:
  static ServerUnaryReactor* Refuse(CallbackServerContext* call, const absl::Status& status) {
    ServerUnaryReactor* reactor = call->DefaultReactor();
    reactor->Finish(ToGrpc(status));
    return reactor;
  }

  static absl::Status CheckKey(const v1::EntityKey& key) {
    if (!key.layer().empty() && !key.id().empty()) return absl::OkStatus();
    return absl::InvalidArgumentError(
        absl::StrCat("key.", key.layer().empty() ? "layer" : "id",
                     " is empty; an entity is asked for by its layer and id"));
  }

  absl::Status May(CallbackServerContext* call, Scope scope, const char* method) {
    return Authorise(context_, *call, scope, method).status();
  }

  ServerUnaryReactor* DoApplyUpdate(ServerUnaryReactor* reactor, const Caller& caller,
                                    const grpc::ByteBuffer& request, grpc::ByteBuffer* response) {
    const auto call = UnaryCall::Begin(context_.short_calls, reactor);
    std::vector<grpc::Slice> slices;
    if (!request.Dump(&slices).ok()) {
      call->End(absl::InternalError("a message could not be decompressed"));
      return reactor;
    }
    std::vector<std::string_view> views;
    views.reserve(slices.size());
    for (const grpc::Slice& slice : slices) {
      views.emplace_back(reinterpret_cast<const char*>(slice.begin()), slice.size());
    }
    services::ApplyUpdate(
        context_, caller, views,
        [call, response](const absl::Status& status, const v1::ApplyUpdateResponse& answer) {
          call->Answer(status, [&] {
            const grpc::Slice slice(answer.SerializeAsString());
            *response = grpc::ByteBuffer(&slice, 1);
          });
        });
    return reactor;
  }

  grpc::ServerWriteReactor<grpc::ByteBuffer>* DoWatchScene(Caller caller,
                                                           grpc::ByteBuffer request) {
    v1::WatchSceneRequest parsed;
    const grpc::Status status =
        grpc::SerializationTraits<v1::WatchSceneRequest>::Deserialize(&request, &parsed);
    if (!status.ok()) {
      return new RefusedWrites<grpc::ByteBuffer>(
          absl::InvalidArgumentError("the message is no WatchSceneRequest"));
    }
    return NewSceneWatch(context_, std::move(caller), parsed);
  }

  ServerUnaryReactor* DoListEntities(ServerUnaryReactor* reactor,
                                     const v1::ListEntitiesRequest& request,
                                     v1::ListEntitiesResponse* response) {
    EntityQuery query{
        request.owner(), request.layer(), request.id_prefix(),
        request.page_size() == 0 ? kPageSize : std::min(request.page_size(), kPageSize),
        request.page_token()};
    context_.core.ListEntities(
        std::move(query),
        Answer<EntityPage>(UnaryCall::Begin(context_.short_calls, reactor), response));
    return reactor;
  }

  ServerUnaryReactor* DoGetEntity(ServerUnaryReactor* reactor, const v1::GetEntityRequest& request,
                                  v1::GetEntityResponse* response) {
    const v1::EntityKey& key = request.key();
    if (absl::Status status = CheckKey(key); !status.ok()) {
      reactor->Finish(ToGrpc(status));
      return reactor;
    }
    context_.core.GetEntity({key.owner(), key.layer(), key.id()},
                            Answer<EntityInfo>(UnaryCall::Begin(context_.short_calls, reactor),
                                               response->mutable_info()));
    return reactor;
  }

  ServerUnaryReactor* DoClearLayer(CallbackServerContext* call, const Caller& caller,
                                   const v1::ClearLayerRequest& request,
                                   v1::ClearLayerResponse* response) {
    Audited audited(context_, *call, "ClearLayer", request, "everything");
    audited.By(caller);
    if (absl::Status may = audited.MayAct(); !may.ok()) return Refuse(call, audited.Done(may));
    ServerUnaryReactor* reactor = call->DefaultReactor();
    // Without the scope control a caller can clear only its own layers.
    context_.core.ClearLayer(
        request.owner(), request.layer(), request.keep_state(),
        caller.scopes.Has(Scope::kControl) ? std::optional<std::string>() : caller.principal,
        audited.Watching(
            Answer<Cleared>(UnaryCall::Begin(context_.short_calls, reactor), response)));
    return reactor;
  }

  ServiceContext& context_;
};

}  // namespace

std::unique_ptr<grpc::Service> MakeSceneService(ServiceContext& context) {
  return std::make_unique<SceneService>(context);
}

}  // namespace voxeld::daemon::services
