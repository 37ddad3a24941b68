#include "tools/voxelctl/demo/stage.h"

#include <algorithm>
#include <utility>

#include "absl/strings/str_cat.h"
#include "tools/voxelctl/scene/pack.h"

namespace voxeld::voxelctl {
namespace {

constexpr uint64_t kMostStaged = 8 << 20;
constexpr sync::TimeNs kLongestAnswer = 30 * sync::kSecond;

}  // namespace

std::string Stage::ObjectName(const std::string& name) const {
  return absl::StrCat(prefix_, "/", name);
}

absl::Status Stage::Put(const std::string& object, std::vector<client::Part> parts,
                        uint64_t bytes) {
  uint64_t most = kMostStaged;
  const uint64_t limit = session_.server().limits.max_uncommitted_bytes;
  if (limit > 0) most = std::min(most, limit);
  const uint64_t staged = session_.client().staged_bytes();
  if (staged > 0 && staged + bytes > most) {
    if (absl::Status status = session_.CommitAndWait(kLongestAnswer); !status.ok()) return status;
  }
  absl::Status status = session_.client().DefineObject(object, std::move(parts));
  if (status.ok()) objects_.push_back(object);
  return status;
}

absl::Status Stage::Define(const std::string& name, const Model& model, const VolumeLook& look) {
  return PackObject(
             model, ObjectName(name), session_.server().limits,
             [this](const std::string& object, std::vector<client::Part> parts, uint64_t bytes) {
               return Put(object, std::move(parts), bytes);
             },
             look)
      .status();
}

absl::Status Stage::Define(const std::string& name, std::vector<client::Part> parts) {
  return Put(ObjectName(name), std::move(parts), 0);
}

absl::Status Stage::RemoveObjects() {
  for (; !objects_.empty(); objects_.pop_back()) {
    absl::Status status = session_.client().RemoveObject(objects_.back());
    if (!status.ok()) return status;
  }
  return absl::OkStatus();
}

}  // namespace voxeld::voxelctl
