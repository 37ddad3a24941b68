// The retained state of a session, as far as the server has accepted it, for restoring it on a
// server that has lost it. Does not depend on gRPC. Payloads are shared with their owners.
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
  // Applies `operations` except those in `refusals`. Lifetimes are relative to `now_ns`; expired
  // entities are forgotten. While earlier commits are in doubt, later ones wait behind them.
  void Apply(const std::vector<Operation>& operations, const Refusals& refusals, int64_t now_ns);

  // The commit `frame` was applied or refused, but it is not known yet which: it keeps its place.
  void Doubt(uint64_t frame, const std::vector<Operation>& operations, int64_t now_ns);
  // The commit was applied. Does nothing if it is not in doubt.
  void WasApplied(uint64_t frame);
  // Treats the commits still in doubt as not applied, since no answer will come.
  void EndDoubts();

  // Returns operations that restore the whole state on an empty server: objects before those that
  // use them, layers in the order of their creation. Lifetimes are the remaining ones.
  std::vector<Operation> Restore(int64_t now_ns) const;

  size_t entities() const;

 private:
  struct Entity {
    UpsertOperation upsert;
    uint64_t number = 0;  // order of insertion
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
    uint64_t number = 0;  // the entity's, if it has not been replaced since
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
  std::deque<Waiting> waiting_;  // the first is in doubt
  // a heap, the next to expire first; some belong to removed entities
  std::vector<Expiry> expiries_;
  size_t most_expiries_ = 64;  // beyond this size, entries of removed entities are purged
};

}  // namespace voxeld::client
