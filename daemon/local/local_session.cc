#include "daemon/local/local_session.h"

#include "absl/status/statusor.h"

namespace voxeld::daemon::local {

LocalSession::LocalSession(const LocalSocket* socket, SessionId session) {
  if (socket == nullptr) return;
  absl::StatusOr<Tokens::Registered> registered = socket->tokens()->Register(session);
  if (!registered.ok()) return;
  tokens_ = socket->tokens();
  path_ = socket->address().path;
  token_ = std::move(registered->token);
  memory_ = std::move(registered->memory);
}

void LocalSession::Close() {
  if (const auto tokens = std::exchange(tokens_, nullptr)) tokens->Unregister(token_);
}

}  // namespace voxeld::daemon::local
