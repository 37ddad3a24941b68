#include "daemon/services/grpc_log.h"

#include <grpc/support/log.h>

#include <string>
#include <string_view>

#include "absl/strings/str_cat.h"
#include "display/sync/mutex.h"

namespace voxeld::daemon::services {
namespace {

// The single log sink that gRPC supports.
struct Place {
  sync::Mutex mutex;
  listen::LogGate* gate VOXELD_GUARDED_BY(mutex) = nullptr;
};

Place& ThePlace() {
  // Never destroyed, because gRPC's threads may outlive static objects.
  static Place* const place = new Place;
  return *place;
}

void Take(gpr_log_func_args* line) {
  if (line->severity != GPR_LOG_SEVERITY_ERROR) return;
  std::string_view file(line->file);
  if (const size_t slash = file.rfind('/'); slash != std::string_view::npos) {
    file.remove_prefix(slash + 1);
  }
  Place& place = ThePlace();
  sync::MutexLock lock(place.mutex);
  if (place.gate == nullptr) return;
  place.gate->Log(Logger::Level::kDebug, "grpc",
                  absl::StrCat(absl::string_view(file.data(), file.size()), ":", line->line),
                  line->message);
}

}  // namespace

GrpcLog::GrpcLog(listen::LogGate& gate) : gate_(gate) {
  {
    Place& place = ThePlace();
    sync::MutexLock lock(place.mutex);
    place.gate = &gate;
  }
  gpr_set_log_function(&Take);
}

GrpcLog::~GrpcLog() {
  Place& place = ThePlace();
  sync::MutexLock lock(place.mutex);
  if (place.gate == &gate_) place.gate = nullptr;
}

}  // namespace voxeld::daemon::services
