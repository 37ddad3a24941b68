// What a session has up, as far as the server has accepted it: to send it again to one that has lost
// it. Knows no gRPC. Payloads are shared with those who made them.
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "client/cpp/src/operation.h"

namespace voxeld::client {

class RetainedBook {
 public:
  // What `operations` did, less what was refused of them. `now_ns`: for lifetimes; what is over by then
  // is forgotten. Nothing is taken to have been done before what is in doubt.
  void Apply(const std::vector<Operation>& operations, const Refusals& refusals, int64_t now_ns);

  // The commit `frame` was applied or refused, and which is not known yet: it keeps its place.
  void Doubt(uint64_t frame, const std::vector<Operation>& operations, int64_t now_ns);
  // It was applied. Nothing happens if it is not in doubt.
  void WasApplied(uint64_t frame);
  // What is still in doubt was not, as far as will ever be known.
  void EndDoubts();

  // Operations that put up all of it on an empty server: objects before those that use them, layers
  // in the order of their creation. Lifetimes are what is left of them.
  std::vector<Operation> Restore(int64_t now_ns) const;

  size_t entities() const;

 private:
  struct Entity {
    UpsertOperation upsert;
    uint64_t number = 0;  // of insertion
    int64_t expires_ns = 0;
  };
  struct Layer {
    LayerLook look;
    std::map<std::string, Entity> entities;
    uint64_t number = 0;
  };
  struct Waiting {
    uint64_t frame = 0;
    bool doubtful = false;
    std::vector<Operation> operations;
    Refusals refusals;
    int64_t now_ns = 0;
  };
  struct Expiry {
    int64_t expires_ns = 0;
    uint64_t number = 0;  // of the entity, if it has not been replaced since
    std::string layer, id;
    bool operator>(const Expiry& other) const { return expires_ns > other.expires_ns; }
  };
  struct Applier;

  void ApplyNow(const std::vector<Operation>& operations, const Refusals& refusals, int64_t now_ns);
  void ApplyUpToDoubt();
  Layer& LayerOf(const std::string& name);
  void Put(const UpsertOperation& upsert, int64_t now_ns);
  bool IsThere(const Expiry& expiry) const;
  void Expire(int64_t now_ns);
  void RemoveInstancesOf(const std::string& object);
  void AddObject(const std::string& name, std::map<std::string, bool>* added,
                 std::vector<Operation>* out) const;

  std::map<std::string, Layer> layers_;
  std::map<std::string, DefineOperation> objects_;
  uint64_t next_number_ = 1;
  std::deque<Waiting> waiting_;   // the first is in doubt
  std::vector<Expiry> expiries_;  // a heap, the next first; some of entities that are gone
  size_t most_expiries_ = 64;     // beyond, those are looked for
};

}  // namespace voxeld::client
