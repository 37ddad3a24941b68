#include "voxeld/channel.h"

#include <grpcpp/channel.h>
#include <grpcpp/create_channel.h>
#include <grpcpp/security/credentials.h>
#include <grpcpp/support/channel_arguments.h>
#include <grpcpp/support/client_interceptor.h>

#include <cerrno>
#include <cstdlib>
#include <fstream>
#include <sstream>
#include <utility>
#include <vector>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "daemon/address/address.h"

namespace voxeld::client {
namespace {

namespace experimental = grpc::experimental;

// Adds "authorization: Bearer TOKEN" to every call.
class TokenAdder final : public experimental::Interceptor {
 public:
  explicit TokenAdder(const std::string& value) : value_(value) {}
  void Intercept(experimental::InterceptorBatchMethods* methods) override {
    if (methods->QueryInterceptionHookPoint(
            experimental::InterceptionHookPoints::PRE_SEND_INITIAL_METADATA)) {
      methods->GetSendInitialMetadata()->emplace("authorization", value_);
    }
    methods->Proceed();
  }

 private:
  const std::string& value_;
};

class TokenAdders final : public experimental::ClientInterceptorFactoryInterface {
 public:
  explicit TokenAdders(const std::string& token) : value_(absl::StrCat("Bearer ", token)) {}
  experimental::Interceptor* CreateClientInterceptor(experimental::ClientRpcInfo*) override {
    return new TokenAdder(value_);
  }

 private:
  const std::string value_;
};

absl::StatusOr<std::string> ReadFile(const char* what, const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  std::ostringstream text;
  text << file.rdbuf();
  if (!file) return absl::ErrnoToStatus(errno, absl::StrCat(what, " ", path));
  return text.str();
}

absl::StatusOr<std::shared_ptr<grpc::ChannelCredentials>> TlsOf(const Credentials& credentials) {
  if (credentials.certificate.empty() != credentials.key.empty()) {
    return absl::InvalidArgumentError(
        "of a client's certificate and its key one is missing; give both, or none");
  }
  grpc::SslCredentialsOptions options;
  for (const auto& [what, path, into] :
       {std::tuple("the authorities' file", &credentials.ca, &options.pem_root_certs),
        {"the certificate", &credentials.certificate, &options.pem_cert_chain},
        {"the key", &credentials.key, &options.pem_private_key}}) {
    if (path->empty()) continue;
    absl::StatusOr<std::string> text = ReadFile(what, *path);
    if (!text.ok()) return text.status();
    *into = *std::move(text);
  }
  return grpc::SslCredentials(options);
}

}  // namespace

Credentials DefaultCredentials(const Environment& environment) {
  Credentials credentials{.token = environment("VOXELD_TOKEN"),
                          .ca = environment("VOXELD_TLS_CA"),
                          .certificate = environment("VOXELD_TLS_CERT"),
                          .key = environment("VOXELD_TLS_KEY"),
                          .server_name = environment("VOXELD_TLS_NAME")};
  if (credentials.token.empty()) credentials.token_file = environment("VOXELD_TOKEN_FILE");
  return credentials;
}

Credentials DefaultCredentials() {
  return DefaultCredentials([](const char* name) -> std::string {
    const char* value = std::getenv(name);
    return value == nullptr ? "" : value;
  });
}

absl::StatusOr<std::shared_ptr<grpc::Channel>> MakeChannel(
    const std::string& address, const Credentials& credentials,
    const grpc::ChannelArguments& arguments) {
  const absl::StatusOr<daemon::Address> parsed = daemon::ParseAddress(address);
  if (!parsed.ok()) return parsed.status();
  const absl::StatusOr<std::string> target = ServerTarget(address);
  if (!target.ok()) return target.status();

  std::string token = credentials.token;
  if (token.empty() && !credentials.token_file.empty()) {
    absl::StatusOr<std::string> text = ReadFile("the token's file", credentials.token_file);
    if (!text.ok()) return text.status();
    token = std::string(absl::StripAsciiWhitespace(*text));
  }
  for (const char c : token) {
    if (c <= ' ' || c > '~') {
      return absl::InvalidArgumentError(
          "the token has a space, or what is no ASCII; give it as `voxelctl token` printed it");
    }
  }
  if (!token.empty() && !parsed->tls && !parsed->is_local()) {
    return absl::InvalidArgumentError(absl::StrCat(
        "a token would go to ", address, " readable by all that is in between; give tls:", address,
        ", or take the token away"));
  }
  grpc::ChannelArguments own = arguments;
  std::shared_ptr<grpc::ChannelCredentials> channel = grpc::InsecureChannelCredentials();
  if (parsed->tls) {
    auto tls = TlsOf(credentials);
    if (!tls.ok()) return tls.status();
    channel = *std::move(tls);
    if (!credentials.server_name.empty()) own.SetSslTargetNameOverride(credentials.server_name);
  }
  std::vector<std::unique_ptr<experimental::ClientInterceptorFactoryInterface>> adders;
  if (!token.empty()) adders.push_back(std::make_unique<TokenAdders>(token));
  return experimental::CreateCustomChannelWithInterceptors(*target, channel, own,
                                                           std::move(adders));
}

}  // namespace voxeld::client
