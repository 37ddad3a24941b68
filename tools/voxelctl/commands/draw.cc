#include "absl/algorithm/container.h"
#include "absl/strings/str_cat.h"
#include "tools/voxelctl/commands/commands.h"
#include "tools/voxelctl/commands/not_showing.h"
#include "tools/voxelctl/commands/put_shapes.h"
#include "tools/voxelctl/shape/as_typed.h"
#include "tools/voxelctl/shape/drawing.h"
#include "tools/voxelctl/text/proto_json.h"
#include "tools/voxelctl/text/table.h"

namespace voxeld::voxelctl {

absl::Status Draw(const DrawOptions& options, const Connector& connect, Console& console) {
  const absl::StatusOr<v1::ApplyUpdateRequest> request = ShapesRequest(options.shapes);
  if (!request.ok()) return request.status();
  absl::StatusOr<std::unique_ptr<Connection>> connected = connect();
  if (!connected.ok()) return connected.status();
  const absl::StatusOr<ShapesPut> put = PutShapes(*request, options.add, **connected);
  if (!put.ok()) return AsTyped(put.status(), options.shapes);
  const int64_t shapes =
      absl::c_count_if(request->operations(), [](const v1::StreamRequest& operation) {
        return operation.has_upsert() && operation.upsert().layer() == kLayer;
      });
  std::vector<std::string> ids;
  for (const v1::StreamRequest& operation : request->operations()) {
    if (operation.has_upsert() && operation.upsert().layer() == kLayer)
      ids.push_back(operation.upsert().id());
  }
  const std::vector<std::string> unseen = Unseen(put->owner, kLayer, ids, **connected);
  if (console.json()) {
    console.Data(JsonText({{"layer", kLayer},
                           {"shapes", shapes},
                           {"snapshot", put->snapshot},
                           {"notes", put->notes},
                           {"stay", put->stay},
                           {"unseen", unseen},
                           {"not_showing", put->not_showing}},
                          false));
    return absl::OkStatus();
  }
  for (const std::string& note : put->notes) console.Say(note);
  for (const std::string& sentence : put->stay) console.Say(sentence);
  console.Say(
      absl::StrCat(Counted(static_cast<uint64_t>(shapes), "shape"), " up, in the layer \"", kLayer,
                   "\"; `voxelctl snapshot OUT.png` shows what the display shows, `voxelctl "
                   "clear` takes it down"));
  for (const std::string& sentence : unseen) console.Say(sentence);
  for (const std::string& sentence : put->not_showing) console.Say(sentence);
  return absl::OkStatus();
}

}  // namespace voxeld::voxelctl
