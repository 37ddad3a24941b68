// Tests finding CUDA's compiler, and compiling formulas with it, for a device that need not exist.
#include <gmock/gmock.h>

#include <map>
#include <string>
#include <utility>
#include <vector>

#include "gpu/cuda/formula_source.h"
#include "gpu/cuda/nvrtc.h"
#include "gpu/implicit/graph.h"
#include "gpu/implicit/hoist.h"
#include "tests/conformance/program_generator.h"
#include "tests/programs.h"

namespace voxeld::gpu::cuda {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

std::function<std::string(const char*)> Environment(std::map<std::string, std::string> values) {
  return [values = std::move(values)](const char* name) {
    const auto it = values.find(name);
    return it == values.end() ? "" : it->second;
  };
}

TEST(Nvrtc, IsLookedForByTheVariableThenTheLoader) {
  EXPECT_THAT(Nvrtc::Places(Environment({{"VOXELD_NVRTC", "/b"}})),
              ElementsAre("/b", "libnvrtc.so.13", "libnvrtc.so.12", "libnvrtc.so",
                          "/usr/local/cuda/lib64/libnvrtc.so"));
  EXPECT_THAT(Nvrtc::Places(Environment({})),
              ElementsAre("libnvrtc.so.13", "libnvrtc.so.12", "libnvrtc.so",
                          "/usr/local/cuda/lib64/libnvrtc.so"));
  EXPECT_THAT(Nvrtc::Places(Environment({{"VOXELD_NVRTC", "off"}})), IsEmpty());
}

TEST(Nvrtc, SaysWhereItWasLookedForAndWhatIsMissing) {
  const absl::Status off = Nvrtc::Open(std::vector<std::string>{}).status();
  EXPECT_EQ(off.code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_THAT(std::string(off.message()), HasSubstr("VOXELD_NVRTC is 'off'"));
  const absl::Status none =
      Nvrtc::Open({"/nowhere/libnvrtc.so", ProgramBeside("libfake_nccl.so")}).status();
  EXPECT_EQ(none.code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_THAT(std::string(none.message()),
              AllOf(HasSubstr("/nowhere/libnvrtc.so"), HasSubstr("has no nvrtcGetErrorString")));
}

#if defined(VOXELD_HAVE_NVRTC)
std::vector<uint32_t> Gyroid() {
  implicit::Graph graph;
  implicit::Graph::Node sum = graph.Constant(0);
  for (int a = 0; a < 3; ++a) {
    sum = graph.Add(sum, graph.Mul(graph.Sin(graph.Axis(a)), graph.Cos(graph.Axis((a + 1) % 3))));
  }
  const auto program = Compile(graph, {.surface = sum});
  EXPECT_TRUE(program.ok()) << program.status();
  const uint32_t depends[3] = {1, 2, 4};
  return implicit::Hoist({program->data()}, depends);
}

std::shared_ptr<const Nvrtc> Open() {
  const auto nvrtc = Nvrtc::Open(std::vector<std::string>{VOXELD_HAVE_NVRTC});
  EXPECT_TRUE(nvrtc.ok()) << nvrtc.status();
  return *nvrtc;
}

TEST(Nvrtc, CompilesAFormulaForADevice) {
  const auto module = Open()->Compile(FormulaSource(Gyroid()), FormulaSources(), 9, 0);
  ASSERT_TRUE(module.ok()) << module.status();
  EXPECT_THAT(*module, HasSubstr("ELF"));
  EXPECT_THAT(*module, HasSubstr(kFormulaKernel));
}

TEST(Nvrtc, SaysWhichDevicesItCompilesFor) {
  const auto nvrtc = Open();
  EXPECT_EQ(nvrtc->Supports(9, 0), absl::OkStatus());
  const absl::Status status = nvrtc->Supports(99, 9);
  EXPECT_EQ(status.code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_THAT(std::string(status.message()),
              HasSubstr("compiles nothing for compute capability 99.9; install"));
}

TEST(Nvrtc, TakesTheFirstThatCompilesForTheDevice) {
  const auto nvrtc = Nvrtc::OpenFor({"/nowhere/libnvrtc.so", VOXELD_HAVE_NVRTC}, 9, 0);
  ASSERT_TRUE(nvrtc.ok()) << nvrtc.status();
  EXPECT_EQ((*nvrtc)->place(), VOXELD_HAVE_NVRTC);
  const absl::Status none =
      Nvrtc::OpenFor({"/nowhere/libnvrtc.so", VOXELD_HAVE_NVRTC}, 99, 9).status();
  EXPECT_THAT(std::string(none.message()),
              AllOf(HasSubstr("/nowhere/libnvrtc.so"), HasSubstr("compiles nothing for")));
}

TEST(Nvrtc, CompilesWhateverProgramsHave) {
  const auto nvrtc = Open();
  conformance::SceneGenerator random(conformance::SeedOr(8));
  for (int i = 0; i < 12; ++i) {
    conformance::ModelGeometry g;
    conformance::AddProgram(random, 30, g);
    const uint32_t depends[2][3] = {{1, 2, 4}, {7, 7, 7}};
    const std::string source = FormulaSource(implicit::Hoist({g.indices.data()}, depends[i % 2]));
    const auto module = nvrtc->Compile(source, FormulaSources(), 9, 0);
    ASSERT_TRUE(module.ok()) << module.status() << "\n" << source;
  }
}

TEST(Nvrtc, SaysWhatIsWrongWithASource) {
  const absl::Status status = Open()->Compile("not a kernel", FormulaSources(), 9, 0).status();
  EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(std::string(status.message()), HasSubstr("error"));
  EXPECT_EQ(Open()->Compile("", FormulaSources(), 1, 2).status().code(),
            absl::StatusCode::kInternal);  // no such device
}
#endif

}  // namespace
}  // namespace voxeld::gpu::cuda
