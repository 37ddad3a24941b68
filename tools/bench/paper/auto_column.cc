#include <thread>

#include "absl/strings/str_cat.h"

#include "gpu/generate/auto_generator.h"
#include "tools/bench/paper/column.h"
#if defined(VOXELD_HAVE_CUDA)
#include "gpu/cuda/cuda_generator.h"
#endif

namespace voxeld::bench::paper {
namespace {

using gpu::generate::AutoGenerator;
using gpu::generate::BytesOf;
using gpu::generate::Candidate;
using gpu::generate::Generator;

// This column has no ceiling of its own: it is compared with the other columns.
class Chosen final : public Column {
 public:
  explicit Chosen(std::unique_ptr<AutoGenerator> generator) : generator_(std::move(generator)) {}

  std::string engine() const override { return "auto"; }
  int threads() const override { return static_cast<int>(std::thread::hardware_concurrency()); }
  bool host_copy() const override { return true; }
  std::string call() const override { return "the whole call, on whichever is faster"; }
  std::string ceiling() const override { return ""; }

  absl::Status Take(const Workload& workload) override {
    workload_ = &workload;
    bytes_ = workload.voxels * BytesOf(workload.format.output);
    if (bytes_ > kMostAtOnce) return absl::OkStatus();
    auto memory = generator_->Allocate(bytes_);
    if (!memory.ok()) return memory.status();
    out_ = *std::move(memory);
    return absl::OkStatus();
  }
  absl::Status Call() override {
    const auto plan = generator_->Prepare(workload_->segments, workload_->format);
    if (!plan.ok()) return plan.status();
    if (bytes_ <= kMostAtOnce)
      return generator_->Generate(workload_->segments, *plan, workload_->format,
                                  {out_.get(), bytes_});
    return generator_->Stream(workload_->segments, *plan, workload_->format,
                              Generator::kChunkVoxels,
                              [](uint64_t, auto) { return absl::OkStatus(); });
  }
  absl::Status Ceiling() override { return absl::UnimplementedError("there is none"); }
  void Release() override { out_ = nullptr; }

 private:
  const std::unique_ptr<AutoGenerator> generator_;
  const Workload* workload_ = nullptr;
  uint64_t bytes_ = 0;
  gpu::generate::HostMemory out_;
};

}  // namespace

absl::StatusOr<std::unique_ptr<Column>> AutoColumn() {
  const int all = static_cast<int>(std::thread::hardware_concurrency());
  std::vector<Candidate> candidates;
  candidates.push_back({"cpu 1", gpu::generate::MakeCpuGenerator(1)});
  if (all > 1)
    candidates.push_back({absl::StrCat("cpu ", all), gpu::generate::MakeCpuGenerator(all)});
#if defined(VOXELD_HAVE_CUDA)
  if (auto cuda = gpu::cuda::CudaGenerator::Open(0, all); cuda.ok()) {
    const std::string name = (*cuda)->device().api().device().name;
    candidates.push_back({"cuda " + name, *std::move(cuda)});
  }
#endif
  auto generator = AutoGenerator::Make(std::move(candidates), AutoGenerator::DefaultCacheFile());
  if (!generator.ok()) return generator.status();
  return std::make_unique<Chosen>(*std::move(generator));
}

}  // namespace voxeld::bench::paper
