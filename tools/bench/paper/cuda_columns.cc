#include <cuda_runtime_api.h>

#include <algorithm>
#include <chrono>
#include <functional>
#include <thread>

#include "gpu/cuda/cuda_generator.h"
#include "tools/bench/paper/column.h"

namespace voxeld::bench::paper {
namespace {

using gpu::cuda::Block;
using gpu::cuda::CudaGenerator;
using gpu::cuda::PlacedBatch;
using gpu::generate::BytesOf;
using gpu::generate::Generator;

absl::Status ToStatus(const char* what, cudaError_t error) {
  if (error == cudaSuccess) return absl::OkStatus();
  return absl::InternalError(std::string(what) + ": " + cudaGetErrorString(error));
}

// Work that was queued once and is launched repeatedly as a whole, so that the cost of a launch is
// shared.
class Graph {
 public:
  Graph() = default;
  ~Graph() { Reset(); }
  Graph(const Graph&) = delete;
  Graph& operator=(const Graph&) = delete;

  absl::Status Record(cudaStream_t stream, const std::function<absl::Status()>& queue) {
    Reset();
    absl::Status status = ToStatus(
        "cudaStreamBeginCapture", cudaStreamBeginCapture(stream, cudaStreamCaptureModeThreadLocal));
    if (!status.ok()) return status;
    const absl::Status queued = queue();
    cudaGraph_t graph = nullptr;
    status = ToStatus("cudaStreamEndCapture", cudaStreamEndCapture(stream, &graph));
    if (status.ok())
      status = ToStatus("cudaGraphInstantiate", cudaGraphInstantiate(&graph_, graph, 0));
    if (graph != nullptr) cudaGraphDestroy(graph);
    return queued.ok() ? status : queued;
  }
  absl::Status Launch(cudaStream_t stream) {
    return ToStatus("cudaGraphLaunch", cudaGraphLaunch(graph_, stream));
  }
  void Reset() {
    if (graph_ != nullptr) cudaGraphExecDestroy(graph_);
    graph_ = nullptr;
  }

 private:
  cudaGraphExec_t graph_ = nullptr;
};

// Above this size, the launch and the wait are a negligible part of a call.
constexpr uint64_t kTogetherBelow = uint64_t{64} << 20;  // bytes
constexpr int kTogether = 64;

class DeviceColumn final : public Column {
 public:
  explicit DeviceColumn(std::shared_ptr<CudaGenerator> generator)
      : generator_(std::move(generator)) {}

  std::string engine() const override { return "cuda"; }
  int threads() const override { return 0; }
  bool host_copy() const override { return false; }
  std::string call() const override {
    return repeats() == 1 ? "a batch that lies on the device, until its voxels do"
                          : "the same, one of many calls launched together as a graph";
  }
  int repeats() const override { return bytes_ < kTogetherBelow ? kTogether : 1; }
  std::string ceiling() const override { return "cudaMemset of the same bytes"; }

  absl::Status Take(const Workload& workload) override {
    Release();
    format_ = workload.format;
    bytes_ = workload.voxels * BytesOf(format_.output);
    const auto plan = generator_->Prepare(workload.segments, format_);
    if (!plan.ok()) return plan.status();
    auto batch = generator_->Place(workload.segments, *plan);
    if (!batch.ok()) return batch.status();
    batch_ = *std::move(batch);
    auto out = generator_->device().pool().Acquire(bytes_);
    if (!out.ok()) return out.status();
    out_ = *std::move(out);
    const cudaStream_t stream = generator_->device().stream();
    absl::Status status = calls_.Record(stream, [&] {
      absl::Status queued;
      for (int i = 0; i < repeats() && queued.ok(); ++i) {
        queued = generator_->QueueOnDevice(batch_, format_, {out_.as<std::byte>(), bytes_});
      }
      return queued;
    });
    if (!status.ok()) return status;
    return ceilings_.Record(stream, [&] {
      absl::Status queued;
      for (int i = 0; i < repeats() && queued.ok(); ++i) {
        queued =
            ToStatus("cudaMemsetAsync", cudaMemsetAsync(out_.as<std::byte>(), 7, bytes_, stream));
      }
      return queued;
    });
  }
  absl::Status Call() override { return Run(calls_); }
  absl::Status Ceiling() override { return Run(ceilings_); }
  void Release() override {
    calls_.Reset();
    ceilings_.Reset();
    batch_ = PlacedBatch();
    out_ = Block();
  }

 private:
  absl::Status Run(Graph& graph) {
    absl::Status status = graph.Launch(generator_->device().stream());
    return status.ok() ? generator_->device().Wait() : status;
  }

  const std::shared_ptr<CudaGenerator> generator_;
  gpu::generate::Format format_;
  uint64_t bytes_ = 0;
  PlacedBatch batch_;
  Block out_;
  Graph calls_, ceilings_;
};

class HostColumn final : public Column {
 public:
  explicit HostColumn(std::shared_ptr<CudaGenerator> generator)
      : generator_(std::move(generator)) {}
  ~HostColumn() override { HostColumn::Release(); }

