// The actions on a core as plain data, so that a run can be repeated, shrunk and printed. An action
// is valid whatever came before it; without anything to act on it does nothing.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "daemon/core/core.h"

namespace voxeld::daemon::model {

enum class ActionKind : uint8_t {
  kOpen,
  kResume,
  kSend,
  kClose,
  kCrowd,
  kStep,
  kAdvance,
  kShow,
  kAbort,
  kCable,
  kBlank,
  kPattern,
  kEngineMode,
  kEngineRun,
  kEngineFail,
  kClearLayer,
  kControl,
  kEvict,
};

struct Action {
  ActionKind kind = ActionKind::kStep;
  uint32_t client = 0;  // the place of a stream, or of an owner
  uint32_t chance = 0;  // decides the details
};

// The script of a seed.
struct Script {
  uint32_t seed = 0;
  Limits limits;
  int displays = 1;
  bool settles = true;  // ends once all is shown and all clients have left; else midway
  std::vector<Action> actions;
};

inline constexpr uint32_t kPlaces = 6;

Script MakeScript(uint32_t seed);

// A small, fast source of random numbers; the same on every machine.
class Chance {
 public:
  explicit Chance(uint32_t seed) : state_(seed * 0x9E3779B97F4A7C15ull + 0x632BE59BD9B4E019ull) {}
  uint32_t Next() {
    state_ ^= state_ >> 12;
    state_ ^= state_ << 25;
    state_ ^= state_ >> 27;
    return static_cast<uint32_t>((state_ * 0x2545F4914F6CDD1Dull) >> 32);
  }
  uint32_t Pick(uint32_t n) { return Next() % n; }
  bool OneIn(uint32_t n) { return Pick(n) == 0; }

 private:
  uint64_t state_;
};

OpenOptions RandomOpen(Chance& chance);

// One message: some operations with sequences after `last`, perhaps one or two commits, and the
// refusals of its decoding.
struct RandomMessage {
  std::vector<Operation> operations;
  std::vector<Issue> malformed;
  uint64_t bytes = 0;
  std::string text;  // a readable description
};
// The geometries with which messages draw.
struct Palette {
  GeometryPtr (*geometry)(Chance&);
  gpu::Affine (*map)(Chance&);
};
const Palette& DotPalette();
RandomMessage MakeMessage(Chance& chance, uint64_t last_sequence, uint64_t* next_frame_id,
                          sync::TimeNs now, const Palette& palette = DotPalette());

}  // namespace voxeld::daemon::model
