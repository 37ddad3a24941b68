// Tests programs as text: compiled, they give bit by bit what running them gives, for numbers side
// by side and for numbers with gradients.
#include "gpu/implicit/formula_text.h"

#include <dlfcn.h>
#include <gmock/gmock.h>

#include <cmath>
#include <cstdlib>
#include <fstream>
#include <random>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "gpu/implicit/graph.h"
#include "gpu/implicit/hoist.h"
#include "gpu/implicit/row.h"
#include "tests/conformance/program_generator.h"
#include "tools/child/child_process.h"

namespace voxeld::gpu::implicit {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

constexpr size_t kLanes = 6;

// The values that a formula uses, in lanes: hoisted[value][lane] as value and gradient; the same in
// all lanes unless the value depends on the first axis.
struct Asked {
  float hoisted[kMostHoisted][kLanes][4];
  float coordinates[3][kLanes];
  float gradients[3][3];
  float voxel;
};

// The surroundings of the text: the interface through which compiled formulas are called.
constexpr const char* kBefore = R"(#include "gpu/implicit/row.h"
using namespace voxeld::gpu::implicit;
constexpr unsigned kLanes = 6;
struct Asked {
  float hoisted[16][kLanes][4], coordinates[3][kLanes], gradients[3][3], voxel;
};
struct At {
  const Asked& asked;
  const uint32_t* words;
  unsigned lane;
};
struct OneAt : At {
  float Hoisted(int, uint32_t v) const { return asked.hoisted[v][lane][0]; }
  float Constant(uint32_t word) const { return FromBits(words[word]); }
  float Coordinate(int r) const { return asked.coordinates[r][lane]; }
  float Voxel() const { return asked.voxel; }
};
struct LanesAt : At {
  using N = Lanes<kLanes>;
  N Hoisted(int, uint32_t v) const {
    return EachOf<kLanes>([&](size_t i) { return asked.hoisted[v][i][0]; });
  }
  N Constant(uint32_t word) const { return ConstantLike(N(), FromBits(words[word])); }
  N Coordinate(int r) const {
    return EachOf<kLanes>([&](size_t i) { return asked.coordinates[r][i]; });
  }
  N Voxel() const { return ConstantLike(N(), asked.voxel); }
};
struct DualAt : At {
  using N = Dual<float>;
  N Hoisted(int, uint32_t v) const {
    const float* const h = asked.hoisted[v][lane];
    return {h[0], {h[1], h[2], h[3]}};
  }
  N Constant(uint32_t word) const { return ConstantLike(N(), FromBits(words[word])); }
  N Coordinate(int r) const {
    const float* const g = asked.gradients[r];
    return {asked.coordinates[r][lane], {g[0], g[1], g[2]}};
  }
  N Voxel() const { return ConstantLike(N(), asked.voxel); }
};
template <class Formula>
void Values(const Asked& asked, const uint32_t* words, float* out) {
  const typename Formula::template Row<float> row(OneAt{{asked, words, 0}});
  const auto values = Formula::template Value<Lanes<kLanes>>(row, LanesAt{{asked, words, 0}});
  for (unsigned i = 0; i < kLanes; ++i) out[i] = values.at[i];
}
template <class Formula>
void Duals(const Asked& asked, const uint32_t* words, float* out) {
  for (unsigned i = 0; i < kLanes; ++i) {
    const DualAt at{{asked, words, i}};
    const typename Formula::template Row<Dual<float>> row(at);
    const auto p = Formula::template Value<Dual<float>>(row, at);
    out[i * 4] = p.value;
    for (int a = 0; a < 3; ++a) out[i * 4 + 1 + a] = p.d[a];
  }
}
)";

using Compiled = void(const Asked&, const uint32_t*, float*);

