#include "daemon/wire/watch_messages.h"

#include <utility>

#include "absl/strings/str_cat.h"
#include "daemon/core/scene_info.h"
#include "daemon/wire/check.h"
#include "daemon/wire/encode.h"
#include "daemon/wire/encode_primitive.h"
#include "voxeld/v1/scene.pb.h"

namespace voxeld::daemon::wire {
namespace {

// Protobuf's own limit is 2 GiB; this leaves room for the rest of the message.
constexpr uint64_t kMostContentBytes = (uint64_t{2} << 30) - (uint64_t{1} << 20);

// Size of the tag and length of an element of a repeated message.
constexpr size_t kFieldBytes = 6;

class Filler final : public SceneChangeVisitor {
 public:
  Filler(bool contents, size_t message_bytes, v1::WatchSceneResponse* out)
      : contents_(contents), message_bytes_(message_bytes), out_(out) {}

  const absl::Status& status() const { return status_; }

  bool OnObject(const OwnedName& key, const Object& object) override {
    if (!Fits(EncodedBytes(*object.data), "object", key.name)) return false;
    v1::WatchedObject* to = out_->add_objects();
    KeyToWire(key, to->mutable_key());
    Encode(*object.data, to->mutable_definition());
    return Added(*to);
  }

  bool OnRemovedObject(const OwnedName& key) override {
    v1::ObjectKey* to = out_->add_removed_objects();
    KeyToWire(key, to);
    return Added(*to);
  }

  bool OnLayer(const OwnedName& key, const Layer& layer) override {
    LayerInfo info = InfoOf(key, layer);
    info.entities = 0;
    info.bytes = 0;
    v1::LayerInfo* to = out_->add_layers();
    Encode(info, to);
    return Added(*to);
  }

  bool OnRemovedLayer(const OwnedName& key) override {
    v1::LayerKey* to = out_->add_removed_layers();
    to->set_owner(key.owner);
    to->set_layer(key.name);
    return Added(*to);
  }

  bool OnEntity(const OwnedName& layer, const std::string& id, const Entity& entity) override {
    if (contents_ && !Fits(EncodedBytes(entity.data.content), "entity", id)) return false;
    v1::WatchedEntity* to = out_->add_entities();
    Encode(InfoOf(layer, id, entity), to->mutable_info());
    if (contents_) Encode(entity.data.content, to->mutable_primitive());
    return Added(*to);
  }

  bool OnRemovedEntity(const OwnedName& layer, const std::string& id) override {
    v1::EntityKey* to = out_->add_removed_entities();
    Encode(EntityKey{layer.owner, layer.name, id}, to);
    return Added(*to);
  }

 private:
  static void KeyToWire(const OwnedName& key, v1::ObjectKey* out) {
    out->set_owner(key.owner);
    out->set_object(key.name);
  }

  bool Fits(uint64_t bytes, const char* what, const std::string& name) {
    if (bytes <= kMostContentBytes) return true;
    status_ = absl::FailedPreconditionError(
        absl::StrCat("the contents of the ", what, " ", Quote(name), " are ", bytes,
                     " bytes; a message holds ", kMostContentBytes, ": watch without contents"));
    return false;
  }

  template <typename Message>
  bool Added(const Message& message) {
    bytes_ += message.ByteSizeLong() + kFieldBytes;
    return bytes_ < message_bytes_;
  }

  const bool contents_;
  const size_t message_bytes_;
  v1::WatchSceneResponse* const out_;
  size_t bytes_ = 0;
  absl::Status status_;
};

}  // namespace

WatchMessages::WatchMessages(const v1::WatchSceneRequest& request, size_t message_bytes)
    : contents_(request.contents()),
      message_bytes_(message_bytes),
      filter_{request.owner(), request.layer(), request.contents()} {}

void WatchMessages::Begin(SnapshotPtr target) {
  target_ = std::move(target);
  changes_.emplace(filter_, told_, target_);
}

absl::Status WatchMessages::Next(v1::WatchSceneResponse* out) {
  out->Clear();
  Filler filler(contents_, message_bytes_, out);
  const bool whole = changes_->Next(filler);
  if (!filler.status().ok()) return filler.status();
  if (!whole) return absl::OkStatus();
  out->set_in_sync(target_->number);
  changes_.reset();
  told_ = std::move(target_);
  return absl::OkStatus();
}

}  // namespace voxeld::daemon::wire
