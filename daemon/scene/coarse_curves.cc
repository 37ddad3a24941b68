// The part of CommitApplier that reports curves that may be drawn more coarsely than their error
// bound.
#include <optional>
#include <string>
#include <utility>

#include "absl/strings/str_format.h"
#include "daemon/scene/commit_applier.h"

namespace voxeld::daemon {

std::optional<Issue> CommitApplier::CoarseOf(const Content& content, const gpu::Affine& map,
                                             int* left) const {
  if (const auto* instance = std::get_if<InstanceRef>(&content)) {
    const Object* object = draft_.FindObject(Key(instance->object));
    if (object == nullptr) return std::nullopt;
    for (const ObjectPart& part : object->data->parts) {
      // Empty objects count as well.
      if ((*left)-- <= 0) return std::nullopt;
      auto found = CoarseOf(part.content, gpu::Compose(map, part.transform), left);
      if (found.has_value()) return found;
    }
    return std::nullopt;
  }
  if (const auto* group = std::get_if<GroupPtr>(&content)) {
    for (const GroupData::Part& part : (*group)->parts) {
      if ((*left)-- <= 0) return std::nullopt;
      auto found = CoarseOf(part.geometry, gpu::Compose(map, part.transform), left);
      if (found.has_value()) return found;
    }
    return std::nullopt;
  }
  const gpu::CutNeed& need = std::get<GeometryPtr>(content)->need;
  if (need.count == 0) return std::nullopt;
  for (const DisplayView& view : views_) {
    const double stretch = gpu::StretchOf(gpu::Compose(view.scene_to_voxel, map));
    if (need.IsMet(stretch)) continue;
    const bool patches = need.kind == gpu::PrimitiveKind::kPatches;
    Issue issue;
    issue.reason = Reason::kQuotaExceeded;
    issue.applied = true;
    issue.message = absl::StrFormat(
        "takes up to %.0f %s on display \"%s\" to be within %g of a voxel; %d are made%s, so it "
        "may "
        "be drawn coarser: put it up as several entities, or smaller",
        need.Pieces(stretch), patches ? "vertices" : "straight pieces", view.display,
        patches ? gpu::kPatchError : gpu::kCurveError, gpu::CutNeed::Most(need.kind),
        patches ? absl::StrFormat(", %d squares along a side", gpu::kMostPatchPieces) : "");
    return issue;
  }
  return std::nullopt;
}

void CommitApplier::TellIfCoarse(const Operation& operation, const std::string& layer,
                                 const std::string& id, const EntityData& entity, const char* field,
                                 int* left) {
  int own = kMostLookedAt;
  const gpu::Affine map = gpu::Compose(draft_.FindLayer(Key(layer))->transform, entity.transform);
  std::optional<Issue> issue = CoarseOf(entity.content, map, left == nullptr ? &own : left);
  if (!issue.has_value()) return;
  if (!std::holds_alternative<GeometryPtr>(entity.content)) {
    issue->message = "a part of it " + issue->message;
  }
  issue->sequence = operation.sequence;
  issue->layer = layer;
  issue->id = id;
  issue->field = field;
  refusals_.Add(*std::move(issue), limits_.max_issues_per_commit);
}

void CommitApplier::TellOfCoarseIn(const Operation& operation, const std::string& name,
                                   const Layer& layer, const char* field) {
  int left = kMostLookedAt;
  layer.entities.ForEachFrom("", [&](const std::string& id, const EntityPtr& entity) {
    TellIfCoarse(operation, name, id, entity->data, field, &left);
    return left-- > 0;
  });
}

}  // namespace voxeld::daemon
