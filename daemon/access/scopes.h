// What a caller may do.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "absl/status/statusor.h"

namespace voxeld::daemon::access {

enum class Scope : uint8_t {
  kView = 1,     // look: displays, statistics, what is in the scene, what is shown
  kDraw = 2,     // put things into the scene, and take back one's own
  kControl = 4,  // displays' settings, others' layers and quotas, layers that erase
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
  // Whether all of `other` are among them.
  constexpr bool Hold(Scopes other) const { return (bits_ & other.bits_) == other.bits_; }
  constexpr bool empty() const { return bits_ == 0; }
  constexpr bool operator==(const Scopes&) const = default;

  std::string ToString() const;  // "view draw"; "none"
  std::string Sentence() const;  // the same for people: "view, draw and control"

 private:
  explicit constexpr Scopes(uint8_t bits) : bits_(bits) {}
  uint8_t bits_ = 0;
};

const char* ScopeName(Scope scope);

// "view", "draw", "control", separated by spaces or commas; "none", "all". InvalidArgument lists them.
absl::StatusOr<Scopes> ParseScopes(std::string_view text);

}  // namespace voxeld::daemon::access
