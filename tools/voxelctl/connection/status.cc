#include "tools/voxelctl/connection/status.h"

#include <grpcpp/support/status.h>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "common/text/printable.h"

namespace voxeld::voxelctl {

absl::Status FromGrpc(const grpc::Status& status, const std::string& address) {
  if (status.ok()) return absl::OkStatus();
  const std::string message = EscapeForTerminal(status.error_message());
  if (status.error_code() == grpc::StatusCode::UNAVAILABLE) {
    return absl::UnavailableError(
        absl::StrCat("voxeld at ", address, " is not available: ", message));
  }
  if (status.error_code() == grpc::StatusCode::DEADLINE_EXCEEDED) {
    return absl::DeadlineExceededError(
        absl::StrCat("voxeld at ", address, " did not answer in time: ", message));
  }
  return {static_cast<absl::StatusCode>(status.error_code()), message};
}

std::string WhyUnreachable(absl::string_view grpc_says, const std::string& address,
                           const client::Credentials& credentials) {
  const std::string said = absl::AsciiStrToLower(grpc_says);
  const auto says = [&](absl::string_view words) { return absl::StrContains(said, words); };
  if (says("dns resolution failed") || says("domain name not found")) {
    return "its host's name is not known to this machine";
  }
  if (says("connection refused")) return "nobody listens there";
  if (says("http1.x server")) {
    return "it answers in HTTP/1.1: it has no room for another connection (max_connections and "
           "max_connections_per_address are its limits), or this is its http port or another "
           "server";
  }
  if (!absl::StartsWith(address, "tls:")) return "nobody listens there, or what does is no voxeld";
  if (says("is not in peer certificate")) {
    return absl::StrCat("its certificate is not for ",
                        credentials.server_name.empty()
                            ? "this host"
                            : absl::StrCat("\"", EscapeForTerminal(credentials.server_name), "\""),
                        "; VOXELD_TLS_NAME says which name it is for");
  }
  if (says("certificate verify failed") || says("certificate_verify_failed")) {
    return credentials.ca.empty()
               ? "its certificate is not by an authority that this machine knows; VOXELD_TLS_CA "
                 "names the file of the one that it is by"
               : absl::StrCat("its certificate is not by the authority in ",
                              EscapeForTerminal(credentials.ca), ", or it has expired");
  }
  return credentials.certificate.empty()
             ? "it ended the connection: it asks for a certificate, and none is given; "
               "VOXELD_TLS_CERT and VOXELD_TLS_KEY name one's files; or what listens there is no "
               "voxeld with TLS"
             : absl::StrCat("it ended the connection: the certificate in ",
                            EscapeForTerminal(credentials.certificate),
                            " is not taken, or what listens there is no voxeld with TLS");
}

absl::Status Unreachable(const std::string& address, const std::string& why) {
  return absl::UnavailableError(
      absl::StrCat("cannot reach voxeld at ", EscapeForTerminal(address), " (", why,
                   "); start it with `voxeld`, or say where it is with --server or "
                   "VOXELD_SERVER"));
}

}  // namespace voxeld::voxelctl
