// What a session has up, as far as the server has accepted it: to send it again to one that has lost
// it. Knows no gRPC. Payloads are shared with those who made them.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "client/cpp/src/operation.h"
#include "voxeld/receipt.h"

namespace voxeld::client {

class RetainedBook {
 public:
  // What `operations` did, less what `issues` say was refused. `now_ns`: for lifetimes.
  void Apply(const std::vector<Operation>& operations, const std::vector<Issue>& issues,
             int64_t now_ns);

  // Operations that put up all of it on an empty server: objects before those that use them, layers
  // in the order of their creation. Lifetimes are what is left of them.
  std::vector<Operation> Restore(int64_t now_ns) const;

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
  struct Applier;

  Layer& LayerOf(const std::string& name);
  void Put(const UpsertOperation& upsert, int64_t now_ns);
  void RemoveInstancesOf(const std::string& object);
  void AddObject(const std::string& name, std::map<std::string, bool>* added,
                 std::vector<Operation>* out) const;

  std::map<std::string, Layer> layers_;
  std::map<std::string, DefineOperation> objects_;
  uint64_t next_number_ = 1;
};

}  // namespace voxeld::client
