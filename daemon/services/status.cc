#include "daemon/services/status.h"

#include <grpcpp/support/status.h>

#include <string>

namespace voxeld::daemon::services {
namespace {

// Trailing metadata of more than 8 KiB makes clients fail the call for a different reason, and
// percent-encoding may triple the size.
constexpr size_t kMessageBytes = 2000;

}  // namespace

grpc::Status ToGrpc(const absl::Status& status) {
  if (status.ok()) return grpc::Status::OK;
  std::string message(status.message());
  if (message.size() > kMessageBytes) {
    size_t size = kMessageBytes;  // at a character boundary
    while (size > 0 && (static_cast<unsigned char>(message[size]) & 0xC0) == 0x80) --size;
    message.resize(size);
    message += "…";
  }
  return {static_cast<grpc::StatusCode>(status.code()), message};
}

}  // namespace voxeld::daemon::services
