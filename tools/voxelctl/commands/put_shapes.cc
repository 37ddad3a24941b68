#include "tools/voxelctl/commands/put_shapes.h"

#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "tools/voxelctl/commands/commands.h"
#include "tools/voxelctl/commands/end_patterns.h"
#include "tools/voxelctl/commands/own_layer.h"
#include "tools/voxelctl/shape/shape_text.h"
#include "tools/voxelctl/text/escape.h"

namespace voxeld::voxelctl {
namespace {

constexpr size_t kLabelBytes = 200;

}  // namespace

absl::StatusOr<v1::ApplyUpdateRequest> ShapesRequest(std::span<const std::string> shapes) {
  v1::ApplyUpdateRequest request;
  request.mutable_open()->set_client_name("voxelctl draw");
  request.mutable_open()->set_strict(true);
  std::vector<std::string> errors;
  for (size_t i = 0; i < shapes.size(); ++i) {
    absl::StatusOr<v1::Entity> entity = ParseShapeText(shapes[i]);
    if (!entity.ok()) {
      errors.push_back(
          absl::StrCat("\"", EscapeForTerminal(shapes[i]), "\": ", entity.status().message()));
      continue;
    }
    if (entity->label().empty() && shapes[i].size() <= kLabelBytes) entity->set_label(shapes[i]);
    v1::Upsert* const upsert = request.add_operations()->mutable_upsert();
    upsert->set_layer(kLayer);
    upsert->set_id(absl::StrCat("draw ", i + 1));
    *upsert->mutable_entity() = *std::move(entity);
  }
  if (!errors.empty()) return absl::InvalidArgumentError(absl::StrJoin(errors, "\n"));
  return request;
}

absl::StatusOr<ShapesPut> PutShapes(const v1::ApplyUpdateRequest& request, bool add,
                                    Connection& connection) {
  absl::StatusOr<std::vector<uint64_t>> before = std::vector<uint64_t>();
  if (!add) before = OwnersBefore(connection);
  if (!before.ok()) return before.status();
  const absl::StatusOr<v1::ApplyUpdateResponse> applied = connection.ApplyUpdate(request);
  if (!applied.ok()) return applied.status();
  if (absl::Status status = TakeDown(*before, connection); !status.ok()) return status;
  // A test pattern would hide them.
  const absl::StatusOr<std::vector<std::string>> patterns = EndPatterns(connection);
  if (!patterns.ok()) return patterns.status();
  ShapesPut put{.snapshot = applied->snapshot()};
  for (const v1::Issue& issue : applied->issues()) {
    put.notes.push_back(EscapeForTerminal(absl::StrCat("\"", issue.id(), "\": ", issue.message())));
  }
  return put;
}

}  // namespace voxeld::voxelctl
