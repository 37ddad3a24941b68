#include "tests/conformance/program_generator.h"

#include <cmath>
#include <utility>

#include "gpu/implicit/graph.h"

namespace voxeld::gpu::conformance {
namespace {

using implicit::Graph;
using Node = Graph::Node;

class ProgramGenerator {
 public:
  ProgramGenerator(SceneGenerator& random, int size) : random_(random), size_(size) {}

  Graph& graph() { return graph_; }

  // Returns a shape that is likely to have a surface here, or any shape at all.
  Node Shape(int depth) {
    switch (random_.Int(0, depth > 0 ? 7 : 3)) {
      case 0:  // a ball, or an ellipsoid
        return graph_.Sub(SumOfSquares(), Number(random_.Real(0, size_ * size_ / 4.0)));
      case 1:  // a plane
        return graph_.Sub(Linear(), Number(random_.Real(-1, 1) * size_));
      case 2: {  // waves
        const double wave = random_.Real(0.1, 1);
        Node sum = Number(random_.Real(-0.5, 0.5));
        for (int a = 0; a < 3; ++a) {
          const Node s = graph_.Sin(graph_.Mul(graph_.Axis(a), Number(wave)));
          const Node c = graph_.Cos(graph_.Mul(graph_.Axis((a + 1) % 3), Number(wave)));
          sum = graph_.Add(sum, graph_.Mul(s, c));
        }
        return sum;
      }
      case 3: {  // a torus
        const Node ring = graph_.Sub(Length(0, 1), Number(random_.Real(1, size_ / 2.0)));
        const Node pair[2] = {ring, Centred(2)};
        return graph_.Sub(graph_.Length(pair), Number(random_.Real(0, 4)));
      }
      case 4:
        return graph_.Min(Shape(depth - 1), Shape(depth - 1));
      case 5:
        return graph_.Max(Shape(depth - 1), graph_.Neg(Shape(depth - 1)));
      case 6:
        return graph_.SmoothMin(Shape(depth - 1), Shape(depth - 1), Number(random_.Real(0, 5)));
      default:
        return graph_.Sub(Any(depth + 2), Number(random_.Real(-2, 2)));
    }
  }

  Node Any(int depth) {
    if (depth == 0 || random_.Chance(0.1)) {
      if (random_.Chance(0.1)) return graph_.Voxel();
      return random_.Chance(0.3) ? Number(random_.Real(-3, 3))
                                 : graph_.Axis(static_cast<int>(random_.Int(0, 2)));
    }
    const auto any = [&] { return Any(depth - 1); };
    switch (random_.Int(0, 19)) {
      case 0:
        return graph_.Neg(any());
      case 1:
        return graph_.Abs(any());
      case 2:
        return graph_.Square(any());
      case 3:
        return graph_.Sqrt(any());
      case 4:
        return graph_.Cbrt(any());
      case 5:
        return graph_.Sin(any());
      case 6:
        return graph_.Cos(any());
      case 7:
        return graph_.Exp(any());
      case 8:
        return graph_.Log(any());
      case 9:
        return graph_.Floor(any());
      case 10:
        return graph_.PowI(any(), static_cast<int32_t>(random_.Int(-3, 7)));
      case 11:
        return graph_.Atan2(any(), any());
      case 12:
        return graph_.Div(any(), any());
      case 13:
        return graph_.Min(any(), any());
      case 14:
        return graph_.Max(any(), any());
      case 15:
        return graph_.Mod(any(), any());
      case 16:
        return graph_.Sub(any(), any());
      case 17:
        return graph_.Tanh(any());
      case 18:
        return graph_.Mul(any(), any());
      default:
        return graph_.Add(any(), any());
    }
  }

 private:
  Node Number(double value) { return graph_.Constant(value); }
  Node Centred(int axis) { return graph_.Sub(graph_.Axis(axis), Number(random_.Real(0, size_))); }
  Node SumOfSquares() {
    Node sum = graph_.Square(Centred(0));
    for (int a = 1; a < 3; ++a) {
      sum = graph_.Add(sum, graph_.Mul(Number(random_.Real(0.2, 2)), graph_.Square(Centred(a))));
    }
    return sum;
  }
  Node Linear() {
    Node sum = graph_.Mul(Number(random_.Real(-1, 1)), graph_.Axis(0));
    for (int a = 1; a < 3; ++a) {
      sum = graph_.Add(sum, graph_.Mul(Number(random_.Real(-1, 1)), graph_.Axis(a)));
    }
    return sum;
  }
  Node Length(int a, int b) {
    const Node pair[2] = {Centred(a), Centred(b)};
    return graph_.Length(pair);
  }

  SceneGenerator& random_;
  double size_;
  Graph graph_;
};

}  // namespace

void AddProgram(SceneGenerator& random, int size, ModelGeometry& g) {
  ProgramGenerator make(random, size);
  implicit::ProgramSource source;
  source.surface = random.Chance(0.85) ? make.Shape(2) : make.Any(5);
  if (random.Chance(0.3)) source.bound = random.Chance(0.8) ? make.Shape(1) : make.Any(3);
  std::vector<uint32_t> table;
  if (random.Chance(0.3)) {
    const int roots = random.Chance(0.5) ? 3 : 1;
    for (int r = 0; r < roots; ++r) source.color[r] = make.Any(2);
    if (roots == 1) {
      for (uint32_t i = 0; i < implicit::kTableColors; ++i) table.push_back(random.RandomColor());
      source.table = table;
    }
  }
  std::vector<uint32_t> ends;
  if (random.Chance(0.15)) {
    source.ring_axis = static_cast<uint32_t>(random.Int(0, 2));
    for (int64_t rings = random.Int(1, 3); rings > 0; --rings) {
      for (int64_t points = random.Int(0, 6); points > 0; --points) {
        for (int a = 0; a < 3; ++a) {
          g.positions.push_back(static_cast<float>(random.Real(-0.2 * size, 1.2 * size)));
        }
      }
      ends.push_back(static_cast<uint32_t>(g.positions.size() / 3));
    }
    source.ring_ends = ends;
  }
  g.indices = *implicit::Compile(make.graph(), source);
  g.record.vertex_count = static_cast<uint32_t>(g.positions.size() / 3);
  g.record.index_count = static_cast<uint32_t>(g.indices.size());
  for (float& p : g.record.params) p = 0;
  if (random.Chance(0.3)) {
    g.record.params[6] = 1;
    for (int a = 0; a < 3; ++a) {
      g.record.params[a] = static_cast<float>(random.Real(-0.2 * size, size));
      g.record.params[3 + a] = g.record.params[a] + static_cast<float>(random.Real(0, size));
    }
  }
}

}  // namespace voxeld::gpu::conformance
