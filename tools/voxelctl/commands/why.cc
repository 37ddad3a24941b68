#include <algorithm>
#include <cstddef>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "common/text/printable.h"
#include "common/text/suggest.h"
#include "tools/voxelctl/commands/commands.h"
#include "tools/voxelctl/text/proto_json.h"
#include "tools/voxelctl/text/table.h"

namespace voxeld::voxelctl {
namespace {

constexpr size_t kFew = 12;  // maximum number listed

std::string Quoted(const std::string& name) {
  return absl::StrCat("\"", EscapeForTerminal(name), "\"");
}

std::string Name(const v1::EntityKey& key) {
  return absl::StrCat(Quoted(key.id()), " in layer ", Quoted(key.layer()), " of owner ",
                      key.owner());
}

// Returns the one entity that the options select.
absl::StatusOr<v1::EntityKey> Find(const WhyOptions& options, Connection& connection) {
  v1::ListEntitiesRequest request;
  request.set_owner(options.owner);
  request.set_layer(options.layer);
  request.set_id_prefix(options.id);
  const auto matching = connection.ListEntities(request);
  if (!matching.ok()) return matching.status();
  std::vector<v1::EntityKey> found;
  for (const v1::EntityInfo& entity : matching->entities()) {
    if (entity.key().id() == options.id) found.push_back(entity.key());
  }
  if (found.size() == 1) return found.front();
  if (found.size() > 1) {
    const size_t told = std::min(found.size(), kFew);
    const std::string names =
        absl::StrJoin(found.begin(), found.begin() + static_cast<ptrdiff_t>(told), ", ",
                      [](std::string* out, const v1::EntityKey& key) { out->append(Name(key)); });
    return absl::InvalidArgumentError(
        absl::StrCat(found.size(), " entities have this id: ", names,
                     told < found.size() ? absl::StrCat(" and ", found.size() - told, " more") : "",
                     "; say which by --layer or --owner"));
  }
  request.clear_id_prefix();
  request.set_page_size(1000);
  const auto all = connection.ListEntities(request);
  if (!all.ok()) return all.status();
  std::vector<std::string> ids;
  for (const v1::EntityInfo& entity : all->entities()) ids.push_back(entity.key().id());
  const std::string nearest = Nearest(options.id, ids);
  std::string hint;
  if (!nearest.empty()) {
    hint = absl::StrCat("; did you mean ", Quoted(nearest), "?");
  } else if (ids.size() <= kFew && !ids.empty()) {
    hint = absl::StrCat("; there ", ids.size() == 1 ? "is " : "are ",
                        absl::StrJoin(ids, ", ", [](std::string* out, const std::string& id) {
                          out->append(Quoted(id));
                        }));
  }
  return absl::NotFoundError(absl::StrCat(
      "no entity \"", EscapeForTerminal(options.id), "\" is in the scene",
      options.layer.empty() && options.owner == 0 ? "" : ", as far as you asked",
      nearest.empty() ? ": it has expired, was taken down, or its commit has not come" : "", hint));
}

}  // namespace

absl::Status Why(const WhyOptions& options, Connection& connection, Console& console) {
  const absl::StatusOr<v1::EntityKey> key = Find(options, connection);
  if (!key.ok()) return key.status();
  v1::ExplainEntityRequest request;
  *request.mutable_key() = *key;
  request.set_display(options.display);
  const absl::StatusOr<v1::ExplainEntityResponse> answer = connection.ExplainEntity(request);
  if (!answer.ok()) return answer.status();
  if (console.json()) {
    console.Data(JsonText(ToJson(*answer), false));
    return absl::OkStatus();
  }
  const v1::EntityInfo& info = answer->info();
  std::string text = absl::StrCat(info.kind(), " ", Name(info.key()), ", on display \"",
                                  EscapeForTerminal(answer->display()), "\":\n",
                                  EscapeForTerminal(answer->text()), "\n");
  absl::StrAppend(&text, "voxels that it covers ", Grouped(answer->covered_voxels()),
                  "; that it lights ", Grouped(answer->lit_voxels()), "; that clip and mask leave ",
                  Grouped(answer->left_voxels()), "; that it changes ",
                  Grouped(answer->seen_voxels()), "\n");
  console.Data(text);
  return absl::OkStatus();
}

}  // namespace voxeld::voxelctl
