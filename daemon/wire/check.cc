#include "daemon/wire/check.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <limits>

#include "absl/strings/str_cat.h"
#include "daemon/scene/quoted.h"
#include "voxeld/v1/types.pb.h"

namespace voxeld::daemon::wire {
namespace {

constexpr double kLeastDeterminant = 1e-12;

template <typename T>
std::string ShowNumber(T value) {
  if (std::isnan(value)) return "NaN";
  if (std::isinf(value)) return value > 0 ? "infinity" : "-infinity";
  std::array<char, 32> text;
  const auto result = std::to_chars(text.data(), text.data() + text.size(), value);
  return std::string(text.data(), result.ptr);
}

bool Singular(const gpu::Affine& a) {
  gpu::Affine scaled;
  for (int row = 0; row < 3; ++row) {
    const double* in = a.m + row * 4;
    const double greatest = std::max({std::fabs(in[0]), std::fabs(in[1]), std::fabs(in[2])});
    if (greatest == 0) return true;
    for (int col = 0; col < 3; ++col) scaled.m[row * 4 + col] = in[col] / greatest;
  }
  return !(std::fabs(gpu::Determinant(scaled)) > kLeastDeterminant) ||
         !std::isnormal(gpu::Determinant(a));
}

}  // namespace

std::string Show(double value) { return ShowNumber(value); }
std::string Show(float value) { return ShowNumber(value); }

std::string ShowBytes(uint64_t bytes, uint64_t element_bytes, std::string_view element) {
  const std::string text = absl::StrCat(bytes, " bytes");
  if (bytes == 0 || bytes % element_bytes != 0) return text;
  const uint64_t count = bytes / element_bytes;
  return absl::StrCat(text, ", ", count, " ", absl::string_view(element.data(), element.size()),
                      count == 1 ? "" : "s");
}

std::string Quote(std::string_view text) { return Quoted(text); }

MaybeFault CheckName(const FieldPath& path, std::string_view name, uint32_t max_bytes) {
  if (name.empty()) {
    return Fault{path.ToString(), Reason::kInvalidValue,
                 absl::StrCat("is empty; give 1 to ", max_bytes, " bytes of UTF-8")};
  }
  return CheckLabel(path, name, max_bytes);
}

MaybeFault CheckLabel(const FieldPath& path, std::string_view text, size_t max_bytes) {
  if (text.size() <= max_bytes) return {};
  return Fault{path.ToString(), Reason::kInvalidValue,
               absl::StrCat("has ", text.size(), " bytes (", Quote(text), "); at most ", max_bytes,
                            " are allowed")};
}

MaybeFault CheckFinite(const FieldPath& path, double value) {
  if (std::isfinite(value)) return {};
  return Fault{path.ToString(), Reason::kInvalidValue,
               absl::StrCat("is ", Show(value), "; give a finite number")};
}

MaybeFault CheckFloat(const FieldPath& path, double value) {
  if (auto fault = CheckFinite(path, value)) return fault;
  if (std::fabs(value) <= std::numeric_limits<float>::max()) return {};
  return Fault{path.ToString(), Reason::kInvalidValue,
               absl::StrCat("is ", Show(value), "; magnitudes up to ",
                            Show(std::numeric_limits<float>::max()), " are possible")};
}

MaybeFault CheckPositive(const FieldPath& path, double value) {
  if (auto fault = CheckFloat(path, value)) return fault;
  if (value >= std::numeric_limits<float>::min()) return {};
  const std::string least =
      value > 0 ? absl::StrCat(" (at least ", Show(std::numeric_limits<float>::min()), ")") : "";
  return Fault{path.ToString(), Reason::kInvalidValue,
               absl::StrCat("is ", Show(value), "; give a number greater than 0", least)};
}

MaybeFault CheckVec3(const FieldPath& path, const v1::Vec3& vec) {
  if (auto fault = CheckFloat(FieldPath(path, "x"), vec.x())) return fault;
  if (auto fault = CheckFloat(FieldPath(path, "y"), vec.y())) return fault;
  return CheckFloat(FieldPath(path, "z"), vec.z());
}

MaybeFault CheckSize(const FieldPath& path, const v1::Vec3& vec) {
  if (auto fault = CheckPositive(FieldPath(path, "x"), vec.x())) return fault;
  if (auto fault = CheckPositive(FieldPath(path, "y"), vec.y())) return fault;
  return CheckPositive(FieldPath(path, "z"), vec.z());
}

MaybeFault CheckBox(const FieldPath& path, const v1::Box3& in) {
  if (auto fault = CheckVec3(FieldPath(path, "min"), in.min())) return fault;
  if (auto fault = CheckVec3(FieldPath(path, "max"), in.max())) return fault;
  const double min[3] = {in.min().x(), in.min().y(), in.min().z()};
  const double max[3] = {in.max().x(), in.max().y(), in.max().z()};
  for (int axis = 0; axis < 3; ++axis) {
    if (min[axis] < max[axis]) continue;
    const FieldPath corner(path, "max");
    return Fault{FieldPath(corner, axis == 0   ? "x"
                                   : axis == 1 ? "y"
                                               : "z")
                     .ToString(),
                 Reason::kInvalidValue,
                 absl::StrCat("is ", Show(max[axis]), "; it must be greater than that of min, ",
                              Show(min[axis]))};
  }
  return {};
}

Fault UnknownEnum(const FieldPath& path, int value, const char* known) {
  return {path.ToString(), Reason::kInvalidValue,
          absl::StrCat("has the unknown value ", value, "; use one of ", known)};
}

Fault Unimplemented(const FieldPath& path, const char* what) {
  return {path.ToString(), Reason::kUnimplemented,
          absl::StrCat("is not implemented in this version of the server: ", what)};
}

MaybeFault ToAffine(const FieldPath& path, const v1::Affine& in, gpu::Affine* out) {
  *out = gpu::Affine();
  if (in.m_size() == 0) return {};
  if (in.m_size() != 12) {
    return Fault{FieldPath(path, "m").ToString(), Reason::kSizeMismatch,
                 absl::StrCat("has ", in.m_size(),
                              " values; give 12 (three rows of four), or none "
                              "for the identity")};
  }
  for (int i = 0; i < 12; ++i) {
    if (auto fault = CheckFinite(FieldPath(path, "m", i), in.m(i))) return fault;
    out->m[i] = in.m(i);
  }
  if (Singular(*out)) {
    return Fault{
        FieldPath(path, "m").ToString(), Reason::kSingularTransform,
        absl::StrCat("has a singular linear part (determinant ", Show(gpu::Determinant(*out)),
                     "); the three axes must stay independent")};
  }
  return {};
}

}  // namespace voxeld::daemon::wire
