// Tests which callers may make which calls, over every kind of connection.
#include <gmock/gmock.h>
#include <google/protobuf/descriptor.h>
#include <grpcpp/generic/generic_stub.h>
#include <grpcpp/security/credentials.h>

#include <ctime>
#include <filesystem>
#include <fstream>
#include <map>
#include <memory>
#include <string>

#include "absl/strings/str_cat.h"
#include "daemon/access/access.h"
#include "daemon/access/audit.h"
#include "daemon/access/tls_store.h"
#include "daemon/assets/asset_store.h"
#include "tests/daemon/access/certificates.h"
#include "tests/daemon/services/daemon_fixture.h"

namespace voxeld::daemon::services {
namespace {

using access::Access;
using access::HashOf;
using access::ParseScopes;
using access::PutFile;
using grpc::StatusCode;
using ::testing::HasSubstr;

constexpr char kAnyPort[] = "127.0.0.1:0";

std::string Grant(const std::string& name, const std::string& scope) {
  return absl::StrCat("[[token]]\nname = \"", name, "\"\nsha256 = \"", HashOf(name),
                      "\"\nscopes = [\"", scope, "\"]\n");
}

class ServicesAccess : public ::testing::Test {
 protected:
  void SetUp() override {
    std::filesystem::create_directories(folder_);
    PutFile(grants_, Grant("viewer", "view") + Grant("painter", "draw") + Grant("boss", "control") +
                         Grant("artist", "view\", \"draw") +
                         "[[certificate]]\nname = \"cube\"\nsubject = \"cube.example\"\n"
                         "scopes = [\"view\"]\n");
    access_ = std::make_unique<Access>(access::AccessOptions{.grants = grants_,
                                                             .anonymous = *ParseScopes("none"),
                                                             .unix_users = *ParseScopes("view"),
                                                             .trusted = {}},
                                       Access::SystemWallClock(), nullptr);
    ASSERT_TRUE(access_->Look().ok());
    auto audit = access::Audit::Open({.path = folder_ + "/audit"}, nullptr);
    ASSERT_TRUE(audit.ok()) << audit.status();
    audit_ = *std::move(audit);
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  void Start(const access::TlsStore* tls = nullptr) {
    // The fixture's own calls arrive over the Unix socket, as a user with the view scope.
    daemon_ = std::make_unique<Daemon>(
        DaemonOptions{.listen = {kAnyPort, tls == nullptr ? kAnyPort : "tls:127.0.0.1:0"},
                      .access = access_.get(),
                      .tls = tls,
                      .audit = audit_.get(),
                      .assets = store_.get()});
    daemon_->server().addresses();
    access_->SetOnChange([this] { daemon_->server().EndRevoked(); });
  }
  std::string Target(size_t i) const {
    Address address = daemon_->server().addresses()[i];
    address.tls = false;
    return address.ToString();
  }
  std::shared_ptr<grpc::Channel> Plain() const {
    return grpc::CreateChannel(Target(1), grpc::InsecureChannelCredentials());
  }

  // Makes a call with an empty request, which names `token` unless that is empty. Returns its final
  // status.
  static grpc::Status Call(const std::shared_ptr<grpc::Channel>& channel, const std::string& method,
                           const std::string& token) {
    grpc::GenericStub stub(channel);
    grpc::ClientContext context;
    SetDeadline(context);
    if (!token.empty()) context.AddMetadata("authorization", "Bearer " + token);
    grpc::CompletionQueue queue;
    const auto call = stub.PrepareCall(&context, method, &queue);
    void* tag = nullptr;
    bool ok = false;
    call->StartCall(nullptr);
    EXPECT_TRUE(queue.Next(&tag, &ok));
    const grpc::Slice nothing("");
    call->WriteLast(grpc::ByteBuffer(&nothing, 1), grpc::WriteOptions(), nullptr);
    EXPECT_TRUE(queue.Next(&tag, &ok));
    // An allowed call may never end: the first answer is enough.
    grpc::ByteBuffer answer;
    call->Read(&answer, nullptr);
    EXPECT_TRUE(queue.Next(&tag, &ok));
    if (ok) context.TryCancel();
    const bool answered = ok;
    grpc::Status status;
    call->Finish(&status, nullptr);
    EXPECT_TRUE(queue.Next(&tag, &ok));
    return answered ? grpc::Status::OK : status;
  }

  const std::string folder_ =
      absl::StrCat(::testing::TempDir(), "/voxeld-services-access-", getpid());
  const std::string grants_ = folder_ + "/grants.toml";
  sync::SystemClock clock_;
  const std::unique_ptr<assets::AssetStore> store_ =
      assets::AssetStore::Open("", {}, clock_, nullptr);
  std::unique_ptr<Access> access_;
  std::unique_ptr<access::Audit> audit_;
  std::unique_ptr<Daemon> daemon_;
};

// The scopes that each method requires, written down a second time: a method that is added must be
// added here.
const std::map<std::string, std::string>& ScopesOfMethods() {
  static const std::map<std::string, std::string> scopes = {
      {"SceneService/Stream", "draw"},          {"SceneService/ApplyUpdate", "draw"},
      {"SceneService/WatchScene", "view"},      {"SceneService/ListEntities", "view"},
      {"SceneService/GetEntity", "view"},       {"SceneService/ClearLayer", "draw"},
      {"SceneService/ExplainEntity", "view"},   {"SceneService/ListOwners", "view"},
      {"SceneService/ControlOwner", "control"}, {"SceneService/UploadAsset", "draw"},
      {"SceneService/ListAssets", "view"},      {"DisplayService/ListDisplays", "view"},
      {"DisplayService/GetDisplay", "view"},    {"DisplayService/UpdateDisplay", "control"},
      {"DisplayService/WatchStats", "view"},    {"DisplayService/WatchVolume", "view"},
      {"DisplayService/CaptureVolume", "view"}};
  return scopes;
}

TEST_F(ServicesAccess, EveryMethodAsksForItsScope) {
  Start();
  const auto channel = Plain();
  size_t methods = 0;
  for (const google::protobuf::FileDescriptor* file :
       {v1::StreamRequest::descriptor()->file(), v1::Stats::descriptor()->file()}) {
    for (int s = 0; s < file->service_count(); ++s) {
      for (int m = 0; m < file->service(s)->method_count(); ++m) {
        const std::string name =
            absl::StrCat(file->service(s)->name(), "/", file->service(s)->method(m)->name());
        ASSERT_TRUE(ScopesOfMethods().contains(name)) << name;
        const std::string& needed = ScopesOfMethods().at(name);
        const std::string method = "/voxeld.v1." + name;
        ++methods;
        for (const auto& [token, scope] :
             {std::pair("viewer", "view"), {"painter", "draw"}, {"boss", "control"}}) {
          const grpc::Status status = Call(channel, method, token);
          const bool refused = status.error_code() == StatusCode::PERMISSION_DENIED &&
                               status.error_message().starts_with("this takes the scope");
          EXPECT_EQ(refused, needed != scope)
              << name << " " << token << " " << status.error_code() << status.error_message();
        }
        EXPECT_EQ(Call(channel, method, "").error_code(), StatusCode::UNAUTHENTICATED) << name;
        EXPECT_EQ(Call(channel, method, "guess").error_code(), StatusCode::UNAUTHENTICATED) << name;
      }
    }
  }
  EXPECT_EQ(methods, ScopesOfMethods().size());
  EXPECT_GT(daemon_->Stats().connections().calls_turned_away(), 40u);
  // Calls that need no scope.
  EXPECT_TRUE(Call(channel, "/grpc.health.v1.Health/Check", "").ok());
}

TEST_F(ServicesAccess, ControlIsRefusedWhileARequiredAuditLogCannotBeWritten) {
  auto audit = access::Audit::Open({.path = "/dev/full", .required = true}, nullptr);
  ASSERT_TRUE(audit.ok()) << audit.status();
  audit_ = *std::move(audit);
  Start();
  const auto channel = Plain();
  // The first entry is also the first that cannot be written.
  audit_->Record("a", "", "First", "", absl::OkStatus());
  for (const auto& [method, token] : {std::pair("DisplayService/UpdateDisplay", "boss"),
                                      {"SceneService/ControlOwner", "boss"},
                                      {"SceneService/ClearLayer", "painter"}}) {
    const grpc::Status status = Call(channel, absl::StrCat("/voxeld.v1.", method), token);
    EXPECT_EQ(status.error_code(), StatusCode::UNAVAILABLE) << method;
    EXPECT_THAT(status.error_message(), HasSubstr("No space left on device")) << method;
  }
  EXPECT_TRUE(Call(channel, "/voxeld.v1.DisplayService/ListDisplays", "viewer").ok());
}

TEST_F(ServicesAccess, AHeaderThatIsNoneIsRefused) {
  Start();
  grpc::ClientContext context;
  SetDeadline(context);
  context.AddMetadata("authorization", "Basic dmlld2VyOg==");
  v1::ListDisplaysResponse response;
  const auto stub = v1::DisplayService::NewStub(Plain());
  const grpc::Status status = stub->ListDisplays(&context, {}, &response);
  EXPECT_EQ(status.error_code(), StatusCode::UNAUTHENTICATED);
  EXPECT_THAT(status.error_message(), HasSubstr("Bearer"));
}

// The server does not guess which of two headers counts.
TEST_F(ServicesAccess, TwoHeadersAreRefused) {
  Start();
  const auto stub = v1::DisplayService::NewStub(Plain());
  for (const char* second : {"viewer", "guess"}) {
    grpc::ClientContext context;
    SetDeadline(context);
    context.AddMetadata("authorization", "Bearer viewer");
    context.AddMetadata("authorization", absl::StrCat("Bearer ", second));
    v1::ListDisplaysResponse response;
    const grpc::Status status = stub->ListDisplays(&context, {}, &response);
    EXPECT_EQ(status.error_code(), StatusCode::UNAUTHENTICATED);
    EXPECT_THAT(status.error_message(), HasSubstr("is not one of"));
  }
}

TEST_F(ServicesAccess, AUnixSocketsUserIsKnownByTheKernelsWord) {
  Start();
  const auto channel = daemon_->NewChannel();
  EXPECT_TRUE(Call(channel, "/voxeld.v1.DisplayService/ListDisplays", "").ok());
  const grpc::Status status = Call(channel, "/voxeld.v1.DisplayService/UpdateDisplay", "");
  EXPECT_EQ(status.error_code(), StatusCode::PERMISSION_DENIED);
  EXPECT_EQ(status.error_message(),
            absl::StrCat("this takes the scope control, and user ", geteuid(), " has view"));
  EXPECT_NE(Call(channel, "/voxeld.v1.DisplayService/UpdateDisplay", "boss").error_code(),
            StatusCode::PERMISSION_DENIED);
}

TEST_F(ServicesAccess, ThePrincipalIsTheOwner) {
  Start();
  const auto stub = v1::SceneService::NewStub(Plain());
  const auto open = [&](const std::string& token, const std::string& owner_token = "",
                        const std::string& resume_token = "") {
    auto context = std::make_unique<grpc::ClientContext>();
    SetDeadline(*context);
    context->AddMetadata("authorization", "Bearer " + token);
    auto call = stub->Stream(context.get());
    v1::StreamRequest request;
    request.mutable_open()->set_owner_token(owner_token);
    request.mutable_open()->set_resume_token(resume_token);
    call->Write(request);
    v1::StreamResponse response;
    if (!call->Read(&response)) {
      return std::tuple(v1::Opened(), call->Finish(), std::move(context), std::move(call));
    }
    return std::tuple(response.opened(), grpc::Status::OK, std::move(context), std::move(call));
  };
  const auto first = open("painter"), second = open("painter"), other = open("artist");
  EXPECT_EQ(std::get<0>(first).owner(), std::get<0>(second).owner());
  EXPECT_NE(std::get<0>(first).owner(), std::get<0>(other).owner());
  // Naming the owner or session of another caller is treated like a guess.
  EXPECT_EQ(std::get<1>(open("artist", std::get<0>(first).owner_token())).error_code(),
            StatusCode::NOT_FOUND);
  EXPECT_EQ(std::get<1>(open("artist", "", std::get<0>(first).resume_token())).error_code(),
            StatusCode::NOT_FOUND);
  EXPECT_EQ(std::get<0>(open("painter", "", std::get<0>(first).resume_token())).session(),
            std::get<0>(first).session());
}

TEST_F(ServicesAccess, LayersThatEraseAndOthersLayersTakeControl) {
  Start();
  const auto stub = v1::SceneService::NewStub(Plain());
  v1::ApplyUpdateRequest update;
  *update.mutable_open() = v1::Open();
  update.mutable_open()->set_on_disconnect(v1::DISCONNECT_POLICY_KEEP);
  *update.add_operations() = SphereIn("mine", "ball");
  v1::LayerState* state = update.add_operations()->mutable_layer_state();
  state->set_layer("mine");
  state->set_blend(v1::BLEND_MODE_ERASE);
  const auto apply = [&](const std::string& token) {
    grpc::ClientContext context;
    SetDeadline(context);
    context.AddMetadata("authorization", "Bearer " + token);
    v1::ApplyUpdateResponse response;
    const grpc::Status status = stub->ApplyUpdate(&context, update, &response);
    EXPECT_TRUE(status.ok()) << status.error_message();
    return response;
  };
  const v1::ApplyUpdateResponse artists = apply("artist");
  ASSERT_EQ(artists.issues_size(), 1);
  EXPECT_EQ(artists.issues(0).reason(), v1::REASON_PERMISSION_DENIED);
  EXPECT_EQ(artists.issues(0).field(), "layer_state.blend");
  EXPECT_EQ(apply("painter").issues_size(), 1);

  const auto clear = [&](const std::string& token, uint64_t owner) {
    grpc::ClientContext context;
    SetDeadline(context);
    context.AddMetadata("authorization", "Bearer " + token);
    v1::ClearLayerRequest request;
    request.set_owner(owner);
    v1::ClearLayerResponse response;
    const grpc::Status status = stub->ClearLayer(&context, request, &response);
    return std::pair(status.error_code(), response.entities());
  };
  EXPECT_EQ(daemon_->Entities().entities_size(), 2);
  EXPECT_EQ(clear("artist", 0), std::pair(StatusCode::OK, uint64_t{1})) << "only its own";
  EXPECT_EQ(clear("artist", 0), std::pair(StatusCode::OK, uint64_t{0})) << "it has no layers left";
  ASSERT_EQ(daemon_->Entities().entities_size(), 1);
  const uint64_t painters = daemon_->Entities().entities(0).key().owner();
  EXPECT_EQ(clear("artist", painters).first, StatusCode::PERMISSION_DENIED);
  EXPECT_EQ(clear("boss", painters).first, StatusCode::PERMISSION_DENIED) << "it has only control";
  PutFile(grants_, Grant("boss", "draw\", \"control"));
  ASSERT_TRUE(access_->Look(true).ok());
  EXPECT_EQ(clear("boss", painters), std::pair(StatusCode::OK, uint64_t{1}));
  std::ifstream audit(folder_ + "/audit");
  const std::string text((std::istreambuf_iterator<char>(audit)), std::istreambuf_iterator<char>());
  EXPECT_THAT(text, HasSubstr("\"who\":\"token boss\""));
  EXPECT_THAT(text, HasSubstr("\"method\":\"ClearLayer\""));
  EXPECT_THAT(text, HasSubstr("PERMISSION_DENIED"));
  EXPECT_THAT(text, HasSubstr("\"what\":\"everything\"")) << "of owner 0, and all its layers";
  EXPECT_THAT(text, Not(HasSubstr("\"what\":\"\"")));
}

TEST_F(ServicesAccess, ATokenThatIsTakenAwayEndsItsCallsAndNobodyElses) {
  Start();
  const auto scene = v1::SceneService::NewStub(Plain());
  const auto displays = v1::DisplayService::NewStub(Plain());
  grpc::ClientContext painters, viewers;
  SetDeadline(painters);
  SetDeadline(viewers);
  painters.AddMetadata("authorization", "Bearer painter");
  viewers.AddMetadata("authorization", "Bearer viewer");
  const auto stream = scene->Stream(&painters);
  v1::StreamRequest open;
  open.mutable_open();
  ASSERT_TRUE(stream->Write(open));
  v1::StreamResponse opened;
  ASSERT_TRUE(stream->Read(&opened));
  v1::WatchStatsRequest request;
  request.set_interval_ns(10 * sync::kMillisecond);
  const auto watch = displays->WatchStats(&viewers, request);
  v1::Stats stats;
  ASSERT_TRUE(watch->Read(&stats));
  const std::string hash(32, 'h');
  grpc::ClientContext uploaders;
  SetDeadline(uploaders);
  uploaders.AddMetadata("authorization", "Bearer painter");
  v1::UploadAssetResponse response;
  const auto upload = scene->UploadAsset(&uploaders, &response);
  v1::UploadAssetRequest piece;
  piece.set_sha256(hash);
  piece.set_size(12);
  piece.set_data("four");
  ASSERT_TRUE(upload->Write(piece));
  while (store_->List({&hash, 1}).front().stored < 4) ASSERT_TRUE(watch->Read(&stats));

  PutFile(grants_, Grant("viewer", "view"));
  ASSERT_TRUE(access_->Look(true).ok());
  v1::StreamResponse rest;
  while (stream->Read(&rest)) {
  }
  const grpc::Status ended = stream->Finish();
  EXPECT_EQ(ended.error_code(), StatusCode::UNAUTHENTICATED);
  EXPECT_THAT(ended.error_message(), HasSubstr("revoked"));
  const grpc::Status cut = upload->Finish();
  EXPECT_EQ(cut.error_code(), StatusCode::UNAUTHENTICATED);
  EXPECT_THAT(cut.error_message(), HasSubstr("revoked"));
  EXPECT_EQ(store_->List({&hash, 1}).front().stored, 4u) << "an authorised caller can continue it";
  while (stats.connections().calls_revoked() < 2) ASSERT_TRUE(watch->Read(&stats));
  EXPECT_EQ(stats.connections().calls_revoked(), 2u);
  EXPECT_EQ(stats.sessions(), 0u);

  // An invalid file does not affect connected clients.
  PutFile(grants_, "[[token]]\nname =");
  EXPECT_FALSE(access_->Look(true).ok());
  for (int i = 0; i < 10; ++i) ASSERT_TRUE(watch->Read(&stats));
  EXPECT_EQ(Call(Plain(), "/voxeld.v1.DisplayService/ListDisplays", "viewer").error_code(),
            StatusCode::UNAVAILABLE);
  viewers.TryCancel();
  watch->Finish();
}

// -------------------------------------------------------------------------------------------- TLS

class ServicesTls : public ServicesAccess {
 protected:
  void SetUp() override {
    ServicesAccess::SetUp();
    Put(authority_.Issue("display.example"), authority_.certificate());
    auto store = access::TlsStore::Open(files_, Access::SystemWallClock(), nullptr);
    ASSERT_TRUE(store.ok()) << store.status();
    store_ = *std::move(store);
    Start(store_.get());
  }
  void Put(const access::Issued& server, const std::string& client_ca) {
    PutFile(files_.certificate, server.certificate);
    PutFile(files_.key, server.key);
    PutFile(files_.client_ca, client_ca);
  }

