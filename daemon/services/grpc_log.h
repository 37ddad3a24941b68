// Redirects gRPC's own lines on stderr, whose number strangers control: each failed handshake is
// one.
#pragma once

#include "daemon/listen/log_gate.h"

namespace voxeld::daemon::services {

// While an object exists, gRPC's errors go to the daemon's log ("grpc", at debug), as often as the
// gate allows; without one they are dropped. gRPC has one sink per process: the newest object is
// used.
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
