// Simulations in which memory fails. What asks first gets nothing, as often as it asks: with the daemon's own allocator
// (daemon/process/allocations.cc) nobody is to notice. And an engine that gets nothing in the end is lost, and only that: what
// clients are told, and what is seen in the end, stays right.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <functional>
#include <iostream>
#include <set>
#include <string>
#include <vector>

#include "daemon/process/memory_reserve.h"
#include "gpu/want_of_memory.h"
#include "tests/faults/fail_malloc.h"
#include "tests/simulation/simulation_run.h"

namespace voxeld::simulation {
namespace {

using daemon::MemoryReserve;
using daemon::model::Action;
using daemon::model::ActionKind;

struct Result {
  std::string wrong;
  uint64_t hash = 0;
  uint64_t allocations = 0;
  int64_t held = 0;  // blocks that are held after it, and were not before
};

// Nothing is printed or asserted while memory fails.
Result RunSeed(uint32_t seed, const std::function<void()>& begin) {
  Result result;
  const int64_t before = fail_malloc_held();
  begin();
  {
    SimulationRun run(MakeScenario(seed));
    result.wrong = run.Run();
    result.hash = run.trace_hash();
  }
  result.allocations = fail_malloc_end();
  const bool words = result.wrong.capacity() > std::string().capacity();
  result.held = fail_malloc_held() - before - (words ? 1 : 0);
  return result;
}

// Ten scenarios, the first seed of each.
struct Kind {
  const char* name;
  std::function<bool(const Scenario&)> is;
};
bool Has(const Scenario& scenario, ActionKind kind, size_t times) {
  return static_cast<size_t>(std::ranges::count(scenario.actions, kind, &Action::kind)) >= times;
}
bool IsCalm(const Scenario& s) {
  return !s.device_faults && !s.transport_faults && !s.engine_faults && !s.lies && !s.memory_ends;
}
const Kind kKinds[] = {
    {"streams",
     [](const Scenario& s) { return IsCalm(s) && s.settles && Has(s, ActionKind::kSend, 20); }},
    {"resumes", [](const Scenario& s) { return IsCalm(s) && Has(s, ActionKind::kResume, 4); }},
    {"layers cleared",
     [](const Scenario& s) { return IsCalm(s) && Has(s, ActionKind::kClearLayer, 2); }},
    {"a genlock", [](const Scenario& s) { return IsCalm(s) && !s.seats[0].setup.genlock.empty(); }},
    {"captures and patterns",
     [](const Scenario& s) { return IsCalm(s) && Has(s, ActionKind::kPattern, 2); }},
    {"lost displays",
     [](const Scenario& s) { return s.device_faults && Has(s, ActionKind::kCable, 2); }},
    {"failed transfers", [](const Scenario& s) { return s.transport_faults; }},
    {"lost engines",
     [](const Scenario& s) { return s.engine_faults && Has(s, ActionKind::kEngineFail, 1); }},
    {"control, and time that jumps",
     [](const Scenario& s) { return s.jumps && Has(s, ActionKind::kControl, 2); }},
    {"a budget that is used up", [](const Scenario& s) { return s.memory_ends; }},
};

// None serves twice.
uint32_t SeedOf(const Kind& kind, std::set<uint32_t>& taken) {
  for (uint32_t seed = 1;; ++seed) {
    if (kind.is(MakeScenario(seed)) && taken.insert(seed).second) return seed;
  }
}

TEST(Allocations, EachThatFailsOnceIsNoticedByNobody) {
  // What is made once in a process, and kept.
  RunSeed(1, [] {});
  std::set<uint32_t> taken;
  for (const Kind& kind : kKinds) {
    const uint32_t seed = SeedOf(kind, taken);
    ASSERT_TRUE(MemoryReserve::OfProcess().Fill(size_t{4} << 20));
    RunSeed(seed, [] {});
    const Result unharmed = RunSeed(seed, [] { fail_malloc_begin(0, 1); });
    ASSERT_EQ(unharmed.wrong, "") << kind.name;
    // All of them at once: nobody has anything left over from the one before.
    const uint64_t before = MemoryReserve::OfProcess().figures().failed;
    const Result all = RunSeed(seed, [] { fail_malloc_begin_each(1, 1); });
    const uint64_t failed = MemoryReserve::OfProcess().figures().failed - before;
    EXPECT_EQ(all.wrong, "") << kind.name;
    EXPECT_EQ(all.hash, unharmed.hash) << kind.name;
    EXPECT_EQ(unharmed.held, 0) << kind.name;
    EXPECT_EQ(all.held, 0) << kind.name;
    EXPECT_EQ(failed, all.allocations) << kind.name << ": some were not tried again";
    EXPECT_EQ(MemoryReserve::OfProcess().figures().refused, 0u);
    std::cout << kind.name << ": seed " << seed << ", " << failed << " allocations\n";
    ASSERT_GT(failed, 1000u) << kind.name;
  }
}

// In each run one allocation of an engine is refused for good: of each scenario 60, or every VOXELD_FAULTS_EVERY-th.
TEST(Allocations, AnEngineWithoutMemoryIsLostAndNothingElse) {
  constexpr uint64_t kRuns = 60;
  uint64_t lost = 0, runs = 0;
  // The engines that judge are not meant.
  fail_malloc_only([] { return EngineStage::IsRunning() && gpu::WantOfMemory::IsCaught(); });
  std::set<uint32_t> taken;
  for (const Kind& kind : kKinds) {
    const uint32_t seed = SeedOf(kind, taken);
    RunSeed(seed, [] {});
    const Result unharmed = RunSeed(seed, [] { fail_malloc_begin(0, 1); });
    ASSERT_EQ(unharmed.wrong, "") << kind.name;
    const char* const asked = std::getenv("VOXELD_FAULTS_EVERY");
    const uint64_t every = std::max<uint64_t>(
        1, asked != nullptr ? std::strtoull(asked, nullptr, 10) : unharmed.allocations / kRuns);
    for (uint64_t n = 1; n <= unharmed.allocations; n += every) {
      ::testing::internal::CaptureStderr();
      const Result one = RunSeed(seed, [n] { fail_malloc_begin(n, 2); });
      ::testing::internal::GetCapturedStderr();
      ASSERT_EQ(one.wrong, "") << kind.name << ", seed " << seed << ", allocation " << n;
      ASSERT_EQ(one.held, 0) << kind.name << ", seed " << seed << ", allocation " << n;
      lost += one.hash != unharmed.hash;
      ++runs;
    }
    std::cout << kind.name << ": seed " << seed << ", every " << every << "th of "
              << unharmed.allocations << " allocations of engines\n";
  }
  fail_malloc_only(nullptr);
  EXPECT_GT(lost, runs / 2) << "they fail, and nothing comes of it";
}

}  // namespace
}  // namespace voxeld::simulation