  grpc::Status Ask(const access::Issued& client, const std::string& authority,
                   const std::string& token = "") const {
    grpc::ChannelArguments arguments;
    arguments.SetInt(GRPC_ARG_USE_LOCAL_SUBCHANNEL_POOL, 1);
    arguments.SetSslTargetNameOverride("display.example");
    return Call(grpc::CreateCustomChannel(
                    Target(2), grpc::SslCredentials({authority, client.key, client.certificate}),
                    arguments),
                "/voxeld.v1.DisplayService/ListDisplays", token);
  }

  const access::TlsFiles files_{folder_ + "/cert.pem", folder_ + "/key.pem", folder_ + "/ca.pem"};
  access::TestAuthority authority_{"one"}, stranger_{"two"};
  std::unique_ptr<access::TlsStore> store_;
};

TEST_F(ServicesTls, BothSidesAreVerified) {
  const std::string& ca = authority_.certificate();
  EXPECT_TRUE(Ask(authority_.Issue("cube.example"), ca).ok());
  // Signed by the right authority, but not named in the grants.
  EXPECT_EQ(Ask(authority_.Issue("other.example"), ca).error_code(), StatusCode::PERMISSION_DENIED);
  EXPECT_TRUE(Ask(authority_.Issue("other.example"), ca, "viewer").ok());
  // Without a subject, the name is the first one for which the certificate is issued.
  EXPECT_TRUE(Ask(authority_.IssueWithoutSubject("cube.example"), ca).ok());
  EXPECT_EQ(Ask(authority_.IssueWithoutSubject("other.example"), ca).error_code(),
            StatusCode::PERMISSION_DENIED);
  // No certificate, one of another authority, an expired one, one that is not valid yet; and a
  // server that the client does not trust.
  EXPECT_EQ(Ask({}, ca, "viewer").error_code(), StatusCode::UNAVAILABLE);
  EXPECT_EQ(Ask(stranger_.Issue("cube.example"), ca, "viewer").error_code(),
            StatusCode::UNAVAILABLE);
  EXPECT_EQ(Ask(authority_.Issue("cube.example", -7200, -3600), ca).error_code(),
            StatusCode::UNAVAILABLE);
  EXPECT_EQ(Ask(authority_.Issue("cube.example", 3600, 7200), ca).error_code(),
            StatusCode::UNAVAILABLE);
  EXPECT_EQ(Ask(authority_.Issue("cube.example"), stranger_.certificate()).error_code(),
            StatusCode::UNAVAILABLE);
  // Without TLS, the address cannot be used.
  EXPECT_EQ(Call(grpc::CreateChannel(Target(2), grpc::InsecureChannelCredentials()),
                 "/voxeld.v1.DisplayService/ListDisplays", "viewer")
                .error_code(),
            StatusCode::UNAVAILABLE);
}

TEST_F(ServicesTls, WhatIsExchangedHoldsForNewConnections) {
  const std::string old_ca = authority_.certificate();
  const access::Issued client = authority_.Issue("cube.example");
  ASSERT_TRUE(Ask(client, old_ca).ok());
  // A certificate and a key that do not match change nothing.
  PutFile(files_.certificate, stranger_.Issue("display.example").certificate);
  EXPECT_FALSE(store_->Look(true).ok());
  EXPECT_TRUE(Ask(client, old_ca).ok());
  Put(stranger_.Issue("display.example"), stranger_.certificate());
  EXPECT_TRUE(store_->Look(true).ok());
  EXPECT_EQ(Ask(client, old_ca).error_code(), StatusCode::UNAVAILABLE);
  EXPECT_EQ(Ask(client, stranger_.certificate()).error_code(), StatusCode::UNAVAILABLE);
  EXPECT_TRUE(Ask(stranger_.Issue("cube.example"), stranger_.certificate()).ok());
}

TEST(ServicesTlsStart, AnAddressThatIsToSpeakTlsNeedsACertificate) {
  sync::SystemClock clock;
  Core core({.version = "1"}, clock);
  ASSERT_TRUE(core.Start().ok());
  const auto server = Server::Start(core, clock, {.listen = {*ParseAddress("tls:127.0.0.1:0")}});
  EXPECT_TRUE(absl::IsInvalidArgument(server.status()));
  EXPECT_THAT(std::string(server.status().message()), HasSubstr("there is no certificate"));
  ASSERT_TRUE(core.Stop(sync::kSecond).ok());
}

}  // namespace
}  // namespace voxeld::daemon::services
