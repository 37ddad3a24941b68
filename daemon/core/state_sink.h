// What of the scene outlives the daemon, seen from the core: who writes it down, and what was written.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "daemon/scene/operation.h"
#include "daemon/scene/snapshot.h"

namespace voxeld::daemon {

struct OwnerRecord {
  std::string token;
  std::string principal;  // empty: nobody in particular
  bool hidden = false;
  uint64_t max_bytes = UINT64_MAX, max_entities = UINT64_MAX;  // as an operator set them
  bool operator==(const OwnerRecord&) const = default;
};
using OwnerRecords = std::map<uint64_t, OwnerRecord>;

// Takes the newest state; of those that are offered while it writes only the last is written. It tells
// Core::OnDurable. On the core's thread.
class StateSink {
 public:
  virtual ~StateSink() = default;
  // `at_once`: somebody waits for it to be durable.
  virtual void Offer(SnapshotPtr snapshot, std::shared_ptr<const OwnerRecords> owners,
                     bool at_once) = 0;
};

// What was written, for a core that has not started.
struct RestoredScene {
  // What is applied together: of one owner, as written by a client of that label.
  struct Step {
    uint64_t owner = 0;
    std::string client_name;
    std::vector<Operation> operations;  // layers, objects, entities
  };
  OwnerRecords owners;
  std::vector<Step> steps;
  uint64_t greatest_number = 0;  // of a layer: those to come have greater ones
};

}  // namespace voxeld::daemon
