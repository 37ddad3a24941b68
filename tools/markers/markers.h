// foxglove.SceneUpdate as shapes: what robots' programs send to their viewers.
//
// Lengths are the scene's units, quaternions need not be of length 1. What a colour lets through (alpha) it is darker
// by: light covers nothing.
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
  // What of the entity is not drawn, and why, for people: "models". Empty: all is.
  std::string left_out;
};

// Entities and pieces of one update, InvalidArgument of ParseSceneUpdate beyond, as JSON is that is deeper than kMaxJsonDepth.
inline constexpr int kMostPieces = 100'000;

// The entity and what it is made of, as kMostPieces counts.
int64_t CountPieces(const foxglove::SceneEntity& entity);

// In the order of the message's fields. A piece that has nothing in it (no points, no text) is left out without a word.
Pieces PiecesOf(const foxglove::SceneEntity& entity);

// The two ways in which such messages are written. InvalidArgument says what is wrong.
enum class Encoding : uint8_t { kProtobuf, kJson };
absl::StatusOr<foxglove::SceneUpdate> ParseSceneUpdate(std::string_view bytes, Encoding encoding);

}  // namespace voxeld::markers