// Formulas in a library that the compiler has made from their texts.
class Library {
 public:
  explicit Library(const std::vector<std::vector<uint32_t>>& programs)
      : folder_(*child::TemporaryFolder::Make("formula")) {
    const std::string source = folder_.path() + "/formulas.cc",
                      made = folder_.path() + "/formulas.so";
    {
      std::ofstream text(source);
      text << kBefore;
      for (size_t i = 0; i < programs.size(); ++i) {
        text << "namespace f" << i << " {\n" << FormulaText(programs[i]) << "}\n";
        text << "extern \"C\" void values" << i
             << "(const Asked& a, const uint32_t* w, float* o) { Values<f" << i
             << "::Formula>(a, w, o); }\n";
        text << "extern \"C\" void duals" << i
             << "(const Asked& a, const uint32_t* w, float* o) { Duals<f" << i
             << "::Formula>(a, w, o); }\n";
      }
    }
    child::ChildOptions options;
    options.patience = std::chrono::minutes(5);
    auto compiler = child::ChildProcess::Start(
        {VOXELD_CXX_COMPILER, "-std=c++20", "-O1", "-ffp-contract=off", "-fPIC", "-shared", "-w",
         "-I" VOXELD_SOURCE_DIR, "-o", made, source},
        options);
    if (!compiler.ok()) {
      ADD_FAILURE() << compiler.status();
      return;
    }
    EXPECT_EQ((*compiler)->Wait(), 0) << (*compiler)->output();
    library_ = dlopen(made.c_str(), RTLD_NOW | RTLD_LOCAL);
    EXPECT_NE(library_, nullptr) << dlerror();
  }
  ~Library() {
    if (library_ != nullptr) dlclose(library_);
  }
  Compiled* Find(const char* what, size_t i) const {
    return library_ == nullptr
               ? nullptr
               : reinterpret_cast<Compiled*>(dlsym(library_, absl::StrCat(what, i).c_str()));
  }

 private:
  child::TemporaryFolder folder_;
  void* library_ = nullptr;
};

Asked RandomAsked(const HoistedView& view, std::mt19937_64& random) {
  const auto number = [&] {
    return static_cast<float>(std::uniform_real_distribution<double>(-20, 20)(random));
  };
  Asked asked = {};
  for (uint32_t v = 0; v < view.count(); ++v) {
    for (size_t lane = 0; lane < kLanes; ++lane) {
      for (int i = 0; i < 4; ++i) {
        asked.hoisted[v][lane][i] =
            lane == 0 || view.axis_of(v) == 0 ? number() : asked.hoisted[v][0][i];
      }
    }
  }
  for (auto& coordinate : asked.coordinates) {
    for (float& x : coordinate) x = number();
  }
  for (auto& gradient : asked.gradients) {
    for (float& d : gradient) d = number();
  }
  asked.voxel = 0.25f;
  return asked;
}

template <class N, class Values>
N RestOf(const HoistedView& view, const N q[3], float voxel, Values&& values) {
  N slots[kMostSlots];
  Run(view.rest_code(), view.rest(), q, voxel, slots, values);
  return slots[view.rest_slot()];
}

bool Same(float a, float b) { return IsNan(a) ? IsNan(b) : BitsOf(a) == BitsOf(b); }

