// Tests the core against a plain sequential model: random operations of many clients, displays and
// operators under a clock that stands still (tests/daemon/core/model).
//
//   VOXELD_SEEDS=100000 core_model_test     runs that many seeds instead of CI's
//   VOXELD_SEED=4711 core_model_test        the first of them; the only one unless VOXELD_SEEDS is given
//   VOXELD_TRACE=1 VOXELD_SEED=4711 …       prints every event
#include <gtest/gtest.h>

#include <cstdlib>
#include <iostream>
#include <map>
#include <optional>

#include "tests/daemon/core/model/model_run.h"

namespace voxeld::daemon::model {
namespace {

std::optional<uint32_t> FromEnvironment(const char* name) {
  const char* value = std::getenv(name);
  if (value == nullptr) return std::nullopt;
  return static_cast<uint32_t>(std::strtoul(value, nullptr, 0));
}

TEST(CoreModel, TheCoreDoesWhatThePlainModelDoes) {
  const std::optional<uint32_t> first = FromEnvironment("VOXELD_SEED");
  const uint32_t seeds = FromEnvironment("VOXELD_SEEDS").value_or(first.has_value() ? 1 : 1000);
  const bool traced = std::getenv("VOXELD_TRACE") != nullptr;
  const uint32_t from = first.value_or(1);
  std::map<CommitOutcome::Kind, uint64_t> kinds;
  PlainCore::Figures sum;
  uint64_t commits = 0, outcomes = 0;
  for (uint32_t seed = from; seed - from < seeds; ++seed) {
    const Script script = MakeScript(seed);
    ModelRun run(script, traced ? &std::cout : nullptr);
    if (!run.Run().empty()) {
      FAIL() << "VOXELD_SEED=" << seed << "\n" << RunAndShrink(script);
    }
    for (const auto& [kind, n] : run.ledger().kinds()) kinds[kind] += n;
    commits += run.ledger().commits();
    outcomes += run.ledger().told();
    sum.refused += run.figures().refused;
    sum.frames_dropped += run.figures().frames_dropped;
    sum.timed_dropped += run.figures().timed_dropped;
    sum.must_show_timeouts += run.figures().must_show_timeouts;
    sum.resumed += run.figures().resumed;
    sum.operations_applied += run.figures().operations_applied;
    sum.operations_refused += run.figures().operations_refused;
  }
  std::cout << seeds << " seeds from " << from << ": " << commits << " commits applied, "
            << sum.refused << " refused, " << outcomes << " outcomes told (presented "
            << kinds[CommitOutcome::Kind::kPresented] << ", unchanged "
            << kinds[CommitOutcome::Kind::kUnchanged] << ", superseded "
            << kinds[CommitOutcome::Kind::kSuperseded] << ", lost "
            << kinds[CommitOutcome::Kind::kLost] << ", not shown "
            << kinds[CommitOutcome::Kind::kNotShown] << "), " << sum.operations_applied
            << " operations applied, " << sum.operations_refused << " refused, "
            << sum.frames_dropped << " frames given up, " << sum.timed_dropped
            << " timed commits dropped, " << sum.must_show_timeouts << " must_show timeouts, "
            << sum.resumed << " sessions taken up\n";
  if (seeds < 500) return;
  // Every kind that the model judges has occurred.
  for (const auto kind : {CommitOutcome::Kind::kPresented, CommitOutcome::Kind::kUnchanged,
                          CommitOutcome::Kind::kSuperseded, CommitOutcome::Kind::kLost,
                          CommitOutcome::Kind::kNotShown}) {
    EXPECT_GT(kinds[kind], seeds / 10) << static_cast<int>(kind);
  }
  for (const uint64_t n : {sum.refused, sum.frames_dropped, sum.timed_dropped,
                           sum.must_show_timeouts, sum.resumed, sum.operations_refused}) {
    EXPECT_GT(n, seeds / 10);
  }
}

}  // namespace
}  // namespace voxeld::daemon::model
