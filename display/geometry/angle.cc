#include "display/geometry/angle.h"

#include <bit>
#include <cmath>

#include "display/geometry/fixed_point.h"

namespace voxeld::display {
namespace {

constexpr Turn kQuarter = Turn{1} << 30;
constexpr Turn kEighth = Turn{1} << 29;

// arctan(2⁻ⁱ) for i = 1 to 40, in 2⁻⁶² turn. From i = 1 on they add up to 0.96 radian, more than
// the eighth of a turn to which every argument is reduced.
constexpr int64_t kArcTangents[] = {340304653033718298,
                                    179807632645220259,
                                    91273161881380487,
                                    45813697873323707,
                                    22929182573009054,
                                    11467389120678282,
                                    5734044481687724,
                                    2867065987018958,
                                    1433538461969102,
                                    716769914547871,
                                    358385042719534,
                                    179192532040472,
                                    89596267355325,
                                    44798133844548,
                                    22399066943135,
                                    11199533474175,
                                    5599766737413,
                                    2799883368747,
                                    1399941684379,
                                    699970842190,
                                    349985421095,
                                    174992710548,
                                    87496355274,
                                    43748177637,
                                    21874088818,
                                    10937044409,
                                    5468522205,
                                    2734261102,
                                    1367130551,
                                    683565276,
                                    341782638,
                                    170891319,
                                    85445659,
                                    42722830,
                                    21361415,
                                    10680707,
                                    5340354,
                                    2670177,
                                    1335088,
                                    667544};

// Π 1/√(1 + 4⁻ⁱ) over the same steps, in 2⁻⁶⁰: compensates for the growth of the length in the
// steps.
constexpr int64_t kUnitLength = 990112082269311855;

// Returns the direction of an angle of at most an eighth turn.
Direction OctantDirection(Turn turn) {
  int64_t x = kUnitLength, y = 0, rest = static_cast<int64_t>(turn) << 30;
  int shift = 1;
  for (const int64_t step : kArcTangents) {
    const int64_t dx = y >> shift, dy = x >> shift;
    if (rest >= 0) {
      x -= dx, y += dy, rest -= step;
    } else {
      x += dx, y -= dy, rest += step;
    }
    ++shift;
  }
  constexpr int64_t kHalf = int64_t{1} << 29;
  return {static_cast<int32_t>((x + kHalf) >> 30), static_cast<int32_t>((y + kHalf) >> 30)};
}

// Returns the angle of (x, y). Requires: 0 ≤ y ≤ x, x > 0.
Turn OctantTurn(int64_t x, int64_t y) {
  // Scale to as many bits as leave room for the growth by 1/0.86.
  const int scale = std::countl_zero(static_cast<uint64_t>(x)) - 4;
  x = scale >= 0 ? x << scale : x >> -scale;
  y = scale >= 0 ? y << scale : y >> -scale;
  int64_t turn = 0;
  int shift = 1;
  for (const int64_t step : kArcTangents) {
    const int64_t dx = y >> shift, dy = x >> shift;
    if (y >= 0) {
      x += dx, y -= dy, turn += step;
    } else {
      x -= dx, y += dy, turn -= step;
    }
    ++shift;
  }
  return static_cast<Turn>((turn + (int64_t{1} << 29)) >> 30);
}

}  // namespace

Turn TurnFromFraction(double turns) {
  return static_cast<Turn>(static_cast<uint64_t>(RoundHalfUp(turns * 4294967296.0)));
}

Turn TurnFromRatio(uint32_t part, uint32_t whole) {
  return static_cast<Turn>(((static_cast<uint64_t>(part) << 32) + whole / 2) / whole);
}

Direction DirectionOf(Turn turn) {
  const Turn within = turn % kQuarter;
  Direction d;
  if (within == 0) {
    d = {1 << 30, 0};
  } else if (within <= kEighth) {
    d = OctantDirection(within);
  } else {
    const Direction mirrored = OctantDirection(kQuarter - within);
    d = {mirrored.sin, mirrored.cos};
  }
  switch (turn / kQuarter) {
    case 0:
      return d;
    case 1:
      return {-d.sin, d.cos};
    case 2:
      return {-d.cos, -d.sin};
    default:
      return {d.sin, -d.cos};
  }
}

Turn TurnOf(int64_t x, int64_t y) {
  // Turn back by whole quarters until x > 0 and y ≥ 0.
  Turn quarters = 0;
  while (x <= 0 || y < 0) {
    const int64_t turned = y;
    y = -x;
    x = turned;
    ++quarters;
  }
  const Turn within = y <= x ? OctantTurn(x, y) : kQuarter - OctantTurn(y, x);
  return quarters * kQuarter + within;
}

int64_t FloorSqrt(int64_t n) {
  int64_t root = static_cast<int64_t>(std::sqrt(static_cast<double>(n)));
  while (root * root > n) --root;
  while ((root + 1) * (root + 1) <= n) ++root;
  return root;
}

}  // namespace voxeld::display
