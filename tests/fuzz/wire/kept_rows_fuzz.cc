// Rows of the state file from any source: refused with a reason, or written again to the same row.

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <variant>

#include "daemon/scene/commit_applier.h"
#include "daemon/scene/scene_store.h"
#include "daemon/text/fonts.h"
#include "daemon/wire/kept.h"
#include "tests/fuzz/exchanges.h"
#include "tests/fuzz/expect.h"
#include "tests/fuzz/script.h"

namespace voxeld::fuzz {
namespace {

using namespace voxeld::daemon;  // NOLINT(google-build-using-namespace)

void Refused(const absl::Status& status) {
  EXPECT_THAT_HOLDS(absl::IsDataLoss(status) || absl::IsInvalidArgument(status), status.ToString());
  ExpectSays(status);
  CountExchange(ExchangeKind::kKeptRow, false);
}

// Returns the layer's row in a scene to which the operation is applied; nullopt if it is refused.
std::optional<std::string> KeptWhenApplied(const Operation& operation, const Limits& limits) {
  SceneStore store(limits);
  Author author;
  author.owner = 1;
  auto writer = std::make_shared<Writer>();
  writer->session = 1;
  author.writer = std::move(writer);
  store.Apply(author, {operation}, sync::kSecond, false, 0);
  const OwnedName key{1, std::get<LayerState>(operation.op).layer};
  const Layer* const layer = store.snapshot()->FindLayer(key);
  if (layer == nullptr) return std::nullopt;
  return wire::EncodeKept(key, *layer);
}

void Run(Script script) {
  static text::Fonts fonts;
  Limits limits;
  limits.max_vertices_per_entity = 2048;
  limits.max_indices_per_entity = 4096;
  limits.max_expression_nodes = 128;
  limits.max_texture_texels = 64 << 10;
  limits.max_parts_per_object = 64;
  const uint8_t what = script.Byte() % 4;
  const wire::TwoClocks now{.monotonic_ns = 5 * sync::kSecond,
                            .unix_ns = 1'700'000'000'000'000'000 + script.Byte() * sync::kSecond};
  const auto rest = script.Rest();
  const std::string bytes(rest.begin(), rest.end());
  switch (what) {
    case 0: {
      const auto owner = wire::DecodeKeptOwner(bytes);
      if (!owner.ok()) return Refused(owner.status());
      CountExchange(ExchangeKind::kKeptRow, true);
      const auto again = wire::DecodeKeptOwner(wire::EncodeKept(*owner));
      EXPECT_THAT_HOLDS(again.ok() && wire::EncodeKept(*again) == wire::EncodeKept(*owner));
      break;
    }
    case 1: {
      const auto layer = wire::DecodeKeptLayer(bytes, limits);
      if (!layer.ok()) return Refused(layer.status());
      CountExchange(ExchangeKind::kKeptRow, true);
      CheckAlone(layer->operation, limits);
      EXPECT_THAT_HOLDS(std::holds_alternative<LayerState>(layer->operation.op));
      const auto once = KeptWhenApplied(layer->operation, limits);
      if (!once.has_value()) break;
      const auto again = wire::DecodeKeptLayer(*once, limits);
      EXPECT_THAT_HOLDS(again.ok(), again.status().ToString());
      EXPECT_THAT_HOLDS(KeptWhenApplied(again->operation, limits) == once,
                        "what is kept of a layer is another when it is read");
      break;
    }
    case 2: {
      const auto object = wire::DecodeKeptObject("object", bytes, limits, nullptr, &fonts);
      if (!object.ok()) return Refused(object.status());
      CountExchange(ExchangeKind::kKeptRow, true);
      const auto* define = std::get_if<DefineObject>(&object->operation.op);
      EXPECT_THAT_HOLDS(define != nullptr && define->data != nullptr);
      CheckAlone(object->operation, limits);
      Object kept;
      kept.data = define->data;
      const std::string once = wire::EncodeKept(kept);
      const auto again = wire::DecodeKeptObject("object", once, limits, nullptr, &fonts);
      EXPECT_THAT_HOLDS(again.ok(), again.status().ToString());
      kept.data = std::get<DefineObject>(again->operation.op).data;
      EXPECT_THAT_HOLDS(wire::EncodeKept(kept) == once);
      EXPECT_THAT_HOLDS(again->refers_to == object->refers_to);
      break;
    }
    default: {
      const auto entity =
          wire::DecodeKeptEntity("layer", "id", bytes, now, limits, nullptr, &fonts);
      if (!entity.ok()) return Refused(entity.status());
      CountExchange(ExchangeKind::kKeptRow, true);
      if (!entity->has_value()) return;
      CheckAlone(**entity, limits);
      const auto* upsert = std::get_if<Upsert>(&(*entity)->op);
      EXPECT_THAT_HOLDS(upsert != nullptr);
      Entity kept;
      kept.data = upsert->entity;
      if (kept.data.lifetime_ns > 0) kept.expires_ns = now.monotonic_ns + kept.data.lifetime_ns;
      const auto once = wire::EncodeKept(kept, now);
      EXPECT_THAT_HOLDS(once.ok(), once.status().ToString());
      const auto again = wire::DecodeKeptEntity("layer", "id", *once, now, limits, nullptr, &fonts);
      EXPECT_THAT_HOLDS(again.ok() && again->has_value(), again.status().ToString());
      kept.data = std::get<Upsert>((*again)->op).entity;
      EXPECT_THAT_HOLDS(*wire::EncodeKept(kept, now) == *once);
      break;
    }
  }
}

}  // namespace
}  // namespace voxeld::fuzz

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  voxeld::fuzz::Run(voxeld::fuzz::Script(data, size));
  return 0;
}
