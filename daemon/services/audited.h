// One call that the audit log has a line of: who asked, for what, and what came of it.
#pragma once

#include <functional>
#include <string>
#include <utility>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "daemon/services/context.h"

namespace google::protobuf {
class Message;
}
namespace grpc {
class CallbackServerContext;
}

namespace voxeld::daemon::services {

// Copies stand for the same call; one of them is told what came of it, once.
class Audited {
 public:
  // `without_fields`: what a request asks for in which none is set.
  Audited(ServiceContext& context, const grpc::CallbackServerContext& call, const char* method,
          const google::protobuf::Message& request, const char* without_fields = "nothing");

  // Names the caller; before that, the entry says that it was turned away.
  void By(const access::Caller& caller) { who_ = caller.who; }

  // Returns: Unavailable if the audit log is required and cannot be written; the call is then refused.
  absl::Status MayAct() const;

  // Writes the line; answers `result`.
  absl::Status Done(const absl::Status& result) const;

  // `reply`, with the line written first.
  template <typename T>
  std::function<void(absl::StatusOr<T>)> Watching(
      std::function<void(absl::StatusOr<T>)> reply) const {
    return [audited = *this, reply = std::move(reply)](absl::StatusOr<T> result) {
      (void)audited.Done(result.status());
      reply(std::move(result));
    };
  }

 private:
  access::Audit* audit_;
  std::string who_ = "turned away", peer_, method_, what_;
};

}  // namespace voxeld::daemon::services
