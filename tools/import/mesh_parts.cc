#include "tools/import/mesh_parts.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <optional>
#include <vector>

#include "absl/strings/ascii.h"
#include "absl/strings/escaping.h"
#include "absl/strings/match.h"
#include "tools/voxelctl/import/surface_builder.h"

namespace voxeld::voxelctl {
namespace {

constexpr uint32_t kNoVertex = UINT32_MAX;
constexpr double kSameNormal = 0.9999;  // cosine between normals that one vertex may have
constexpr int kMostCopies = 8;          // copies of a vertex that are searched for a normal

// The length of the result is twice the area.
Point3 AreaNormal(const Point3& a, const Point3& b, const Point3& c) {
  const Point3 u = {b.x - a.x, b.y - a.y, b.z - a.z}, v = {c.x - a.x, c.y - a.y, c.z - a.z};
  return {u.y * v.z - u.z * v.y, u.z * v.x - u.x * v.z, u.x * v.y - u.y * v.x};
}

float Mirrored(float value) {
  const float along = std::fabs(std::remainder(value, 2.0f));
  return std::min(along, 1.0f);
}

float Wrapped(Wrap wrap, float value) {
  if (wrap == Wrap::kClamp) return std::clamp(value, 0.0f, 1.0f);
  return wrap == Wrap::kMirror ? Mirrored(value) : value;
}

// Returns whether the rule is exact if it is applied to the corners only.
bool IsExact(Wrap wrap, float a, float b, float c) {
  const float least = std::min({a, b, c}), most = std::max({a, b, c});
  if (wrap == Wrap::kClamp) return most <= 0 || least >= 1 || (least >= 0 && most <= 1);
  return wrap == Wrap::kRepeat || most <= std::floor(least) + 1;
}

}  // namespace

NodeMatrix Compose(const NodeMatrix& outer, const NodeMatrix& inner) {
  NodeMatrix r{};
  for (size_t row = 0; row < 12; row += 4) {
    for (size_t col = 0; col < 4; ++col) {
      r[row + col] = outer[row] * inner[col] + outer[row + 1] * inner[4 + col] +
                     outer[row + 2] * inner[8 + col] + (col == 3 ? outer[row + 3] : 0);
    }
  }
  return r;
}

Point3 MapPoint(const NodeMatrix& m, const Point3& p) {
  return {m[0] * p.x + m[1] * p.y + m[2] * p.z + m[3], m[4] * p.x + m[5] * p.y + m[6] * p.z + m[7],
          m[8] * p.x + m[9] * p.y + m[10] * p.z + m[11]};
}

namespace {

std::array<double, 9> CofactorsOf(const NodeMatrix& m) {
  return {m[5] * m[10] - m[6] * m[9], m[6] * m[8] - m[4] * m[10], m[4] * m[9] - m[5] * m[8],
          m[2] * m[9] - m[1] * m[10], m[0] * m[10] - m[2] * m[8], m[1] * m[8] - m[0] * m[9],
          m[1] * m[6] - m[2] * m[5],  m[2] * m[4] - m[0] * m[6],  m[0] * m[5] - m[1] * m[4]};
}

}  // namespace

bool IsMirror(const NodeMatrix& m) {
  const std::array<double, 9> cofactors = CofactorsOf(m);
  return m[0] * cofactors[0] + m[1] * cofactors[1] + m[2] * cofactors[2] < 0;
}

NodeMatrix NormalMatrix(const NodeMatrix& m) {
  const std::array<double, 9> cofactors = CofactorsOf(m);
  const double sign = IsMirror(m) ? -1 : 1;
  NodeMatrix r{};
  for (size_t row = 0; row < 3; ++row) {
    for (size_t col = 0; col < 3; ++col) r[row * 4 + col] = sign * cofactors[row * 3 + col];
  }
  return r;
}

Point3 Direction(const Point3& p) {
  const double largest = std::max({std::abs(p.x), std::abs(p.y), std::abs(p.z)});
  if (!(largest > 0) || !std::isfinite(largest)) return {};
  const Point3 q = {p.x / largest, p.y / largest, p.z / largest};
  const double length = std::sqrt(Dot(q, q));
  return {q.x / length, q.y / length, q.z / length};
}

uint8_t ColorByte(double value, bool linear) {
  if (!(value > 0)) return 0;
  value = std::min(value, 1.0);
  if (linear) value = value <= 0.0031308 ? 12.92 * value : 1.055 * std::pow(value, 1 / 2.4) - 0.055;
  return static_cast<uint8_t>(std::lround(value * 255));
}

bool IsLit(const std::array<double, 3>& emission) {
  return emission[0] > 0 || emission[1] > 0 || emission[2] > 0;
}

std::optional<std::array<double, 3>> BaseColor(const std::optional<std::array<double, 3>>& own,
                                               bool lit, bool has_vertex_colors) {
  if (own) return own;
  if (has_vertex_colors) return std::array<double, 3>{1, 1, 1};
  if (lit) return std::array<double, 3>{0, 0, 0};
  return std::nullopt;
}

void AddNormals(double crease_degrees, Part* part) {
  const size_t count = part->positions.size();
  std::vector<Point3> means(count);
  for (size_t t = 0; t + 3 <= part->indices.size(); t += 3) {
    const uint32_t* const corners = &part->indices[t];
    const Point3 normal = AreaNormal(part->positions[corners[0]], part->positions[corners[1]],
                                     part->positions[corners[2]]);
    for (size_t c = 0; c < 3; ++c) {
      Point3& mean = means[corners[c]];
      mean = {mean.x + normal.x, mean.y + normal.y, mean.z + normal.z};
    }
  }
  for (Point3& mean : means) mean = Direction(mean);
  const double least = std::cos(crease_degrees * std::acos(-1.0) / 180);
  part->normals.assign(count, {});
  std::vector<char> has_normal(count);
  std::vector<uint32_t> next(count, kNoVertex);  // the next copy of a vertex
  const auto copy_of = [part](uint32_t vertex) {
    const auto copy = static_cast<uint32_t>(part->positions.size());
    part->positions.push_back(part->positions[vertex]);
    part->normals.emplace_back();
    if (!part->colors.empty()) part->colors.push_back(part->colors[vertex]);
    if (!part->texture_coordinates.empty())
      part->texture_coordinates.push_back(part->texture_coordinates[vertex]);
    for (Attribute& one : part->attributes) one.values.push_back(one.values[vertex]);
    return copy;
  };
  for (size_t t = 0; t + 3 <= part->indices.size(); t += 3) {
    const Point3 own = Direction(AreaNormal(part->positions[part->indices[t]],
                                            part->positions[part->indices[t + 1]],
                                            part->positions[part->indices[t + 2]]));
    for (size_t c = 0; c < 3; ++c) {
      uint32_t& corner = part->indices[t + c];
      const Point3& mean = means[corner];
      const Point3 wanted = least <= -1 || Dot(own, mean) > least ? mean : own;
      uint32_t at = corner;
      for (int searched = 0;; ++searched) {
        if (has_normal[at] == 0) {
          part->normals[at] = wanted;
          has_normal[at] = 1;
          break;
        }
        if (wanted == Point3{} || Dot(part->normals[at], wanted) > kSameNormal) break;
        if (next[at] == kNoVertex || searched >= kMostCopies) {
          if (part->positions.size() >= kMaxModelVertices) break;
          const uint32_t copy = copy_of(corner);
          next.push_back(next[at]);
          has_normal.push_back(0);
          next[at] = copy;
        }
        at = next[at];
      }
      corner = at;
    }
  }
}

uint64_t DropEmptyTriangles(Part* part) {
  uint64_t dropped = 0;
  size_t kept = 0;
  std::vector<uint32_t>& indices = part->indices;
  for (size_t t = 0; t + 3 <= indices.size(); t += 3) {
    const uint32_t a = indices[t], b = indices[t + 1], c = indices[t + 2];
    if (AreaNormal(part->positions[a], part->positions[b], part->positions[c]) == Point3{}) {
      if (part->positions[a] != part->positions[b] && part->positions[b] != part->positions[c] &&
          part->positions[c] != part->positions[a])
        ++dropped;
      continue;
    }
    indices[kept++] = a;
    indices[kept++] = b;
    indices[kept++] = c;
  }
  if (kept == indices.size()) return 0;
  indices.resize(kept);
  std::vector<uint32_t> numbers(part->positions.size(), kNoVertex);
  for (const uint32_t index : indices) numbers[index] = 0;
  uint32_t next = 0;
  for (uint32_t& number : numbers) {
    if (number != kNoVertex) number = next++;
  }
  const auto compact = [&](auto* values) {
    if (values->empty()) return;
    for (size_t i = 0; i < numbers.size(); ++i) {
      if (numbers[i] != kNoVertex) (*values)[numbers[i]] = (*values)[i];
    }
    values->resize(next);
  };
  compact(&part->positions);
  compact(&part->normals);
  compact(&part->colors);
  compact(&part->texture_coordinates);
  for (Attribute& one : part->attributes) compact(&one.values);
  for (uint32_t& index : indices) index = numbers[index];
  return dropped;
}

bool IsPicture(absl::string_view bytes) {
  return absl::StartsWith(bytes, "\x89PNG\r\n\x1a\n") || absl::StartsWith(bytes, "\xff\xd8\xff");
}

uint64_t ApplyWrap(Wrap u, Wrap v, Part* part) {
  if (u == Wrap::kRepeat && v == Wrap::kRepeat) return 0;
  uint64_t approximate = 0;
  for (size_t t = 0; t + 3 <= part->indices.size(); t += 3) {
    const auto& a = part->texture_coordinates[part->indices[t]];
    const auto& b = part->texture_coordinates[part->indices[t + 1]];
    const auto& c = part->texture_coordinates[part->indices[t + 2]];
    if (!IsExact(u, a[0], b[0], c[0]) || !IsExact(v, a[1], b[1], c[1])) ++approximate;
  }
  for (auto& at : part->texture_coordinates) at = {Wrapped(u, at[0]), Wrapped(v, at[1])};
  return approximate;
}

std::string PercentDecode(absl::string_view text) {
  std::string out;
  for (size_t i = 0; i < text.size(); ++i) {
    if (text[i] == '%' && i + 2 < text.size() && absl::ascii_isxdigit(text[i + 1]) &&
        absl::ascii_isxdigit(text[i + 2])) {
      out += absl::HexStringToBytes(text.substr(i + 1, 2));
      i += 2;
    } else {
      out += text[i];
    }
  }
  return out;
}

}  // namespace voxeld::voxelctl
