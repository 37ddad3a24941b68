// Converts foxglove.SceneUpdate, which robots' programs send to their viewers, to shapes.
//
// Lengths are in the scene's units, and quaternions need not have length 1. Transparency (alpha)
// makes a colour darker, because light cannot occlude.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/statusor.h"
#include "scene_update.pb.h"
#include "voxeld/drawing.h"

namespace voxeld::markers {

struct Piece {
  client::Shape shape;
  client::Look look;
};

struct Pieces {
  std::vector<Piece> pieces;
  // The parts of the entity that are not drawn, and why, for people: "models". Empty if all is
  // drawn.
  std::string left_out;
};

// Maximum number of entities and pieces in one update. ParseSceneUpdate returns InvalidArgument
// beyond it, and for JSON that is deeper than kMaxJsonDepth.
inline constexpr int kMostPieces = 100'000;

// Returns how much the entity counts towards kMostPieces: itself and its pieces.
int64_t CountPieces(const foxglove::SceneEntity& entity);

// Returns the pieces in the order of the message's fields. A piece without content (no points, no
// text) is left out silently.
Pieces PiecesOf(const foxglove::SceneEntity& entity);

// The two encodings of such messages. Errors: InvalidArgument with the reason.
enum class Encoding : uint8_t { kProtobuf, kJson };
absl::StatusOr<foxglove::SceneUpdate> ParseSceneUpdate(std::string_view bytes, Encoding encoding);

}  // namespace voxeld::markers
