#include "daemon/viewer/viewer_socket.h"

#include <google/protobuf/util/json_util.h>

#include <array>
#include <nlohmann/json.hpp>
#include <optional>
#include <utility>

#include "absl/strings/str_cat.h"
#include "daemon/core/volume_feed.h"
#include "daemon/viewer/page_message.h"
#include "daemon/viewer/volume_message.h"
#include "daemon/wire/encode.h"
#include "voxeld/v1/display.pb.h"
#include "voxeld/v1/scene.pb.h"

namespace voxeld::daemon::viewer {
namespace {

using Json = nlohmann::json;

constexpr size_t kMostWatches = 16;
constexpr size_t kMostWatchesInAll = 64;

std::string ToJson(const google::protobuf::Message& message) {
  google::protobuf::util::JsonPrintOptions options;
  options.preserve_proto_field_names = true;
  options.always_print_primitive_fields = true;
  std::string text;
  if (!google::protobuf::util::MessageToJsonString(message, &text, options).ok()) return "null";
  return text;
}

// Returns: what a page needs to know about the display, without the positions of a lattice's
// lights.
std::string DisplayJson(const DisplayDescription& display) {
  v1::DisplayDescription message;
  wire::Encode(display, &message);
  if (message.geometry().has_lattice()) {
    v1::Lattice* lattice = message.mutable_geometry()->mutable_lattice();
    lattice->clear_pixels();
    lattice->clear_x_mm();
    lattice->clear_y_mm();
    lattice->clear_z_mm();
  }
  message.mutable_geometry()->clear_correction();
  return ToJson(message);
}

Json VecJson(const display::Vec3& v) { return Json::array({v.x, v.y, v.z}); }

Json ComparedJson(uint16_t id, uint64_t volume, const Comparison& comparison) {
  return {{"id", id},
          {"volume", std::to_string(volume)},
          {"low_mm", VecJson(comparison.box.low_mm)},
          {"high_mm", VecJson(comparison.box.high_mm)},
          {"pitch_mm", comparison.pitch_mm},
          {"voxels", comparison.voxels},
          {"missing", comparison.missing},
          {"pixels", comparison.pixels},
          {"stray", comparison.stray},
          {"off", comparison.off},
          {"mean", comparison.mean},
          {"most", comparison.most}};
}

std::string Text(const Json& json) {
  return json.dump(-1, ' ', false, Json::error_handler_t::replace);
}

class ViewerSocket : public std::enable_shared_from_this<ViewerSocket> {
 public:
  ViewerSocket(std::shared_ptr<ViewerShared> shared, std::shared_ptr<http::WebSocketPeer> peer,
               bool control)
      : shared_(std::move(shared)), peer_(std::move(peer)), control_(control) {}
  ~ViewerSocket() { shared_->watches -= watches_.size(); }

  void OnText(const std::string& text) {
    absl::StatusOr<page::Message> message = page::Read(text, control_);
    if (!message.ok()) return Complain(std::string(message.status().message()));
    std::visit([this](const auto& what) { On(what); }, *message);
  }

 private:
  // Kinds of requests of which one runs at a time. A second one is ignored meanwhile.
  enum class Asked : uint8_t { kHello, kStats, kLayers, kCompare };
  bool Begin(Asked what) { return !std::exchange(asked_[static_cast<size_t>(what)], true); }
  void End(Asked what) { asked_[static_cast<size_t>(what)] = false; }

  struct Watched {
    uint64_t serial = 0;  // distinguishes watches that reuse an id
    std::shared_ptr<const display::DisplayInfo> info;
    std::shared_ptr<PixelPlaces> places;
    std::shared_ptr<VolumeFeed> feed;
  };

  void Complain(const std::string& why) { peer_->Send(Text({{"error", why}}), false); }

  // Returns: a callback that runs `what` with its argument on the HTTP server's thread, if the
  // socket still exists.
  template <typename T>
  Core::Reply<T> Then(std::function<void(ViewerSocket&, absl::StatusOr<T>)> what) {
    return
        [weak = weak_from_this(), peer = peer_, what = std::move(what)](absl::StatusOr<T> value) {
          peer->Post([weak, what, value = std::move(value)]() mutable {
            if (const auto self = weak.lock()) what(*self, std::move(value));
          });
        };
  }

  void On(const page::Hello&) {
    if (!Begin(Asked::kHello)) return;
    using Displays = std::vector<DisplayDescription>;
    shared_->core.ListDisplays(
        Then<Displays>([](ViewerSocket& self, absl::StatusOr<Displays> displays) {
          self.End(Asked::kHello);
          if (!displays.ok()) return self.Complain(std::string(displays.status().message()));
          std::string text =
              absl::StrCat("{\"hello\":{\"version\":", Text(self.shared_->options.version),
                           ",\"control\":", self.control_ ? "true" : "false", ",\"displays\":[");
          for (size_t i = 0; i < displays->size(); ++i) {
            absl::StrAppend(&text, i == 0 ? "" : ",", DisplayJson((*displays)[i]));
          }
          self.peer_->Send(text + "]}}", false);
          if (self.control_) self.shared_->play->Join(self.peer_);
        }));
  }

