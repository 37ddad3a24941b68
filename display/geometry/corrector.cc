#include "display/geometry/corrector.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <variant>

#include "absl/strings/str_cat.h"
#include "display/geometry/footprint.h"
#include "display/geometry/limits.h"

namespace voxeld::display {
namespace {

// for a determinant and for a homography's w; and for their inverses
constexpr double kMostScale = 8;
constexpr double kMostStretch = 16;
constexpr double kMostContraction = 0.9;  // contraction factor of ToNominal's iteration
constexpr int kMostIterations = 400;      // 0.9^400 < 2⁻⁶⁰
constexpr double kClose = 1.0 / (1 << 30);

Vec3 Apply(const std::array<double, 12>& a, const Vec3& p) {
  return {a[0] * p.x + a[1] * p.y + a[2] * p.z + a[3], a[4] * p.x + a[5] * p.y + a[6] * p.z + a[7],
          a[8] * p.x + a[9] * p.y + a[10] * p.z + a[11]};
}

double Determinant(const std::array<double, 12>& a) {
  return a[0] * (a[5] * a[10] - a[6] * a[9]) - a[1] * (a[4] * a[10] - a[6] * a[8]) +
         a[2] * (a[4] * a[9] - a[5] * a[8]);
}

std::array<double, 12> Inverse(const std::array<double, 12>& a) {
  const double d = Determinant(a);
  std::array<double, 12> out{(a[5] * a[10] - a[6] * a[9]) / d, (a[2] * a[9] - a[1] * a[10]) / d,
                             (a[1] * a[6] - a[2] * a[5]) / d,  0,
                             (a[6] * a[8] - a[4] * a[10]) / d, (a[0] * a[10] - a[2] * a[8]) / d,
                             (a[2] * a[4] - a[0] * a[6]) / d,  0,
                             (a[4] * a[9] - a[5] * a[8]) / d,  (a[1] * a[8] - a[0] * a[9]) / d,
                             (a[0] * a[5] - a[1] * a[4]) / d,  0};
  for (size_t row = 0; row < 3; ++row) {
    out[row * 4 + 3] = -(out[row * 4] * a[3] + out[row * 4 + 1] * a[7] + out[row * 4 + 2] * a[11]);
  }
  return out;
}

// Returns the Frobenius norm of the linear part.
double NormOf(const std::array<double, 12>& a) {
  double sum = 0;
  for (size_t i = 0; i < a.size(); ++i) sum += i % 4 == 3 ? 0 : a[i] * a[i];
  return std::sqrt(sum);
}

Vec3 Between(const Vec3& a, const Vec3& b, double t) {
  return {a.x + t * (b.x - a.x), a.y + t * (b.y - a.y), a.z + t * (b.z - a.z)};
}

absl::Status Wrong(const std::string& field, const std::string& value, const std::string& right) {
  return absl::InvalidArgumentError(
      absl::StrCat("correction.", field, " is ", value, ": it must be ", right));
}

absl::Status CheckAffine(const std::array<double, 12>& affine) {
  for (size_t i = 0; i < affine.size(); ++i) {
    if (!(std::abs(affine[i]) <= kMaxPositionMm)) {
      return Wrong(absl::StrCat("affine[", i, "]"), absl::StrCat(affine[i]),
                   absl::StrCat("within ", kMaxPositionMm));
    }
  }
  const double stretch = NormOf(affine);
  if (stretch > kMostStretch) {
    return Wrong("the norm of affine", absl::StrCat(stretch),
                 absl::StrCat("at most ", kMostStretch, ": it keeps roughly sizes"));
  }
  const double d = Determinant(affine);
  if (!(d >= 1 / kMostScale && d <= kMostScale)) {
    return Wrong("affine's determinant", absl::StrCat(d),
                 "from 1/8 to 8: it keeps directions and roughly sizes");
  }
  const double shrink = NormOf(Inverse(affine));
  if (shrink <= kMostStretch) return absl::OkStatus();
  return Wrong("the norm of affine's inverse", absl::StrCat(shrink),
               absl::StrCat("at most ", kMostStretch, ": it keeps roughly sizes"));
}

// Checks that the displacement changes little enough from place to place for a contraction.
absl::Status CheckDisplacement(const Correction& correction) {
  const DisplacementGrid& grid = *correction.displacement;
  const int32_t n[3] = {grid.nx, grid.ny, grid.nz};
  const double low[3] = {grid.low_mm.x, grid.low_mm.y, grid.low_mm.z},
               high[3] = {grid.high_mm.x, grid.high_mm.y, grid.high_mm.z};
  const char* const names[3] = {"x", "y", "z"};
  double step[3];
  for (int a = 0; a < 3; ++a) {
    if (n[a] < 2 || n[a] > kMaxDisplacements) {
      return Wrong(absl::StrCat("displacement.n", names[a]), absl::StrCat(n[a]),
                   absl::StrCat("from 2 to ", kMaxDisplacements));
    }
    if (!(low[a] >= -kMaxPositionMm && high[a] <= kMaxPositionMm &&
          high[a] - low[a] >= kMinPitchMm)) {
      return Wrong(absl::StrCat("displacement.high_mm.", names[a], " − low_mm.", names[a]),
                   absl::StrCat(high[a] - low[a]),
                   absl::StrCat("from ", kMinPitchMm, ", within ", kMaxPositionMm, " mm"));
    }
    step[a] = (high[a] - low[a]) / (n[a] - 1);
  }
  const size_t count =
      static_cast<size_t>(n[0]) * static_cast<size_t>(n[1]) * static_cast<size_t>(n[2]);
  if (grid.at_mm.size() != count) {
    return Wrong("the number of displacement.at_mm", absl::StrCat(grid.at_mm.size()),
                 absl::StrCat(count, ", nx·ny·nz"));
  }
  const double norm = NormOf(Inverse(correction.affine));
  // With trilinear interpolation the gradient's three columns do not exceed the steepest
  // edges.
  double steepest[3] = {};
  const size_t stride[3] = {1, static_cast<size_t>(n[0]),
                            static_cast<size_t>(n[0]) * static_cast<size_t>(n[1])};
  for (size_t i = 0; i < count; ++i) {
    const Vec3& here = grid.at_mm[i];
    if (!(std::abs(here.x) <= kMaxPositionMm && std::abs(here.y) <= kMaxPositionMm &&
          std::abs(here.z) <= kMaxPositionMm)) {
      return Wrong(absl::StrCat("displacement.at_mm[", i, "]"),
                   absl::StrCat("(", here.x, ", ", here.y, ", ", here.z, ")"),
                   absl::StrCat("within ", kMaxPositionMm, " mm"));
    }
    for (size_t a = 0; a < 3; ++a) {
      if (i / stride[a] % static_cast<size_t>(n[a]) + 1 == static_cast<size_t>(n[a])) continue;
      const Vec3& next = grid.at_mm[i + stride[a]];
      const double slope =
          std::sqrt((next.x - here.x) * (next.x - here.x) + (next.y - here.y) * (next.y - here.y) +
                    (next.z - here.z) * (next.z - here.z)) /
          step[a];
      steepest[a] = std::max(steepest[a], slope);
    }
  }
  const double contraction =
      norm *
      std::sqrt(steepest[0] * steepest[0] + steepest[1] * steepest[1] + steepest[2] * steepest[2]);
  if (contraction <= kMostContraction) return absl::OkStatus();
  return Wrong("the displacement's steepness, times the norm of affine's inverse,",
               absl::StrCat(contraction),
               absl::StrCat("at most ", kMostContraction,
                            ": measure at more places, or put what is common into affine"));
}

absl::Status CheckHomography(const std::string& field, const Homography& h, PicturePlace half) {
  for (const double m : h.m) {
    if (!std::isfinite(m)) return Wrong(field, absl::StrCat(m), "of finite numbers");
  }
  if (!(h.Determinant() > 0)) {
    return Wrong(absl::StrCat(field, "'s determinant"), absl::StrCat(h.Determinant()),
                 "above 0; mirror pictures by mirror_u and mirror_v");
  }
  for (const double u : {-half.u, half.u}) {
    for (const double v : {-half.v, half.v}) {
      const double w = h.WeightAt({u, v});
      const PicturePlace at = h.At({u, v});
      if (!(std::abs(at.u) <= kMaxPositionMm && std::abs(at.v) <= kMaxPositionMm)) {
        return Wrong(absl::StrCat(field, "'s place of (", u, ", ", v, ") mm"),
                     absl::StrCat("(", at.u, ", ", at.v, ")"),
                     absl::StrCat("within ", kMaxPositionMm, " mm"));
      }
      if (w >= 1 / kMostScale && w <= kMostScale) continue;
      return Wrong(absl::StrCat(field, "'s w at (", u, ", ", v, ") mm"), absl::StrCat(w),
                   "from 1/8 to 8 over all of the picture");
    }
  }
  return absl::OkStatus();
}

}  // namespace

Corrector::Corrector(const std::optional<Correction>& correction) {
  if (!correction.has_value()) return;
  affine_ = correction->affine;
  inverse_ = Inverse(affine_);
  displacement_ = correction->displacement;
  moves_space_ = displacement_.has_value() || affine_ != Correction().affine;
  for (const std::array<double, 9>& m : correction->homographies) {
    homographies_.push_back({m});
    inverse_homographies_.push_back(homographies_.back().Inverse());
  }
}

Vec3 Corrector::DisplacementAt(const Vec3& p) const {
  const DisplacementGrid& grid = *displacement_;
  struct Cell {
    size_t first;
    double share;
  };
  const auto cell = [](double at, double low, double high, int32_t n) {
    const double place = std::clamp((at - low) / (high - low) * (n - 1), 0.0, n - 1.0);
    const auto first = std::min<size_t>(static_cast<size_t>(place), static_cast<size_t>(n) - 2);
    return Cell{first, place - static_cast<double>(first)};
  };
  const Cell x = cell(p.x, grid.low_mm.x, grid.high_mm.x, grid.nx),
             y = cell(p.y, grid.low_mm.y, grid.high_mm.y, grid.ny),
             z = cell(p.z, grid.low_mm.z, grid.high_mm.z, grid.nz);
  const size_t row = static_cast<size_t>(grid.nx), plane = row * static_cast<size_t>(grid.ny);
  const auto along_x = [&](size_t j, size_t k) {
    const Vec3* const at = &grid.at_mm[k * plane + j * row + x.first];
    return Between(at[0], at[1], x.share);
  };
  const auto in_plane = [&](size_t k) {
    return Between(along_x(y.first, k), along_x(y.first + 1, k), y.share);
  };
  return Between(in_plane(z.first), in_plane(z.first + 1), z.share);
}

Vec3 Corrector::ToTrue(const Vec3& nominal) const {
  if (!moves_space_ || std::isnan(nominal.x)) return nominal;
  const Vec3 place = Apply(affine_, nominal);
  if (!displacement_.has_value()) return place;
  const Vec3 d = DisplacementAt(nominal);
  return {place.x + d.x, place.y + d.y, place.z + d.z};
}

Vec3 Corrector::ToNominal(const Vec3& place) const {
  if (!moves_space_) return place;
  Vec3 nominal = Apply(inverse_, place);
  if (!displacement_.has_value()) return nominal;
  for (int i = 0; i < kMostIterations; ++i) {
    const Vec3 d = DisplacementAt(nominal);
    const Vec3 next = Apply(inverse_, {place.x - d.x, place.y - d.y, place.z - d.z});
    const double moved = std::max(
        {std::abs(next.x - nominal.x), std::abs(next.y - nominal.y), std::abs(next.z - nominal.z)});
    nominal = next;
    if (moved < kClose * (1 - kMostContraction)) break;
  }
  return nominal;
}

PicturePlace Corrector::PictureToTrue(int32_t slice, PicturePlace place) const {
  return homographies_.empty() ? place : Of(homographies_, slice).At(place);
}

PicturePlace Corrector::PictureToNominal(int32_t slice, PicturePlace place) const {
  return homographies_.empty() ? place : Of(inverse_homographies_, slice).At(place);
}

std::optional<PicturePlace> HalfPicture(const Geometry& geometry) {
  if (const auto* stack = std::get_if<PlanarStack>(&geometry.shape)) {
    return PicturePlace{stack->width_px * stack->pitch_u_mm / 2,
                        stack->height_px * stack->pitch_v_mm / 2};
  }
  if (const auto* helix = std::get_if<Helix>(&geometry.shape)) {
    return PicturePlace{helix->width_px * helix->pitch_u_mm / 2,
                        helix->height_px * helix->pitch_v_mm / 2};
  }
  return std::nullopt;
}

absl::Status CheckCorrection(const Geometry& geometry) {
  if (!geometry.correction.has_value()) return absl::OkStatus();
  const Correction& correction = *geometry.correction;
  if (absl::Status status = CheckAffine(correction.affine); !status.ok()) return status;
  if (correction.displacement.has_value()) {
    if (absl::Status status = CheckDisplacement(correction); !status.ok()) return status;
  }
  if (correction.homographies.empty()) return absl::OkStatus();
  const std::optional<PicturePlace> half = HalfPicture(geometry);
  if (!half.has_value()) {
    return Wrong("the number of homographies", absl::StrCat(correction.homographies.size()),
                 "0: only a planar stack and a helix have projected pictures");
  }
  const size_t count = correction.homographies.size();
  const auto slices = static_cast<size_t>(SliceCount(geometry));
  if (count != 1 && count != slices) {
    return Wrong("the number of homographies", absl::StrCat(count),
                 absl::StrCat("1, or one for each of the ", slices, " slices"));
  }
  for (size_t i = 0; i < count; ++i) {
    const absl::Status status =
        CheckHomography(absl::StrCat("homographies[", i, "]"), {correction.homographies[i]}, *half);
    if (!status.ok()) return status;
  }
  return absl::OkStatus();
}

}  // namespace voxeld::display
