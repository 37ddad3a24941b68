// Chooses the fastest generator for each batch: a few segments are done before a GPU has started
// (the paper's conclusion 2); many are not.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "gpu/generate/cost_model.h"
#include "gpu/generate/generator.h"

namespace voxeld::gpu::generate {

struct Candidate {
  std::string name;  // unique, without tabs and line ends
  std::unique_ptr<Generator> generator;
};

class AutoGenerator final : public Generator {
 public:
  // Allocate returns the memory of the last candidate, so put GPUs last. Reads the candidates'
  // costs from `cache_file`, or measures and writes them there. If it is empty, always measures. A
  // file that cannot be written is not an error.
  static absl::StatusOr<std::unique_ptr<AutoGenerator>> Make(std::vector<Candidate> candidates,
                                                             const std::string& cache_file);
  // With known costs. Each candidate has two curves: one for steps (EUCLIDEAN, THIN), one for
  // COVER.
  AutoGenerator(std::vector<Candidate> candidates, std::vector<CostCurve> curves)
      : candidates_(std::move(candidates)), curves_(std::move(curves)) {}

  // Returns the default path of the file with costs: in $XDG_CACHE_HOME/voxeld or ~/.cache/voxeld;
  // empty without either.
  static std::string DefaultCacheFile();

  // Returns the index of the candidate for a batch of that size. Voxels count by their bytes in
  // `format`.
  size_t Choose(uint64_t voxels, uint64_t segments, Format format = {}) const;

  std::string name() const override { return "auto"; }
  absl::StatusOr<Plan> Prepare(const Batch& batch, Format format) override;
  absl::Status Generate(const Batch& batch, const Plan& plan, Format format,
                        std::span<std::byte> out) override;
  absl::StatusOr<HostMemory> Allocate(size_t bytes) override;
  absl::Status Stream(const Batch& batch, const Plan& plan, Format format, uint64_t chunk_voxels,
                      const TakeChunk& take) override;

 private:
  const std::vector<Candidate> candidates_;
  const std::vector<CostCurve> curves_;
};

}  // namespace voxeld::gpu::generate