  void On(const page::Watch& watch) {
    if (watches_.contains(watch.id) || watches_.size() >= kMostWatches) {
      return Complain(absl::StrCat("a page has ", kMostWatches, " watches with different ids"));
    }
    if (shared_->watches >= kMostWatchesInAll) {
      return Complain(absl::StrCat("all pages together have ", kMostWatchesInAll, " watches"));
    }
    ++shared_->watches;
    const uint64_t serial = ++last_serial_;
    watches_[watch.id].serial = serial;
    shared_->core.GetDisplay(
        watch.display,
        Then<DisplayDescription>([id = watch.id, serial](ViewerSocket& self, auto display) {
          self.Start(id, serial, std::move(display));
        }));
  }

  void Start(uint16_t id, uint64_t serial, const absl::StatusOr<DisplayDescription>& display) {
    const auto found = watches_.find(id);
    if (found == watches_.end() || found->second.serial != serial) return;
    if (!display.ok()) return End(id, display.status());
    Watched& watch = found->second;
    watch.info = std::make_shared<const display::DisplayInfo>(display->info);
    watch.places = PlacesOf(*display);
    const PlaceBox& box = watch.places->box();
    peer_->Send(absl::StrCat("{\"watching\":{\"id\":", id, ",\"low_mm\":",
                             Text(VecJson(box.low_mm)), ",\"high_mm\":", Text(VecJson(box.high_mm)),
                             ",\"pitch_mm\":", Text(Json(watch.places->pitch_mm())),
                             ",\"display\":", DisplayJson(*display), "}}"),
                false);
    watch.feed = VolumeFeed::Open(shared_->core, shared_->clock, display->info.name,
                                  [weak = weak_from_this(), peer = peer_, id, serial] {
                                    peer->Post([weak, id, serial] {
                                      const auto self = weak.lock();
                                      if (self != nullptr && self->Has(id, serial)) self->Pump(id);
                                    });
                                  });
  }

  std::shared_ptr<PixelPlaces> PlacesOf(const DisplayDescription& display) {
    std::shared_ptr<PixelPlaces>& known = shared_->places[display.info.name];
    if (known == nullptr) known = std::make_shared<PixelPlaces>(display.info.geometry);
    return known;
  }

  bool Has(uint16_t id, uint64_t serial) const {
    const auto found = watches_.find(id);
    return found != watches_.end() && found->second.serial == serial;
  }

  // Sends the next change, if there is one. Requires: the page is ready for it: it has shown the
  // last change, or none has arrived since it did.
  void Pump(uint16_t id) {
    const Watched& watch = watches_.at(id);
    if (watch.feed == nullptr) return;
    absl::StatusOr<std::optional<VolumeFeed::Change>> change = watch.feed->Take();
    if (!change.ok()) return End(id, change.status());
    if (!change->has_value()) return;
    peer_->Send(VolumeMessage(id, **change, *watch.places), true);
  }

  void On(const page::Shown& shown) {
    if (watches_.contains(shown.id)) Pump(shown.id);  // it may have ended
  }

  void On(const page::Unwatch& unwatch) { Drop(unwatch.id); }

  void Drop(uint16_t id) { shared_->watches -= watches_.erase(id); }

  void End(uint16_t id, const absl::Status& why) {
    Drop(id);
    peer_->Send(Text({{"ended", {{"id", id}, {"why", std::string(why.message())}}}}), false);
  }

  void On(const page::Dark& dark) {
    const auto found = watches_.find(dark.id);
    if (found == watches_.end() || found->second.places == nullptr) return;
    peer_->Send(DarkMessage(dark.id, *found->second.places), true);
  }

  void On(const page::Compare& compare) {
    const auto found = watches_.find(compare.id);
    if (found == watches_.end() || found->second.feed == nullptr) {
      return Compared(compare.id, 0, absl::NotFoundError("there is no such watch"));
    }
    if (!Begin(Asked::kCompare)) {
      return Compared(compare.id, 0,
                      absl::FailedPreconditionError("another is compared for this page"));
    }
    shared_->core.GetShownScene(
        found->second.info->name,
        Then<ShownScene>([id = compare.id, serial = found->second.serial, hidden = compare.without](
                             ViewerSocket& self, absl::StatusOr<ShownScene> shown) {
          self.HoldAgainst(id, serial, hidden, std::move(shown));
        }));
  }

  void HoldAgainst(uint16_t id, uint64_t serial, const std::vector<OwnedName>& hidden,
                   absl::StatusOr<ShownScene> shown) {
    if (shown.ok() && !Has(id, serial)) shown = absl::NotFoundError("there is no such watch");
    if (!shown.ok()) {
      End(Asked::kCompare);
      return Compared(id, 0, shown.status());
    }
    const uint64_t volume = shown->volume.volume;
    const auto& info = watches_[id].info;
    Core::Reply<Comparison> reply =
        Then<Comparison>([id, volume](ViewerSocket& self, const auto& comparison) {
          self.End(Asked::kCompare);
          self.Compared(id, volume, comparison);
        });
    shared_->comparer->Post({info->name, info, *std::move(shown), hidden, std::move(reply)});
  }

