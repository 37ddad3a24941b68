#include "daemon/services/acceptors.h"

#include <grpc/grpc.h>
#include <grpc/grpc_security.h>
#include <grpcpp/security/auth_metadata_processor.h>
#include <grpcpp/security/server_credentials.h>
#include <grpcpp/server_builder.h>

#include <atomic>
#include <string>
#include <utility>
#include <vector>

#include "daemon/services/caller.h"
#include "display/sync/mutex.h"

namespace voxeld::daemon::services {
namespace {

using Acceptor = std::unique_ptr<grpc::experimental::ExternalConnectionAcceptor>;

// Implements TLS through gRPC's C interface, because only that asks for certificates at each
// handshake.
class TlsCredentials final : public grpc::ServerCredentials {
 public:
  explicit TlsCredentials(const access::TlsStore& store) : store_(store) {
    grpc_init();
    credentials_ = grpc_ssl_server_credentials_create_with_options(
        grpc_ssl_server_credentials_create_options_using_config_fetcher(
            GRPC_SSL_REQUEST_AND_REQUIRE_CLIENT_CERTIFICATE_AND_VERIFY, &Fetch, this));
  }
  ~TlsCredentials() override {
    grpc_server_credentials_release(credentials_);
    grpc_shutdown();
  }

  void SetAuthMetadataProcessor(const std::shared_ptr<grpc::AuthMetadataProcessor>&) override {}

 private:
  int AddPortToServer(const std::string& address, grpc_server* server) override {
    return grpc_server_add_http2_port(server, address.c_str(), credentials_);
  }

  // Called by gRPC, one call at a time.
  static grpc_ssl_certificate_config_reload_status Fetch(
      void* self_pointer, grpc_ssl_server_certificate_config** config) {
    auto* self = static_cast<TlsCredentials*>(self_pointer);
    const access::TlsStore::Current current = self->store_.current();
    if (current.generation == self->given_) return GRPC_SSL_CERTIFICATE_CONFIG_RELOAD_UNCHANGED;
    const grpc_ssl_pem_key_cert_pair pair = {current.material->key.c_str(),
                                             current.material->certificate.c_str()};
    *config =
        grpc_ssl_server_certificate_config_create(current.material->client_ca.c_str(), &pair, 1);
    self->given_ = current.generation;
    return GRPC_SSL_CERTIFICATE_CONFIG_RELOAD_NEW;
  }

  const access::TlsStore& store_;
  grpc_server_credentials* credentials_ = nullptr;
  std::atomic<uint64_t> given_ = 0;
};

// Records the user of a call's connection. All calls of a connection share its AuthContext. The
// first call writes the property before any handler reads it. It is never written again, because
// properties stay as long as the connection, and adding one moves what other threads may be
// reading.
class UserTeller final : public grpc::AuthMetadataProcessor {
 public:
  static constexpr int64_t kNobody = -1;

  bool IsBlocking() const override { return false; }
  grpc::Status Process(const InputMetadata&, grpc::AuthContext* context, OutputMetadata*,
                       OutputMetadata*) override {
    sync::MutexLock lock(mutex_);
    if (context->FindPropertyValues(kUserProperty).empty()) {
      context->AddProperty(kUserProperty, std::to_string(user.load()));
    }
    return grpc::Status::OK;
  }

  // Set once, before the first connection is accepted.
  std::atomic<int64_t> user = kNobody;

 private:
  sync::Mutex mutex_;
};

struct UserSlot {
  std::shared_ptr<UserTeller> teller = std::make_shared<UserTeller>();
  Acceptor acceptor;
};

Acceptor Add(grpc::ServerBuilder& builder, std::shared_ptr<grpc::ServerCredentials> credentials) {
  return builder.experimental().AddExternalConnectionAcceptor(
      grpc::ServerBuilder::experimental_type::ExternalConnectionType::FROM_FD,
      std::move(credentials));
}

}  // namespace

class Acceptors::Impl {
 public:
  explicit Impl(const access::TlsStore* tls) : tls_store_(tls) {}

  void AddTo(grpc::ServerBuilder& builder) {
    plain_ = Add(builder, grpc::InsecureServerCredentials());
    if (tls_store_ != nullptr) tls_ = Add(builder, std::make_shared<TlsCredentials>(*tls_store_));
    users_.resize(kMostUsers);
    for (UserSlot& slot : users_) {
      const auto credentials = grpc::experimental::LocalServerCredentials(UDS);
      credentials->SetAuthMetadataProcessor(slot.teller);
      slot.acceptor = Add(builder, credentials);
    }
  }

  bool Take(const listen::Accepted& accepted, Descriptor connection) {
    grpc::experimental::ExternalConnectionAcceptor* acceptor = accepted.user.has_value()
                                                                   ? OfUser(*accepted.user)
                                                               : accepted.tls ? tls_.get()
                                                                              : plain_.get();
    if (acceptor == nullptr) return false;
    grpc::experimental::ExternalConnectionAcceptor::NewConnectionParameters parameters;
    parameters.listener_fd = accepted.listening;
    parameters.fd = connection.Release();
    acceptor->HandleNewConnection(&parameters);
    return true;
  }

 private:
  grpc::experimental::ExternalConnectionAcceptor* OfUser(uint32_t user) {
    for (UserSlot& slot : users_) {
      int64_t nobody = UserTeller::kNobody;
      if (slot.teller->user.compare_exchange_strong(nobody, user) || nobody == user) {
        return slot.acceptor.get();
      }
    }
    return nullptr;
  }

  const access::TlsStore* const tls_store_;
  Acceptor plain_, tls_;
  std::vector<UserSlot> users_;
};

Acceptors::Acceptors(const access::TlsStore* tls) : impl_(std::make_unique<Impl>(tls)) {}
Acceptors::~Acceptors() = default;
void Acceptors::AddTo(grpc::ServerBuilder& builder) { impl_->AddTo(builder); }
bool Acceptors::Take(const listen::Accepted& accepted, Descriptor connection) {
  return impl_->Take(accepted, std::move(connection));
}

}  // namespace voxeld::daemon::services
