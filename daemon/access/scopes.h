// Scopes: the permissions of a caller.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "absl/status/statusor.h"

namespace voxeld::daemon::access {

enum class Scope : uint8_t {
  kView = 1,     // read displays, statistics, the scene and what is shown
  kDraw = 2,     // add to the scene, and remove what one has added
  kControl = 4,  // change displays' settings, others' layers and quotas, and layers that erase
};

class Scopes {
 public:
  constexpr Scopes() = default;
  static constexpr Scopes All() { return Scopes(7); }

  constexpr Scopes& Add(Scope scope) {
    bits_ |= static_cast<uint8_t>(scope);
    return *this;
  }
  constexpr bool Has(Scope scope) const { return (bits_ & static_cast<uint8_t>(scope)) != 0; }
  // Returns: whether this set contains all of `other`.
  constexpr bool Hold(Scopes other) const { return (bits_ & other.bits_) == other.bits_; }
  constexpr bool empty() const { return bits_ == 0; }
  constexpr bool operator==(const Scopes&) const = default;

  std::string ToString() const;  // "view draw" or "none"
  std::string Sentence() const;  // the same in prose: "view, draw and control"

 private:
  explicit constexpr Scopes(uint8_t bits) : bits_(bits) {}
  uint8_t bits_ = 0;
};

const char* ScopeName(Scope scope);

// Parses "view", "draw" and "control", separated by spaces or commas, or "none" or "all". Errors:
// InvalidArgument, which lists the valid words.
absl::StatusOr<Scopes> ParseScopes(std::string_view text);

}  // namespace voxeld::daemon::access