  // Every request gets an answer.
  void Compared(uint16_t id, uint64_t volume, const absl::StatusOr<Comparison>& comparison) {
    if (!comparison.ok()) {
      const std::string why(comparison.status().message());
      return peer_->Send(Text({{"compared", {{"id", id}, {"why", why}}}}), false);
    }
    peer_->Send(Text({{"compared", ComparedJson(id, volume, *comparison)}}), false);
    peer_->Send(PointsMessage(MessageKind::kSent, id, volume, comparison->sent), true);
    peer_->Send(PointsMessage(MessageKind::kDifference, id, volume, comparison->difference), true);
  }

  void On(const page::Stats&) {
    if (!Begin(Asked::kStats)) return;
    shared_->core.GetStats(
        Then<daemon::Stats>([](ViewerSocket& self, absl::StatusOr<daemon::Stats> stats) {
          self.End(Asked::kStats);
          if (!stats.ok()) return self.Complain(std::string(stats.status().message()));
          v1::Stats message;
          wire::Encode(*stats, &message);
          self.peer_->Send(absl::StrCat("{\"stats\":", ToJson(message), "}"), false);
        }));
  }

  void On(const page::Layers&) {
    if (!Begin(Asked::kLayers)) return;
    EntityQuery query;
    query.page_size = 1;
    shared_->core.ListEntities(
        query, Then<EntityPage>([](ViewerSocket& self, absl::StatusOr<EntityPage> page) {
          self.End(Asked::kLayers);
          if (!page.ok()) return self.Complain(std::string(page.status().message()));
          page->entities.clear();
          v1::ListEntitiesResponse message;
          wire::Encode(*page, &message);
          self.peer_->Send(absl::StrCat("{\"layers\":", ToJson(message), "}"), false);
        }));
  }

  // Returns: `reply`, preceded by the entry in the audit log, which is written even if the socket
  // no longer exists.
  template <typename Request, typename T>
  Core::Reply<T> Audited(const char* method, const Request& request, Core::Reply<T> reply) {
    return [audit = shared_->options.audit, method, request,
            reply = std::move(reply)](absl::StatusOr<T> value) {
      if (audit != nullptr) {
        audit->Record("page", "http", method, request.ShortDebugString(), value.status());
      }
      reply(std::move(value));
    };
  }

  // Returns: whether a control action is allowed. If not, reports the reason to the page.
  bool MayAct(const char* method, const std::string& what) {
    access::Audit* const audit = shared_->options.audit;
    const absl::Status may = audit == nullptr ? absl::OkStatus() : audit->MayAct();
    if (may.ok()) return true;
    audit->Record("page", "http", method, what, may);
    Complain(std::string(may.message()));
    return false;
  }

  void On(const page::Update& update) {
    const v1::UpdateDisplayRequest& request = update.request;
    if (!MayAct("UpdateDisplay", request.ShortDebugString())) return;
    shared_->core.UpdateDisplay(
        request.name(), update.update,
        Audited("UpdateDisplay", request,
                Then<DisplayDescription>([](ViewerSocket& self, auto display) {
                  if (!display.ok()) return self.Complain(std::string(display.status().message()));
                  self.peer_->Send(absl::StrCat("{\"display\":", DisplayJson(*display), "}"),
                                   false);
                })));
  }

  void On(const page::Clear& clear) {
    const v1::ClearLayerRequest& request = clear.request;
    if (!MayAct("ClearLayer", request.ShortDebugString())) return;
    shared_->core.ClearLayer(
        request.owner(), request.layer(), false, std::nullopt,
        Audited("ClearLayer", request, Then<Cleared>([](ViewerSocket& self, auto cleared) {
                  if (!cleared.ok()) return self.Complain(std::string(cleared.status().message()));
                  self.On(page::Layers{});
                })));
  }

  void On(const page::Stop&) {
    if (MayAct("StopPlaying", "")) shared_->play->Stop();
  }

  const std::shared_ptr<ViewerShared> shared_;
  const std::shared_ptr<http::WebSocketPeer> peer_;
  const bool control_;
  std::map<uint16_t, Watched> watches_;
  uint64_t last_serial_ = 0;
  std::array<bool, 4> asked_{};
};

class Service final : public http::WebSocketService {
 public:
  explicit Service(std::shared_ptr<ViewerSocket> socket) : socket_(std::move(socket)) {}
  void OnText(std::string message) override { socket_->OnText(message); }

 private:
  const std::shared_ptr<ViewerSocket> socket_;  // others hold weak references only
};

}  // namespace

std::unique_ptr<http::WebSocketService> NewViewerSocket(std::shared_ptr<ViewerShared> shared,
                                                        std::shared_ptr<http::WebSocketPeer> peer,
                                                        bool control) {
  return std::make_unique<Service>(
      std::make_shared<ViewerSocket>(std::move(shared), std::move(peer), control));
}

}  // namespace voxeld::daemon::viewer
