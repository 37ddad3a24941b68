#include "tools/bench/frame/subject.h"

#include <future>
#include <utility>

#include "absl/strings/str_cat.h"
#include "gpu/cpu/cpu_engine.h"
#include "tools/bench/frame/cuda_machine.h"

namespace voxeld::bench::frame {
namespace {

gpu::GeometryRecord RecordOf(const Content& content, uint64_t id) {
  gpu::GeometryRecord record = content.record;
  record.id = id;
  record.vertex_count = static_cast<uint32_t>(content.positions.size() / 3);
  record.index_count = static_cast<uint32_t>(content.indices.size());
  return record;
}

gpu::DrawableRecord DrawableOf(const Content& content, uint64_t id, uint64_t geometry) {
  return {.id = id,
          .geometry = geometry,
          .layer = content.layer,
          .priority = content.priority,
          .erase = content.erase,
          .transform = content.transform};
}

// The deadline is generous because the first frames map and pin gigabytes.
constexpr int64_t kDeadline = 60 * sync::kSecond;

size_t SizeOf(const Content& content) {
  return gpu::DeltaWriter::SizeOf(RecordOf(content, 1)) +
         gpu::DeltaWriter::SizeOf(gpu::DrawableRecord{}) + gpu::DeltaWriter::kSizeOfId;
}

}  // namespace

Subject::Subject(bool pinned, std::unique_ptr<gpu::Engine> engine, const Scene& scene)
    : pinned_(pinned),
      engine_(std::move(engine)),
      scene_(scene),
      bytes_(scene.target.layout.bytes()),
      changed_in_(scene.target.layout.pictures()) {
  if (pinned_) PinFrame(bytes_);
}

Subject::~Subject() {
  if (pinned_) UnpinFrame(bytes_);
}

absl::StatusOr<std::unique_ptr<Subject>> Subject::Create(const Machine& machine,
                                                         const Scene& scene) {
  gpu::EngineOptions options;
  options.threads = machine.threads;
  const bool cuda = machine.engine == "cuda";
  absl::StatusOr<std::unique_ptr<gpu::Engine>> made = absl::InternalError("none");
  if (machine.gpus > 0) {
    options.kind = cuda ? gpu::EngineKind::kCuda : gpu::EngineKind::kCpu;
    options.in_worker = true;
    for (int g = 0; g < machine.gpus; ++g) options.devices.push_back(g);
    options.nccl = machine.nccl;
    options.worker_deadline_ns = kDeadline;
    made = gpu::CreateEngine(options);
  } else {
    made = cuda ? MakeCudaEngine(options, machine.keep_tiles)
                : gpu::CreateCpuEngine(options, "a benchmark");
  }
  if (!made.ok()) return made.status();
  const bool pinned = cuda && machine.gpus == 0;
  std::unique_ptr<Subject> subject(new Subject(pinned, *std::move(made), scene));
  if (absl::Status status = subject->SetTarget(); !status.ok()) return status;
  return subject;
}

absl::Status Subject::SetTarget() {
  std::promise<absl::Status> done;
  engine_->SetTarget(scene_.target,
                     [&](absl::Status status) { done.set_value(std::move(status)); });
  return done.get_future().get();
}

// Writes geometries and drawables to staging. Those of `contents` have numbers from 1 on and those
// of `changing` follow; the geometries of `changing` use one set of numbers in even frames and
// another in odd ones.
absl::StatusOr<gpu::StagingBlock> Subject::Change(size_t* size) {
  const bool first = drawn_ == 0;
  const auto& set = scene_.changing[drawn_ % 2];
  const auto& before = scene_.changing[(drawn_ + 1) % 2];
  const bool moves = set.empty();
  size_t room = 0;
  if (first || moves) room += scene_.layers.size() * gpu::DeltaWriter::SizeOf(gpu::LayerRecord{});
  if (first) {
    for (const Content& content : scene_.contents) room += SizeOf(content);
  }
  for (const Content& content : set) room += SizeOf(content);
  absl::StatusOr<gpu::StagingBlock> block = engine_->AcquireStaging(room);
  if (!block.ok()) return block;
  gpu::DeltaWriter writer(block->bytes());
  if (first || moves) {
    for (gpu::LayerRecord layer : scene_.layers) {
      if (moves) layer.transform.m[3] += static_cast<double>(drawn_ % 2);
      writer.PutLayer(layer);
    }
  }
  uint64_t id = 0;
  const auto put = [&](const Content& content, uint64_t geometry) {
    writer.PutGeometry(RecordOf(content, geometry), content.positions, content.indices,
                       content.colors);
    writer.PutDrawable(DrawableOf(content, id, geometry));
  };
  for (const Content& content : scene_.contents) {
    ++id;
    if (first) put(content, id);
  }
  const uint64_t base = id;
  const uint64_t now = base + drawn_ % 2 * set.size();
  const uint64_t then = base + (drawn_ + 1) % 2 * set.size();
  for (size_t i = 0; i < set.size(); ++i) {
    ++id;
    put(set[i], now + i + 1);
  }
  for (size_t i = 0; !first && i < before.size(); ++i) {
    writer.Drop(gpu::Op::kDropGeometry, then + i + 1);
  }
  *size = writer.size();
  return block;
}

absl::StatusOr<FrameTimes> Subject::Draw() {
  size_t size = 0;
  absl::StatusOr<gpu::StagingBlock> block = Change(&size);
  if (!block.ok()) return block.status();
  FrameTimes times;
  std::promise<absl::Status> applied;
  std::promise<absl::StatusOr<gpu::FrameResult>> drawn;
  const sync::TimeNs start = clock_.Now();
  engine_->Apply(*std::move(block), size,
                 [&](absl::Status status) { applied.set_value(std::move(status)); });
  if (absl::Status status = applied.get_future().get(); !status.ok()) return status;
  const sync::TimeNs taken = clock_.Now();
  engine_->SubmitFrame(
      {drawn_ + 1, drawn_}, {bytes_, changed_in_},
      [&](absl::StatusOr<gpu::FrameResult> result) { drawn.set_value(std::move(result)); });
  absl::StatusOr<gpu::FrameResult> result = drawn.get_future().get();
  if (!result.ok()) return result.status();
  times.host_ns = clock_.Now() - taken;
  times.apply_ns = taken - start;
  times.result = *std::move(result);
  ++drawn_;
  return times;
}

}  // namespace voxeld::bench::frame
