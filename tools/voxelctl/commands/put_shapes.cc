#include "tools/voxelctl/commands/put_shapes.h"

#include <vector>

#include "absl/strings/str_cat.h"
#include "tools/voxelctl/commands/commands.h"
#include "tools/voxelctl/commands/end_patterns.h"
#include "tools/voxelctl/commands/own_layer.h"
#include "tools/voxelctl/text/escape.h"

namespace voxeld::voxelctl {

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
