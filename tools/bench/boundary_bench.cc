// Measures what it costs to run an engine in its own process: whole frames, from a change to the
// end of its frame, in this process and through a worker.
//
//   voxel-boundary-bench [--engines cpu,cpu_worker] [--lines 1000,1000000] [--repetitions 15]
//                        [--size 128] [--threads 0] [--json]
//
// Engines: cpu, cpu_worker; cuda (in this process, if the build has CUDA), cuda_worker. A worker's
// times are compared with those of the same engine in this process, if both are measured. Engines
// take turns within each repetition, and only one works at a time; the first repetition is not
// counted. A change is written to staging, applied and drawn without waiting in between, as the
// daemon does it: either all lines change, or one of the hundred geometries that hold them.
//
// A worker registers its segments with CUDA. In this process the frame's buffer is registered and
// staging is not.
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <future>
#include <memory>
#include <optional>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "display/geometry/footprint.h"
#include "display/sync/clock.h"
#include "gpu/delta.h"
#include "gpu/engine.h"
#include "tools/bench/samples.h"
#if defined(VOXELD_HAVE_CUDA)
#include "gpu/cuda/cuda_engine.h"
#include "gpu/cuda/pin.h"
#endif

namespace voxeld::bench {
namespace {

constexpr int kParts = 100;        // geometries that hold the lines
constexpr float kLineLength = 20;  // voxels along each axis, at most

struct Options {
  std::vector<std::string> engines = {"cpu", "cpu_worker"};
  std::vector<int> lines = {1000, 1'000'000};
  int repetitions = 15;
  int size = 128;
  int threads = 0;
  bool json = false;
};

[[noreturn]] void Fail(const std::string& why) {
  std::fprintf(stderr, "voxel-boundary-bench: %s\n", why.c_str());
  std::exit(1);
}

void Check(const absl::Status& status) {
  if (!status.ok()) Fail(status.ToString());
}

std::unique_ptr<gpu::Engine> MakeEngine(const std::string& name, int threads) {
  gpu::EngineOptions options;
  options.threads = threads;
  options.worker_deadline_ns = 120'000'000'000;
  absl::StatusOr<std::unique_ptr<gpu::Engine>> engine =
      absl::InvalidArgumentError("engines are cpu, cpu_worker, cuda, cuda_worker");
  if (name == "cpu" || name == "cpu_worker") {
    options.kind = gpu::EngineKind::kCpu;
    options.in_worker = name == "cpu_worker";
    engine = gpu::CreateEngine(options);
  } else if (name == "cuda_worker") {
    options.kind = gpu::EngineKind::kCuda;
    engine = gpu::CreateEngine(options);
  } else if (name == "cuda") {
#if defined(VOXELD_HAVE_CUDA)
    engine = gpu::CreateCudaEngine(options, "a benchmark");
#else
    engine = absl::FailedPreconditionError("this build has no CUDA engine");
#endif
  }
  if (!engine.ok()) Fail(absl::StrCat(name, ": ", engine.status().message()));
  return *std::move(engine);
}

gpu::Target StackTarget(int32_t n) {
  display::PlanarStack stack;
  stack.width_px = stack.height_px = n;
  for (int32_t s = 0; s < n; ++s) stack.positions_mm.push_back(s - (n - 1) * 0.5);
  gpu::Target target;
  target.geometry = {stack, {}};
  target.geometry.grid = display::DefaultGrid(target.geometry);
  target.layout = {.slices = n, .width = n, .height = n};
  target.tone.SetCurve(display::Tone::Linear());
  return target;
}

using Lines = std::vector<float>;  // pairs of vertices

// Two sets of kParts parts; the scene alternates between them.
struct Scene {
  std::vector<Lines> parts[2];

  Scene(int count, int32_t size) {
    std::mt19937 random(7);
    const auto most = static_cast<float>(size);
    std::uniform_real_distribution<float> at(0, most), step(-kLineLength, kLineLength);
    for (std::vector<Lines>& set : parts) {
      for (int part = 0; part < kParts; ++part) {
        Lines& lines = set.emplace_back();
        for (int i = 0; i < count / kParts; ++i) {
          float start[3];
          for (float& s : start) lines.push_back(s = at(random));
          for (float s : start) lines.push_back(std::clamp(s + step(random), 0.0F, most - 0.01F));
        }
      }
    }
  }
};

// An engine that is being measured.
class Subject {
 public:
  Subject(std::string name, const gpu::Target& target, int threads)
      : name_(std::move(name)),
        engine_(MakeEngine(name_, threads)),
        bytes_(target.layout.bytes()),
        changed_in_(target.layout.pictures()) {
#if defined(VOXELD_HAVE_CUDA)
    if (name_ == "cuda") gpu::cuda::PinMemory(bytes_);
#endif
    std::promise<absl::Status> done;
    engine_->SetTarget(target, [&](absl::Status status) { done.set_value(std::move(status)); });
    Check(done.get_future().get());
  }
  ~Subject() {
#if defined(VOXELD_HAVE_CUDA)
    if (name_ == "cuda") gpu::cuda::UnpinMemory(bytes_);
#endif
  }
  Subject(const Subject&) = delete;
  Subject& operator=(const Subject&) = delete;

  const std::string& name() const { return name_; }
  // Returns the name of the engine of the same kind in this process.
  std::string baseline() const { return name_.substr(0, name_.find('_')); }
  const std::vector<std::byte>& pictures() const { return bytes_; }