  std::string engine() const override { return "cuda"; }
  int threads() const override { return static_cast<int>(std::thread::hardware_concurrency()); }
  bool host_copy() const override { return true; }
  std::string call() const override {
    return "the whole call, from segments to voxels in pinned memory";
  }
  std::string ceiling() const override { return "copies of the same bytes to pinned memory"; }

  absl::Status Take(const Workload& workload) override {
    Release();
    workload_ = &workload;
    bytes_ = workload.voxels * BytesOf(workload.format.output);
    chunk_ = std::min(bytes_, bytes_ > kMostAtOnce
                                  ? Generator::kChunkVoxels * BytesOf(workload.format.output)
                                  : kMostAtOnce);
    auto pinned = gpu::cuda::AllocatePinned(chunk_);
    if (!pinned.ok()) return pinned.status();
    pinned_ = *pinned;
    auto block = generator_->device().pool().Acquire(chunk_);
    if (!block.ok()) return block.status();
    source_ = *std::move(block);
    return absl::OkStatus();
  }
  absl::Status Call() override {
    const auto plan = generator_->Prepare(workload_->segments, workload_->format);
    if (!plan.ok()) return plan.status();
    if (chunk_ == bytes_)
      return generator_->Generate(workload_->segments, *plan, workload_->format, pinned_);
    return generator_->Stream(workload_->segments, *plan, workload_->format,
                              Generator::kChunkVoxels,
                              [](uint64_t, auto) { return absl::OkStatus(); });
  }
  absl::Status Ceiling() override {
    const cudaStream_t stream = generator_->device().copies();
    for (uint64_t done = 0; done < bytes_; done += chunk_) {
      absl::Status status =
          ToStatus("cudaMemcpyAsync", cudaMemcpyAsync(pinned_.data(), source_.as<std::byte>(),
                                                      std::min(chunk_, bytes_ - done),
                                                      cudaMemcpyDeviceToHost, stream));
      if (!status.ok()) return status;
    }
    return ToStatus("cudaStreamSynchronize", cudaStreamSynchronize(stream));
  }
  void Release() override {
    if (!pinned_.empty()) gpu::cuda::FreePinned(pinned_);
    pinned_ = {};
    source_ = Block();
  }

 private:
  const std::shared_ptr<CudaGenerator> generator_;
  const Workload* workload_ = nullptr;
  uint64_t bytes_ = 0, chunk_ = 0;
  std::span<std::byte> pinned_;
  Block source_;
};

}  // namespace

absl::StatusOr<std::vector<std::unique_ptr<Column>>> CudaColumns() {
  auto opened = CudaGenerator::Open(0, static_cast<int>(std::thread::hardware_concurrency()));
  if (!opened.ok()) return opened.status();
  const std::shared_ptr<CudaGenerator> generator = *std::move(opened);
  std::vector<std::unique_ptr<Column>> columns;
  columns.push_back(std::make_unique<DeviceColumn>(generator));
  columns.push_back(std::make_unique<HostColumn>(generator));
  return columns;
}

absl::StatusOr<std::vector<std::pair<std::string, double>>> CudaCeilings() {
  constexpr size_t kBytes = size_t{1} << 30;
  constexpr int kTimes = 7;
  auto generator = CudaGenerator::Open(0, 1);
  if (!generator.ok()) return generator.status();
  gpu::cuda::Device& device = (*generator)->device();
  auto from = device.pool().Acquire(kBytes), to = device.pool().Acquire(kBytes);
  if (!from.ok()) return from.status();
  if (!to.ok()) return to.status();
  auto host = (*generator)->Allocate(kBytes);
  if (!host.ok()) return host.status();
  const cudaStream_t stream = device.stream();
  std::vector<std::pair<std::string, double>> out;
  const auto measure = [&](const char* name, double moved,
                           const std::function<cudaError_t()>& queue) {
    std::vector<double> rates;
    for (int i = 0; i <= kTimes; ++i) {
      const auto begin = std::chrono::steady_clock::now();
      absl::Status status = ToStatus(name, queue());
      if (status.ok()) status = device.Wait();
      if (!status.ok()) return status;
      const std::chrono::duration<double> took = std::chrono::steady_clock::now() - begin;
      if (i > 0) rates.push_back(moved / took.count() / 1e9);
    }
    std::sort(rates.begin(), rates.end());
    out.emplace_back(name, rates[rates.size() / 2]);
    return absl::OkStatus();
  };
  std::byte* const a = from->as<std::byte>();
  std::byte* const b = to->as<std::byte>();
  absl::Status status =
      measure("memset", kBytes, [&] { return cudaMemsetAsync(b, 1, kBytes, stream); });
  if (status.ok()) {
    status = measure("device copy, read and written", 2.0 * kBytes, [&] {
      return cudaMemcpyAsync(b, a, kBytes, cudaMemcpyDeviceToDevice, stream);
    });
  }
  if (status.ok()) {
    status = measure("copy to pinned memory", kBytes, [&] {
      return cudaMemcpyAsync(host->get(), a, kBytes, cudaMemcpyDeviceToHost, stream);
    });
  }
  if (!status.ok()) return status;
  return out;
}

}  // namespace voxeld::bench::paper
