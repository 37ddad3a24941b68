#include "daemon/services/caller.h"

#include <grpc/grpc_security_constants.h>
#include <grpcpp/security/auth_context.h>
#include <grpcpp/server_context.h>

#include <charconv>
#include <optional>
#include <string_view>
#include <utility>

#include "absl/strings/str_cat.h"
#include "daemon/listen/peer.h"

namespace voxeld::daemon::services {
namespace {

constexpr char kHeader[] = "authorization";
constexpr std::string_view kBearer = "Bearer ";

std::string_view View(grpc::string_ref text) { return {text.data(), text.size()}; }

std::optional<std::string> Property(const grpc::AuthContext& context, const char* name) {
  const std::vector<grpc::string_ref> values = context.FindPropertyValues(name);
  if (values.empty() || values.front().empty()) return {};
  return std::string(View(values.front()));
}

absl::StatusOr<access::Credentials> CredentialsOf(const grpc::CallbackServerContext& call) {
  access::Credentials credentials;
  const auto [begin, end] = call.client_metadata().equal_range(kHeader);
  for (auto at = begin; at != end; ++at) {
    const std::string_view value = View(at->second);
    if (!value.starts_with(kBearer) || credentials.token.has_value()) {
      return absl::UnauthenticatedError(
          "the header \"authorization\" is not one of \"Bearer \" and a token");
    }
    credentials.token = std::string(value.substr(kBearer.size()));
  }
  const std::shared_ptr<const grpc::AuthContext> peer = call.auth_context();
  if (peer == nullptr) return credentials;
  if (peer->IsPeerAuthenticated()) {  // true for TLS only
    credentials.certificate = Property(*peer, GRPC_X509_CN_PROPERTY_NAME);
    if (!credentials.certificate.has_value()) {
      credentials.certificate = Property(*peer, GRPC_X509_SAN_PROPERTY_NAME);
    }
  }
  if (const std::optional<std::string> user = Property(*peer, kUserProperty)) {
    uint32_t number = 0;
    const auto parsed = std::from_chars(user->data(), user->data() + user->size(), number);
    if (parsed.ec == std::errc()) credentials.user = number;
  }
  return credentials;
}

absl::StatusOr<access::Caller> Identified(ServiceContext& context,
                                          const grpc::CallbackServerContext& call,
                                          access::Scope scope) {
  absl::StatusOr<access::Credentials> credentials = CredentialsOf(call);
  if (!credentials.ok()) return credentials.status();
  absl::StatusOr<access::Caller> caller = context.access->Identify(*credentials);
  if (!caller.ok() || caller->scopes.Has(scope)) return caller;
  const std::string has = caller->scopes.Sentence();
  if (caller->by == access::Caller::By::kAnonymous) {
    return absl::UnauthenticatedError(absl::StrCat(
        "this takes the scope ", access::ScopeName(scope), ", and without a token a caller has ",
        has, "; send one as the header \"authorization: Bearer TOKEN\" (VOXELD_TOKEN)"));
  }
  return absl::PermissionDeniedError(absl::StrCat("this takes the scope ", access::ScopeName(scope),
                                                  ", and ", caller->who, " has ", has));
}

}  // namespace

std::string PeerOf(const grpc::CallbackServerContext& call) {
  return listen::PeerName(call.peer());
}

absl::StatusOr<access::Caller> Authorise(ServiceContext& context,
                                         const grpc::CallbackServerContext& call,
                                         access::Scope scope, const char* method) {
  if (context.access == nullptr)
    return access::Caller{.who = "anybody", .scopes = access::Scopes::All()};
  absl::StatusOr<access::Caller> caller = Identified(context, call, scope);
  if (!caller.ok()) {
    ++context.counters.calls_turned_away;
    context.turned_away_gate.Log(Logger::Level::kWarn, "turned away",
                                 absl::StrCat(PeerOf(call), " ", method),
                                 std::string(caller.status().message()));
  }
  return caller;
}

}  // namespace voxeld::daemon::services