  // Replaces parts [begin, end) by those of `set` and draws a frame. Returns: nanoseconds from the
  // change to the end of the frame.
  int64_t Draw(const std::vector<Lines>& set, int begin, int end) {
    const sync::TimeNs start = clock_.Now();
    const gpu::LayerRecord layer{.id = 1};
    size_t size = gpu::DeltaWriter::SizeOf(layer);
    for (int part = begin; part < end; ++part) {
      const gpu::GeometryRecord g = Geometry(part, set);
      size += gpu::DeltaWriter::SizeOf(g) + gpu::DeltaWriter::SizeOf(gpu::DrawableRecord{}) +
              gpu::DeltaWriter::kSizeOfId;
    }
    absl::StatusOr<gpu::StagingBlock> block = engine_->AcquireStaging(size);
    Check(block.status());
    gpu::DeltaWriter writer(block->bytes());
    writer.PutLayer(layer);
    for (int part = begin; part < end; ++part) {
      const gpu::GeometryRecord g = Geometry(part, set);
      const auto id = static_cast<uint64_t>(part);
      if (drawn_ > 0) writer.Drop(gpu::Op::kDropGeometry, g.id);
      writer.PutGeometry(g, set[id], {}, {});
      writer.PutDrawable({.id = g.id, .geometry = g.id, .layer = 1});
    }
    std::promise<absl::Status> applied, drawn;
    engine_->Apply(*std::move(block), writer.size(),
                   [&](absl::Status status) { applied.set_value(std::move(status)); });
    engine_->SubmitFrame(
        {drawn_ + 1, drawn_}, {bytes_, changed_in_},
        [&](const absl::StatusOr<gpu::FrameResult>& result) { drawn.set_value(result.status()); });
    Check(applied.get_future().get());
    Check(drawn.get_future().get());
    ++drawn_;
    return clock_.Now() - start;
  }

 private:
  static gpu::GeometryRecord Geometry(int part, const std::vector<Lines>& set) {
    gpu::GeometryRecord g;
    g.id = static_cast<uint64_t>(part) + 1;
    g.kind = gpu::PrimitiveKind::kSegments;
    g.color = 0x808080 + static_cast<uint32_t>(part);
    g.vertex_count = static_cast<uint32_t>(set[static_cast<size_t>(part)].size() / 3);
    return g;
  }

  const std::string name_;
  const std::unique_ptr<gpu::Engine> engine_;
  std::vector<std::byte> bytes_;
  std::vector<uint64_t> changed_in_;
  uint64_t drawn_ = 0;
  const sync::SystemClock clock_;
};

// Lets each engine draw one change in turn, repeatedly; all of them must produce the same slice
// images.
std::vector<Row> Measure(const std::vector<std::unique_ptr<Subject>>& subjects, const Scene& scene,
                         const std::string& name, int parts, int repetitions) {
  std::vector<Row> rows;
  rows.reserve(subjects.size());
  for (const auto& subject : subjects) rows.push_back({name, subject->name(), subject->baseline()});
  for (int repetition = 0; repetition <= repetitions; ++repetition) {
    for (size_t i = 0; i < subjects.size(); ++i) {
      const size_t turn = (i + static_cast<size_t>(repetition)) % subjects.size();
      const int64_t ns = subjects[turn]->Draw(scene.parts[repetition % 2], 0, parts);
      if (repetition > 0) rows[turn].times_ns.push_back(ns);
    }
    for (const auto& subject : subjects) {
      if (subject->pictures() != subjects[0]->pictures()) {
        Fail(absl::StrCat(subject->name(), " and ", subjects[0]->name(), " draw differently"));
      }
    }
  }
  return rows;
}

Options OptionsOf(int argc, char** argv) {
  Options options;
  for (int i = 1; i < argc; ++i) {
    const std::string flag = argv[i];
    if (flag == "--json") {
      options.json = true;
      continue;
    }
    if (i + 1 == argc) Fail(absl::StrCat(flag, ": unknown, or without its value"));
    const std::string value = argv[++i];
    const auto number = [&](const std::string& text, int least) {
      int n = 0;
      if (!absl::SimpleAtoi(text, &n) || n < least) {
        Fail(absl::StrCat(flag, ": '", text, "', must be a number from ", least, " on"));
      }
      return n;
    };
    if (flag == "--engines") {
      options.engines = SplitList(value);
    } else if (flag == "--lines") {
      options.lines.clear();
      for (const std::string& lines : SplitList(value)) {
        options.lines.push_back(number(lines, kParts));
      }
    } else if (flag == "--repetitions") {
      options.repetitions = number(value, 1);
    } else if (flag == "--size") {
      options.size = number(value, 1);
    } else if (flag == "--threads") {
      options.threads = number(value, 0);
    } else {
      Fail(absl::StrCat(flag, ": no such option"));
    }
  }
  if (options.engines.empty()) Fail("--engines: none");
  return options;
}

int Main(int argc, char** argv) {
  const Options options = OptionsOf(argc, argv);
  const gpu::Target target = StackTarget(options.size);
  std::vector<Row> rows;
  for (const int lines : options.lines) {
    const Scene scene(lines, options.size);
    std::vector<std::unique_ptr<Subject>> subjects;
    subjects.reserve(options.engines.size());
    for (const std::string& engine : options.engines) {
      subjects.push_back(std::make_unique<Subject>(engine, target, options.threads));
    }
    for (const auto& [what, parts] : {std::pair("all new", kParts), {"1 % new", kParts / 100}}) {
      const std::string name = absl::StrCat(lines, " lines, ", what);
      for (Row& row : Measure(subjects, scene, name, parts, options.repetitions)) {
        rows.push_back(std::move(row));
      }
    }
  }
  std::fputs((options.json ? JsonOf(rows) : TableOf(rows)).c_str(), stdout);
  return 0;
}

}  // namespace
}  // namespace voxeld::bench

int main(int argc, char** argv) { return voxeld::bench::Main(argc, argv); }