TEST(FormulaText, GivesWhatRunningTheProgramGives) {
  const uint64_t seed = conformance::SeedOr(20261125);
  std::cout << "seed " << seed << "\n";
  conformance::SceneGenerator scenes(seed);
  std::mt19937_64 random(seed);
  constexpr size_t kPrograms = 60;
  std::vector<std::vector<uint32_t>> programs;
  for (size_t i = 0; i < kPrograms; ++i) {
    conformance::ModelGeometry g;
    conformance::AddProgram(scenes, 30, g);
    // Along the axes, turned about one of them, or turned about all.
    const uint32_t depends[3][3] = {{1, 2, 4}, {3, 3, 4}, {7, 7, 7}};
    programs.push_back(Hoist({g.indices.data()}, depends[i % 3]));
  }
  const Library library(programs);
  size_t differing = 0, numbers = 0;
  for (size_t i = 0; i < kPrograms; ++i) {
    const HoistedView view{programs[i].data()};
    Compiled* const values = library.Find("values", i);
    Compiled* const duals = library.Find("duals", i);
    ASSERT_NE(values, nullptr);
    ASSERT_NE(duals, nullptr);
    for (int round = 0; round < 50; ++round) {
      const Asked asked = RandomAsked(view, random);
      float got[kLanes], got_dual[kLanes][4];
      values(asked, programs[i].data(), got);
      duals(asked, programs[i].data(), &got_dual[0][0]);
      for (size_t lane = 0; lane < kLanes; ++lane) {
        float q[3];
        Dual<float> dual[3];
        for (int r = 0; r < 3; ++r) {
          q[r] = asked.coordinates[r][lane];
          const float* const d = asked.gradients[r];
          dual[r] = {q[r], {d[0], d[1], d[2]}};
        }
        const float want =
            RestOf(view, q, asked.voxel, [&](uint32_t v) { return asked.hoisted[v][lane][0]; });
        const Dual<float> want_dual = RestOf(view, dual, asked.voxel, [&](uint32_t v) {
          const float* const h = asked.hoisted[v][lane];
          return Dual<float>{h[0], {h[1], h[2], h[3]}};
        });
        numbers += IsFinite(want) ? 1 : 0;
        differing += Same(got[lane], want) && Same(got_dual[lane][0], want_dual.value) ? 0 : 1;
        for (int a = 0; a < 3; ++a)
          differing += Same(got_dual[lane][1 + a], want_dual.d[a]) ? 0 : 1;
      }
    }
    EXPECT_EQ(differing, 0u) << "program " << i << ":\n" << FormulaText(programs[i]);
    if (differing != 0) return;
  }
  EXPECT_GT(numbers, kPrograms * 50 * kLanes / 2) << "most should be numbers";
}

std::vector<uint32_t> WaveOf(double wave, double shift, bool add) {
  Graph graph;
  const Graph::Node x = graph.Sin(graph.Mul(graph.Axis(0), graph.Constant(wave)));
  const Graph::Node yz = graph.Mul(graph.Axis(1), graph.Axis(2));
  const Graph::Node sum = add ? graph.Add(x, yz) : graph.Mul(x, yz);
  const absl::StatusOr<std::vector<uint32_t>> program =
      Compile(graph, {.surface = graph.Sub(sum, graph.Constant(shift))});
  EXPECT_TRUE(program.ok()) << program.status();
  const uint32_t depends[3] = {1, 2, 4};
  return Hoist({program->data()}, depends);
}

TEST(FormulaText, ProgramsThatDifferInConstantsShareIt) {
  const auto one = WaveOf(0.5, 3, true), other = WaveOf(0.25, 7, true),
             third = WaveOf(0.5, 3, false);
  EXPECT_NE(one, other);
  EXPECT_EQ(FormulaKey(one), FormulaKey(other));
  EXPECT_EQ(FormulaText(one), FormulaText(other));
  EXPECT_NE(FormulaKey(one), FormulaKey(third));
  EXPECT_NE(FormulaText(one), FormulaText(third));
}

TEST(FormulaText, WhatIsTheSameAlongXIsWorkedOutOnceARow) {
  const std::string text = FormulaText(WaveOf(0.5, 3, true));
  const size_t voxel = text.find("static VOXELD_HD M Value");
  ASSERT_NE(voxel, std::string::npos);
  EXPECT_THAT(text.substr(0, voxel), HasSubstr("Mul("));  // y·z
  EXPECT_THAT(text.substr(voxel), Not(HasSubstr("Mul(")));
  EXPECT_THAT(text.substr(voxel), HasSubstr("at.Hoisted(0, 0)"));  // the sine
  EXPECT_THAT(text, Not(HasSubstr("Sin(")));                       // is hoisted
}

TEST(FormulaText, WeighsWhatIsNotHoisted) {
  Graph graph;
  Graph::Node sum = graph.Axis(0);
  for (int a = 1; a < 3; ++a) sum = graph.Add(sum, graph.Axis(a));
  const auto program = Compile(graph, {.surface = graph.Sin(sum)});
  ASSERT_TRUE(program.ok());
  const uint32_t depends[3] = {1, 2, 4};
  const uint64_t sine_of_all = FormulaWeight(Hoist({program->data()}, depends));
  EXPECT_GT(sine_of_all, FormulaWeight(WaveOf(0.5, 3, true)));
}

}  // namespace
}  // namespace voxeld::gpu::implicit
