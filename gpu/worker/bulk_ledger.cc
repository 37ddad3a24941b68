#include "gpu/worker/bulk_ledger.h"

#include <cstring>
#include <utility>

namespace voxeld::gpu {
namespace {

// Returns the record at the beginning of `bytes`, if there are enough bytes.
template <typename Record>
bool Read(std::span<const std::byte> bytes, Record* record) {
  if (bytes.size() < sizeof(Record)) return false;
  std::memcpy(static_cast<void*>(record), bytes.data(), sizeof(Record));
  return true;
}

}  // namespace

absl::StatusOr<BulkLedger::Change> BulkLedger::ChangeOf(std::span<const std::byte> delta,
                                                        std::span<const BulkBlock> referred) {
  Change change;
  BlockSource source(referred);
  RecordHeader header{};
  while (Read(delta, &header) && header.size >= sizeof(header) && header.size <= delta.size()) {
    const std::span<const std::byte> body =
        delta.subspan(sizeof(header), header.size - sizeof(header));
    delta = delta.subspan(header.size);
    GeometryRecord geometry;
    BulkRef ref;
    IdRecord id{};
    if (header.op == Op::kReset) {
      change = {.reset = true};
    } else if (header.op == Op::kDropGeometry && Read(body, &id)) {
      change.steps.push_back({.geometry = id.id});
    } else if (header.op == Op::kPutBulkGeometry && Read(body, &geometry) &&
               Read(body.subspan(sizeof(geometry)), &ref)) {
      absl::StatusOr<BulkView> found = source.Find(ref);
      if (!found.ok()) return found.status();
      change.steps.push_back(
          {geometry.id, std::move(found->owner), geometry.drawn_by == DrawnBy::kCpu});
    }
  }
  return change;
}

void BulkLedger::Apply(Change change, bool copies) {
  if (change.reset) held_.clear();
  for (Change::Step& step : change.steps) {
    if (step.block == nullptr) {
      held_.erase(step.geometry);
    } else if (step.by_cpu || !copies) {
      held_[step.geometry] = std::move(step.block);
    }
  }
}

}  // namespace voxeld::gpu
