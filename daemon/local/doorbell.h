// Wakes a thread that waits for descriptors.
#pragma once

#include <memory>

#include "absl/status/statusor.h"
#include "daemon/address/descriptor.h"

namespace voxeld::daemon::local {

// Thread-safe.
class Doorbell {
 public:
  // ResourceExhausted if there is no descriptor left.
  static absl::StatusOr<std::shared_ptr<Doorbell>> Make();

  void Ring() const;
  void Quiet() const;                                   // until the next Ring
  int descriptor() const { return descriptor_.get(); }  // readable once rung

 private:
  explicit Doorbell(Descriptor descriptor) : descriptor_(std::move(descriptor)) {}

  const Descriptor descriptor_;
};

}  // namespace voxeld::daemon::local
