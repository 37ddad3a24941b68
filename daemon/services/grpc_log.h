// gRPC writes lines of its own to stderr, as many as strangers like: a failed handshake is one.
#pragma once

#include "daemon/listen/log_gate.h"

namespace voxeld::daemon::services {

// While it lives gRPC's errors are lines of the daemon's log ("grpc", at debug), as often as the gate
// allows; without one they are nobody's. gRPC has one such place for the whole process: the newest has it.
class GrpcLog {
 public:
  explicit GrpcLog(listen::LogGate& gate);
  ~GrpcLog();
  GrpcLog(const GrpcLog&) = delete;
  GrpcLog& operator=(const GrpcLog&) = delete;

 private:
  listen::LogGate& gate_;
};

}  // namespace voxeld::daemon::services
