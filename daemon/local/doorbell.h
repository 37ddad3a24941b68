// Wakes a thread that polls descriptors.
#pragma once

#include <memory>

#include "absl/status/statusor.h"
#include "daemon/address/descriptor.h"

namespace voxeld::daemon::local {

// Thread-safe.
class Doorbell {
 public:
  // Errors: ResourceExhausted if no descriptor is left.
  static absl::StatusOr<std::shared_ptr<Doorbell>> Make();

  void Ring() const;
  void Quiet() const;                                   // resets it until the next Ring
  int descriptor() const { return descriptor_.get(); }  // readable after Ring

 private:
  explicit Doorbell(Descriptor descriptor) : descriptor_(std::move(descriptor)) {}

  const Descriptor descriptor_;
};

}  // namespace voxeld::daemon::local
