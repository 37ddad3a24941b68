#include "gpu/generate/auto_generator.h"

#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>

#include "absl/strings/str_cat.h"

namespace voxeld::gpu::generate {
namespace {

std::string TextOf(const std::string& file) {
  std::ifstream in(file, std::ios::binary);
  std::ostringstream text;
  text << in.rdbuf();
  return text.str();
}

// Returns the processor's model and number of processors. The candidates' names identify the rest
// of the machine.
std::string Machine() {
  std::istringstream cpuinfo(TextOf("/proc/cpuinfo"));
  std::string line, model = "unknown";
  while (std::getline(cpuinfo, line)) {
    if (line.rfind("model name", 0) != 0) continue;
    model = line.substr(line.find(':') + 1);
    break;
  }
  return absl::StrCat(model, ", ", sysconf(_SC_NPROCESSORS_ONLN), " processors");
}

// Writes the whole file or nothing.
void Write(const std::string& file, const std::string& text) {
  std::error_code error;
  std::filesystem::create_directories(std::filesystem::path(file).parent_path(), error);
  const std::string part = absl::StrCat(file, ".", getpid());
  {
    std::ofstream out(part, std::ios::binary);
    out << text;
    if (!out.flush()) error = std::make_error_code(std::errc::io_error);
  }
  if (!error) std::filesystem::rename(part, file, error);
  if (error) std::filesystem::remove(part, error);
}

}  // namespace

absl::StatusOr<std::unique_ptr<AutoGenerator>> AutoGenerator::Make(
    std::vector<Candidate> candidates, const std::string& cache_file) {
  if (candidates.empty()) return absl::InvalidArgumentError("there is no generator to choose from");
  std::vector<std::string> names;
  names.reserve(2 * candidates.size());
  for (const Candidate& candidate : candidates) {
    names.push_back(candidate.name);
    names.push_back(absl::StrCat(candidate.name, " COVER"));
  }
  const std::string machine = Machine();
  if (!cache_file.empty()) {
    absl::StatusOr<std::vector<CostCurve>> known = FromText(TextOf(cache_file), machine, names);
    if (known.ok())
      return std::make_unique<AutoGenerator>(std::move(candidates), *std::move(known));
  }
  std::vector<CostCurve> curves;
  std::vector<std::pair<std::string, CostCurve>> named;
  for (size_t i = 0; i < names.size(); ++i) {
    absl::StatusOr<CostCurve> curve = MeasureCost(
        *candidates[i / 2].generator, i % 2 == 0 ? Sampling::kEuclidean : Sampling::kCover);
    if (!curve.ok()) return curve.status();
    named.emplace_back(names[i], *curve);
    curves.push_back(*std::move(curve));
  }
  if (!cache_file.empty()) Write(cache_file, ToText(machine, named));
  return std::make_unique<AutoGenerator>(std::move(candidates), std::move(curves));
}

std::string AutoGenerator::DefaultCacheFile() {
  std::string folder;
  if (const char* cache = std::getenv("XDG_CACHE_HOME"); cache != nullptr && *cache == '/') {
    folder = cache;
  } else if (const char* home = std::getenv("HOME"); home != nullptr && *home == '/') {
    folder = absl::StrCat(home, "/.cache");
  }
  return folder.empty() ? folder : absl::StrCat(folder, "/voxeld/generator-costs");
}

size_t AutoGenerator::Choose(uint64_t voxels, uint64_t segments, Format format) const {
  const uint64_t written = voxels * BytesOf(format.output) / BytesOf(Output::kI32x3);
  const size_t kind = format.sampling == Sampling::kCover ? 1 : 0;
  const auto seconds = [&](size_t i) {
    return curves_[2 * i + kind].SecondsFor(written, segments);
  };
  size_t best = 0;
  for (size_t i = 1; i < candidates_.size(); ++i) {
    if (seconds(i) < seconds(best)) best = i;
  }
  return best;
}

absl::StatusOr<Plan> AutoGenerator::Prepare(const Batch& batch, Format format) {
  // The number of voxels is known only after planning.
  return candidates_[Choose(1, batch.size())].generator->Prepare(batch, format);
}

absl::Status AutoGenerator::Generate(const Batch& batch, const Plan& plan, Format format,
                                     std::span<std::byte> out) {
  return candidates_[Choose(plan.voxels(), batch.size(), format)].generator->Generate(batch, plan,
                                                                                      format, out);
}

absl::StatusOr<HostMemory> AutoGenerator::Allocate(size_t bytes) {
  return candidates_.back().generator->Allocate(bytes);
}

absl::Status AutoGenerator::Stream(const Batch& batch, const Plan& plan, Format format,
                                   uint64_t chunk_voxels, const TakeChunk& take) {
  return candidates_[Choose(plan.voxels(), batch.size(), format)].generator->Stream(
      batch, plan, format, chunk_voxels, take);
}

}  // namespace voxeld::gpu::generate
