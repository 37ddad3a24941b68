// A call with an entry in the audit log: who asked for what, and the result.
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

// Copies represent the same call. Report the result to one of them, once.
class Audited {
 public:
  // `without_fields` describes a request in which no field is set.
  Audited(ServiceContext& context, const grpc::CallbackServerContext& call, const char* method,
          const google::protobuf::Message& request, const char* without_fields = "nothing");

  // Sets the caller. Before that, the entry says that the call was rejected.
  void By(const access::Caller& caller) { who_ = caller.who; }

  // Returns: Unavailable if the audit log is required and cannot be written; the call is then refused.
  absl::Status MayAct() const;

  // Writes the entry. Returns: `result`.
  absl::Status Done(const absl::Status& result) const;

  // Returns: `reply`, preceded by writing the entry.
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
