#include "tools/voxelctl/commands/put_shapes.h"

#include <algorithm>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "common/text/printable.h"
#include "tools/voxelctl/commands/commands.h"
#include "tools/voxelctl/commands/end_patterns.h"
#include "tools/voxelctl/commands/own_layer.h"
#include "tools/voxelctl/shape/drawing.h"

namespace voxeld::voxelctl {
namespace {

// Returns the same request with the caller's existing layer replaced: with a token, the caller has
// the layer of the previous command.
v1::ApplyUpdateRequest InPlace(const v1::ApplyUpdateRequest& request) {
  v1::ApplyUpdateRequest whole;
  *whole.mutable_open() = request.open();
  std::string frame;
  const auto begin = [&](const std::string& layer) {
    if (frame == layer) return;
    if (!frame.empty()) whole.add_operations()->mutable_frame_end()->set_layer(frame);
    if (!layer.empty()) whole.add_operations()->mutable_frame_begin()->set_layer(layer);
    frame = layer;
  };
  bool masked = false, stated = false;
  for (const v1::StreamRequest& operation : request.operations()) {
    begin(operation.has_upsert() ? operation.upsert().layer() : std::string());
    v1::StreamRequest& added = *whole.add_operations();
    added = operation;
    masked = masked || (operation.has_upsert() && operation.upsert().layer() == kMaskLayer);
    if (operation.has_layer_state() && operation.layer_state().layer() == kLayer) {
      stated = true;
      v1::LayerState& state = *added.mutable_layer_state();
      if (!state.has_mask_layer()) state.set_mask_layer("");
      if (!state.has_clip()) state.mutable_clip();
    }
  }
  begin("");
  if (stated) return whole;
  v1::LayerState& plain = *whole.add_operations()->mutable_layer_state();
  plain.set_layer(kLayer);
  plain.set_mask_layer("");
  plain.mutable_clip();
  return whole;
}

}  // namespace

absl::StatusOr<ShapesPut> PutShapes(const v1::ApplyUpdateRequest& request, bool add,
                                    Connection& connection) {
  absl::StatusOr<std::vector<OwnedLayer>> before = std::vector<OwnedLayer>();
  if (!add) before = DrawnBefore(connection);
  if (!before.ok()) return before.status();
  const absl::StatusOr<v1::ApplyUpdateResponse> applied =
      connection.ApplyUpdate(add ? request : InPlace(request));
  if (!applied.ok()) return applied.status();
  const bool masks = std::any_of(
      request.operations().begin(), request.operations().end(),
      [](const auto& one) { return one.has_upsert() && one.upsert().layer() == kMaskLayer; });
  std::erase_if(*before, [&](const OwnedLayer& layer) {
    return layer.owner == applied->owner() && (masks || layer.layer == kLayer);
  });
  const absl::StatusOr<TakenDown> taken = TakeDown(*before, connection);
  if (!taken.ok()) return taken.status();
  // A test pattern would hide the shapes.
  const absl::StatusOr<EndedPatterns> patterns = EndPatterns(connection);
  if (!patterns.ok()) return patterns.status();
  ShapesPut put{.snapshot = applied->snapshot(), .owner = applied->owner()};
  for (const v1::Issue& issue : applied->issues()) {
    put.notes.push_back(EscapeForTerminal(absl::StrCat("\"", issue.id(), "\": ", issue.message())));
  }
  for (std::string sentence : {OthersStay(taken->stay), PatternsStay(*patterns)}) {
    if (!sentence.empty()) put.stay.push_back(std::move(sentence));
  }
  put.not_showing = patterns->not_showing;
  return put;
}

}  // namespace voxeld::voxelctl
