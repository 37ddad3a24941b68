#include "tools/voxelctl/connection/owned_layers.h"

#include <iterator>
#include <set>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "common/text/printable.h"

namespace voxeld::voxelctl {
namespace {

constexpr absl::string_view kCommands = "voxelctl ";  // prefix of each command's session name
constexpr size_t kMostNamed = 3;

}  // namespace

bool IsLeftByVoxelctl(const v1::LayerInfo& layer) {
  return layer.orphaned() && absl::StartsWith(layer.client_name(), kCommands);
}

absl::StatusOr<std::vector<OwnedLayer>> LayersLeftBy(absl::string_view client_name,
                                                     Connection& connection) {
  const absl::StatusOr<v1::ListEntitiesResponse> all =
      connection.ListEntities({}, /*first_page_only=*/true);
  if (!all.ok()) return all.status();
  std::vector<OwnedLayer> left;
  for (const v1::LayerInfo& layer : all->layers()) {
    if (layer.orphaned() && layer.client_name() == client_name) {
      left.push_back({layer.owner(), layer.layer()});
    }
  }
  return left;
}

absl::StatusOr<TakenDown> TakeDown(const std::vector<OwnedLayer>& layers, Connection& connection) {
  TakenDown taken;
  for (const OwnedLayer& layer : layers) {
    if (layer.owner == 0) continue;
    v1::ClearLayerRequest request;
    request.set_owner(layer.owner);
    request.set_layer(layer.layer);
    const absl::StatusOr<v1::ClearLayerResponse> cleared = connection.ClearLayer(request);
    if (cleared.ok()) {
      taken.entities += cleared->entities();
      taken.layers += cleared->layers();
    } else if (TakesControl(cleared.status())) {
      taken.stay.push_back(layer);
    } else if (!absl::IsNotFound(cleared.status())) {
      return cleared.status();
    }
  }
  return taken;
}

std::string OthersStay(const std::vector<OwnedLayer>& stay) {
  if (stay.empty()) return "";
  std::set<std::string> named;
  for (const OwnedLayer& layer : stay) {
    named.insert(absl::StrCat("\"", EscapeForTerminal(layer.layer), "\" of owner ", layer.owner));
  }
  const size_t count = named.size();
  const size_t left_out = count > kMostNamed ? count - kMostNamed : 0;
  while (named.size() > kMostNamed) named.erase(std::prev(named.end()));
  return absl::StrCat(
      count == 1 ? "another client's layer stays up: " : "other clients' layers stay up: ",
      absl::StrJoin(named, ", "), left_out > 0 ? absl::StrCat(" and ", left_out, " more") : "",
      "; taking ", count == 1 ? "it" : "them", " down takes the scope control");
}

bool TakesControl(const absl::Status& status) {
  return absl::IsPermissionDenied(status) &&
         absl::StrContains(status.message(), "takes the scope control");
}

}  // namespace voxeld::voxelctl
