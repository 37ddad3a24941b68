// Core's answers about the scene, from the newest snapshot.
#include <algorithm>
#include <utility>

#include "absl/strings/escaping.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_split.h"
#include "daemon/core/core_impl.h"
#include "daemon/core/scene_info.h"
#include "daemon/scene/quoted.h"

namespace voxeld::daemon {
namespace {

constexpr uint32_t kMostPerPage = 1000;

// A token names the last entity of its page, so pages stay whole
// whatever is added or removed in between.
std::string TokenAfter(const EntityKey& key) {
  return absl::StrCat(key.owner, ".", absl::WebSafeBase64Escape(key.layer), ".",
                      absl::WebSafeBase64Escape(key.id));
}

absl::StatusOr<EntityKey> ParseToken(const std::string& token) {
  const std::vector<std::string> parts = absl::StrSplit(token, '.');
  EntityKey key;
  if (parts.size() != 3 || !absl::SimpleAtoi(parts[0], &key.owner) ||
      !absl::WebSafeBase64Unescape(parts[1], &key.layer) ||
      !absl::WebSafeBase64Unescape(parts[2], &key.id)) {
    return absl::InvalidArgumentError(absl::StrCat(
        "page_token is ", Quoted(token), "; it must be empty or the next_page_token of an answer"));
  }
  return key;
}

bool HasPrefix(const std::string& text, const std::string& prefix) {
  return text.compare(0, prefix.size(), prefix) == 0;
}

}  // namespace

void Core::Impl::ListEntities(const EntityQuery& query, const Reply<EntityPage>& reply) const {
  std::optional<EntityKey> after;
  if (!query.page_token.empty()) {
    absl::StatusOr<EntityKey> parsed = ParseToken(query.page_token);
    if (!parsed.ok()) return reply(parsed.status());
    after = *std::move(parsed);
  }
  const size_t page_size =
      query.page_size == 0 ? kMostPerPage : std::min(query.page_size, kMostPerPage);
  const SnapshotPtr scene = store_.snapshot();
  EntityPage page;
  bool more = false;

  scene->layers.ForEach([&](const OwnedName& key, const LayerPtr& layer) {
    if ((query.owner != 0 && key.owner != query.owner) ||
        (!query.layer.empty() && key.name != query.layer)) {
      return;
    }
    if (!after.has_value()) page.layers.push_back(InfoOf(key, *layer));
    if (query.id_prefix.empty()) {
      page.total += layer->entities.size();
    } else {
      layer->entities.ForEachFrom(query.id_prefix, [&](const std::string& id, const EntityPtr&) {
        if (!HasPrefix(id, query.id_prefix)) return false;
        ++page.total;
        return true;
      });
    }
    const OwnedName after_layer =
        after.has_value() ? OwnedName{after->owner, after->layer} : OwnedName{};
    if (more || (after.has_value() && key < after_layer)) return;
    const bool resumes = after.has_value() && key == after_layer;
    const std::string from = resumes ? std::max(query.id_prefix, after->id) : query.id_prefix;
    layer->entities.ForEachFrom(from, [&](const std::string& id, const EntityPtr& entity) {
      if (!HasPrefix(id, query.id_prefix)) return false;
      if (resumes && id <= after->id) return true;
      if (page.entities.size() == page_size) {
        more = true;
        return false;
      }
      page.entities.push_back(InfoOf(key, id, *entity));
      return true;
    });
  });
  if (more) page.next_page_token = TokenAfter(page.entities.back().key);
  reply(std::move(page));
}

void Core::Impl::GetEntity(const EntityKey& key, const Reply<EntityInfo>& reply) const {
  const SnapshotPtr scene = store_.snapshot();
  std::vector<EntityInfo> found;
  const auto look = [&](const OwnedName& layer) {
    if (const EntityPtr entity = scene->FindEntity(layer, key.id)) {
      found.push_back(InfoOf(layer, key.id, *entity));
    }
  };
  if (key.owner != 0) {
    look({key.owner, key.layer});
  } else {
    scene->layers.ForEach([&](const OwnedName& layer, const LayerPtr&) {
      if (layer.name == key.layer) look(layer);
    });
  }
  if (found.empty()) {
    const std::string whose = key.owner == 0 ? "any owner" : absl::StrCat("owner ", key.owner);
    return reply(absl::NotFoundError(absl::StrFormat("no entity %s in layer %s of %s",
                                                     Quoted(key.id), Quoted(key.layer), whose)));
  }
  if (found.size() > 1) {
    return reply(absl::FailedPreconditionError(absl::StrFormat(
        "%d owners have an entity %s in a layer %s, among them %d and %d; say "
        "which owner",
        found.size(), Quoted(key.id), Quoted(key.layer), found[0].key.owner, found[1].key.owner)));
  }
  reply(std::move(found.front()));
}

}  // namespace voxeld::daemon
