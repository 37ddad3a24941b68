// GLU's tessellator; what it is given is small enough and finite.
#include "tools/import/svg_fill.h"

#include <GL/glu.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <deque>
#include <memory>
#include <utility>

namespace voxeld::voxelctl {
namespace {

constexpr uint32_t kUnused = UINT32_MAX;

struct Corner {
  std::array<GLdouble, 3> at;
  uint32_t index = kUnused;  // among the points that triangles have
};

// A piece of a curve, from left to right.
struct Edge {
  double left, right, low, high;
};

// Takes what the curves' crossings cost from the budget: pieces whose boxes meet, but for those side by side.
bool Affordable(const std::vector<Polyline>& curves, FillBudget* budget) {
  std::vector<Edge> edges;
  for (const Polyline& curve : curves) {
    const size_t count = curve.points.size();
    if (count > budget->points) return false;
    budget->points -= count;
    for (size_t i = 0; i < count; ++i) {
      const Point2 &p = curve.points[i], &q = curve.points[(i + 1) % count];
      edges.push_back(
          {std::min(p.x, q.x), std::max(p.x, q.x), std::min(p.y, q.y), std::max(p.y, q.y)});
    }
  }
  std::sort(edges.begin(), edges.end(),
            [](const Edge& a, const Edge& b) { return a.left < b.left; });
  std::vector<Edge> open;
  for (const Edge& edge : edges) {
    if (open.size() > budget->comparisons) return false;
    budget->comparisons -= open.size();
    std::erase_if(open, [&edge](const Edge& other) { return other.right < edge.left; });
    const auto met =
        static_cast<uint64_t>(std::count_if(open.begin(), open.end(), [&edge](const Edge& other) {
          return other.low <= edge.high && edge.low <= other.high;
        }));
    const uint64_t crossing = met - std::min<uint64_t>(met, 2);
    if (crossing > budget->crossings) return false;
    budget->crossings -= crossing;
    open.push_back(edge);
  }
  return true;
}

// What the library calls back; vertices are pointers to corners, which stay where they are.
struct Drawn {
  std::deque<Corner> corners;
  Triangles out;
  bool failed = false;

  Corner* Add(double x, double y) {
    corners.push_back({{x, y, 0}});
    return &corners.back();
  }
};

void OnVertex(void* vertex, void* drawn) {
  auto& all = *static_cast<Drawn*>(drawn);
  Corner& corner = *static_cast<Corner*>(vertex);
  if (corner.index == kUnused) {
    corner.index = static_cast<uint32_t>(all.out.points.size());
    all.out.points.push_back({corner.at[0], corner.at[1]});
  }
  all.out.indices.push_back(corner.index);
}

void OnCombine(const GLdouble at[3], void* const[4], const GLfloat[4], void** made, void* drawn) {
  *made = static_cast<Drawn*>(drawn)->Add(at[0], at[1]);
}

void OnError(GLenum, void* drawn) { static_cast<Drawn*>(drawn)->failed = true; }

// That it is there has the library make triangles alone, no strips and fans.
void OnEdge(GLboolean, void*) {}

template <typename Function>
_GLUfuncptr Callback(Function* function) {
  return reinterpret_cast<_GLUfuncptr>(function);
}

}  // namespace

std::optional<Triangles> FillCurves(const std::vector<Polyline>& curves, FillRule rule,
                                    FillBudget* budget) {
  if (!Affordable(curves, budget)) return std::nullopt;
  // Numbers of about 1, whatever the drawing's are.
  Point2 low{HUGE_VAL, HUGE_VAL}, high{-HUGE_VAL, -HUGE_VAL};
  for (const Polyline& curve : curves) {
    for (const Point2& p : curve.points) {
      low = {std::min(low.x, p.x), std::min(low.y, p.y)};
      high = {std::max(high.x, p.x), std::max(high.y, p.y)};
    }
  }
  const double extent = std::max(high.x - low.x, high.y - low.y);
  if (!(extent > 0) || !std::isfinite(extent)) return Triangles();
  const std::unique_ptr<GLUtesselator, void (*)(GLUtesselator*)> tessellator(gluNewTess(),
                                                                             gluDeleteTess);
  if (tessellator == nullptr) return std::nullopt;
  Drawn drawn;
  gluTessCallback(tessellator.get(), GLU_TESS_VERTEX_DATA, Callback(&OnVertex));
  gluTessCallback(tessellator.get(), GLU_TESS_COMBINE_DATA, Callback(&OnCombine));
  gluTessCallback(tessellator.get(), GLU_TESS_ERROR_DATA, Callback(&OnError));
  gluTessCallback(tessellator.get(), GLU_TESS_EDGE_FLAG_DATA, Callback(&OnEdge));
  gluTessProperty(tessellator.get(), GLU_TESS_WINDING_RULE,
                  rule == FillRule::kEvenOdd ? GLU_TESS_WINDING_ODD : GLU_TESS_WINDING_NONZERO);
  gluTessNormal(tessellator.get(), 0, 0, 1);
  gluTessBeginPolygon(tessellator.get(), &drawn);
  for (const Polyline& curve : curves) {
    if (curve.points.size() < 3) continue;
    gluTessBeginContour(tessellator.get());
    for (const Point2& p : curve.points) {
      Corner* corner = drawn.Add((p.x - low.x) / extent, (p.y - low.y) / extent);
      gluTessVertex(tessellator.get(), corner->at.data(), corner);
    }
    gluTessEndContour(tessellator.get());
  }
  gluTessEndPolygon(tessellator.get());
  if (drawn.failed) return std::nullopt;
  drawn.out.indices.resize(drawn.out.indices.size() / 3 * 3);
  for (Point2& p : drawn.out.points) p = {p.x * extent + low.x, p.y * extent + low.y};
  return std::move(drawn.out);
}

}  // namespace voxeld::voxelctl
