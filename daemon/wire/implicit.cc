#include "daemon/wire/implicit.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "daemon/colormaps/colormaps.h"
#include "daemon/wire/boundary.h"
#include "daemon/wire/expression.h"
#include "daemon/wire/fields.h"
#include "voxeld/v1/primitives.pb.h"

namespace voxeld::daemon::wire {
namespace {

using gpu::implicit::Graph;
using gpu::implicit::Parameters;
using gpu::implicit::ProgramSource;

// Requires: `name` is not empty (SplitNames).
bool IsName(std::string_view name) {
  if (absl::ascii_isdigit(static_cast<unsigned char>(name[0]))) return false;
  return std::all_of(name.begin(), name.end(), [](char c) {
    return absl::ascii_isalnum(static_cast<unsigned char>(c)) || c == '_';
  });
}

MaybeFault ToParameters(const FieldPath& path, const v1::Implicit& in, const Limits& limits,
                        Parameters* out) {
  const std::vector<std::string> names =
      SplitNames(in.parameter_names(), limits.max_expression_nodes);
  const size_t values = static_cast<size_t>(in.parameter_values_size());
  if (names.size() <= limits.max_expression_nodes && names.size() != values) {
    return Fault{FieldPath(path, "parameter_values").ToString(), Reason::kSizeMismatch,
                 absl::StrCat("has ", values, " numbers for ", names.size(), " names")};
  }
  if (names.size() > limits.max_expression_nodes) {
    return Fault{FieldPath(path, "parameter_names").ToString(), Reason::kQuotaExceeded,
                 absl::StrCat("has more than max_expression_nodes, ", limits.max_expression_nodes)};
  }
  for (size_t i = 0; i < names.size(); ++i) {
    if (!IsName(names[i])) {
      return Fault{FieldPath(path, "parameter_names").ToString(), Reason::kInvalidValue,
                   absl::StrCat("has ", Quote(names[i]),
                                "; letters, digits and _ make a name, a digit not first")};
    }
    const double value = in.parameter_values(static_cast<int>(i));
    if (auto fault =
            CheckFloat(FieldPath(path, "parameter_values", static_cast<int64_t>(i)), value)) {
      return fault;
    }
    (*out)[names[i]] = value;
  }
  return {};
}

MaybeFault ToColor(const FieldPath& path, const v1::Implicit& in, const ExpressionContext& context,
                   ProgramSource* source, std::vector<uint32_t>* table) {
  const bool channels[3] = {in.has_red(), in.has_green(), in.has_blue()};
  const int count = channels[0] + channels[1] + channels[2];
  if (count % 3 != 0 || (count > 0 && in.has_level())) {
    return Fault{
        path.ToString(), Reason::kInvalidValue,
        absl::StrCat("has ", count, " of red, green and blue", in.has_level() ? " and level" : "",
                     "; give all three, or level with a colormap, or none")};
  }
  if (in.has_level() == in.colormap().empty()) {
    return Fault{FieldPath(path, "colormap").ToString(), Reason::kInvalidValue,
                 absl::StrCat("is ", Quote(in.colormap()), in.has_level() ? " with" : " without",
                              " level; each goes with the other")};
  }
  const std::pair<const char*, const v1::Expression*> parts[] = {
      {in.has_level() ? "level" : "red", in.has_level() ? &in.level() : &in.red()},
      {"green", &in.green()},
      {"blue", &in.blue()}};
  for (int i = 0; i < (in.has_level() ? 1 : count); ++i) {
    const FieldPath part(path, parts[i].first);
    if (auto fault = ToValue(part, *parts[i].second, context, &source->color[i])) return fault;
  }
  if (!in.has_level()) return {};
  const std::optional<ColorTable> found = FindColormap(in.colormap());
  if (!found.has_value()) {
    return Fault{FieldPath(path, "colormap").ToString(), Reason::kNotFound,
                 absl::StrCat("is ", Quote(in.colormap()), ", which is none; ",
                              ColormapAdvice(in.colormap()))};
  }
  table->assign(found->begin(), found->end());
  source->table = *table;
  return {};
}

// Reads the domain: the region to examine, which also bounds the shape.
MaybeFault ToDomain(const FieldPath& path, const v1::Box3& in, Graph& graph, Graph::Node* bound,
                    GeometryData* out) {
  if (auto fault = CheckBox(path, in)) return fault;
  const double min[3] = {in.min().x(), in.min().y(), in.min().z()};
  const double max[3] = {in.max().x(), in.max().y(), in.max().z()};
  out->record.params[6] = 1;
  for (int a = 0; a < 3; ++a) {
    out->record.params[a] = static_cast<float>(min[a]);
    out->record.params[3 + a] = static_cast<float>(max[a]);
    out->min[a] = double{out->record.params[a]};
    out->max[a] = double{out->record.params[3 + a]};
    const Graph::Node above = graph.Sub(graph.Axis(a), graph.Constant(max[a]));
    const Graph::Node below = graph.Sub(graph.Constant(min[a]), graph.Axis(a));
    const Graph::Node within = graph.Max(above, below);
    *bound = *bound < 0 ? within : graph.Max(*bound, within);
  }
  return {};
}

}  // namespace

MaybeFault ToProgram(const FieldPath& path, const gpu::implicit::Graph& graph,
                     const ProgramSource& source, const std::vector<float>& ring_points,
                     GeometryData* out) {
  const absl::StatusOr<std::vector<uint32_t>> program = gpu::implicit::Compile(graph, source);
  if (!program.ok()) {
    return Fault{path.ToString(), Reason::kQuotaExceeded, std::string(program.status().message())};
  }
  out->record.kind = gpu::PrimitiveKind::kImplicit;
  out->record.index_count = static_cast<uint32_t>(program->size());
  out->record.vertex_count = static_cast<uint32_t>(ring_points.size() / 3);
  out->arrays = gpu::GeometryArrays::Of(out->record, ring_points, *program);
  return {};
}

MaybeFault ToImplicit(const FieldPath& path, const v1::Implicit& in, const DecodeContext& context,
                      GeometryData* out) {
  const Limits& limits = context.limits;
  gpu::GeometryRecord& record = out->record;
  Parameters parameters;
  if (auto fault = ToParameters(path, in, limits, &parameters)) return fault;
  Graph graph;
  const ExpressionContext expressions{
      parameters,
      {limits.max_expression_nodes, static_cast<int>(limits.max_expression_depth)},
      graph};
  gpu::implicit::ParsedShape shape;
  if (auto fault = ToShape(FieldPath(path, "surface"), in.surface(), expressions, &shape)) {
    return fault;
  }
  ProgramSource source;
  source.surface = shape.surface;
  source.bound = shape.bound;
  if (in.has_bound()) {
    Graph::Node bound;
    if (auto fault = ToCondition(FieldPath(path, "bound"), in.bound(), expressions, &bound)) {
      return fault;
    }
    source.bound = source.bound < 0 ? bound : graph.Max(source.bound, bound);
  }
  std::vector<uint32_t> ends, table;
  std::vector<float> points;
  if (in.has_boundary()) {
    if (auto fault = ToBoundary(FieldPath(path, "boundary"), in.boundary(), limits, &source, &ends,
                                &points)) {
      return fault;
    }
    source.ring_ends = ends;
  }
  if (auto fault = ToColor(path, in, expressions, &source, &table)) return fault;
  if (in.has_domain()) {
    if (auto fault = ToDomain(FieldPath(path, "domain"), in.domain(), graph, &source.bound, out)) {
      return fault;
    }
  }
  if (in.fill() == v1::FILL_UNSPECIFIED) {
    record.fill = shape.is_region ? gpu::Fill::kSolid : gpu::Fill::kSurface;
  } else if (auto fault = ToFill(path, in.fill(), &record)) {
    return fault;
  }
  if (auto fault = ToRule(path, in.rule(), &record)) return fault;
  const bool surface = record.fill == gpu::Fill::kSurface;
  if (auto fault = ToShell(path, in.shell(), surface, limits, &record)) return fault;
  return ToProgram(path, graph, source, points, out);
}

}  // namespace voxeld::daemon::wire
