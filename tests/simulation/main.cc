// simulation: runs whole daemons below gRPC with their devices, one for each seed, in one thread,
// with a simulated clock.
#include <atomic>
#include <chrono>
#include <cinttypes>
#include <cstdio>
#include <cstdlib>
#include <iostream>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "tests/simulation/simulation_run.h"

namespace voxeld::simulation {
namespace {

constexpr char kUsage[] =
    "simulation [--seeds A..B] [--seed N] [--verbose] [--jobs N] [--json] [--most-failures N] "
    "[--quiet]\n"
    "  --seeds A..B       runs seeds A to B, both included (1..1000)\n"
    "  --seed N           runs that one\n"
    "  --verbose          writes all that happens\n"
    "  --jobs N           so many at a time (1)\n"
    "  --json             the result as JSON\n"
    "  --most-failures N  gives up after so many (1)\n"
    "  --quiet            no progress\n"
    "It ends with 0 if nothing was wrong, with 1 if something was, with 2 for a wrong command "
    "line.\n";

struct Options {
  uint32_t first = 1, last = 1000;
  uint32_t jobs = 1;
  uint64_t most_failures = 1;
  bool verbose = false, json = false, quiet = false;
};

// Returns what is wrong with the arguments; empty: nothing.
std::string Parse(const std::vector<std::string>& args, Options* options) {
  const auto wrong = [](const std::string& arg, const std::string& value, const char* right) {
    return absl::StrCat(arg, " is \"", value, "\"; give ", right);
  };
  for (size_t i = 0; i < args.size(); ++i) {
    const std::string& arg = args[i];
    if (arg == "--verbose") {
      options->verbose = true;
      continue;
    }
    if (arg == "--json") {
      options->json = true;
      continue;
    }
    if (arg == "--quiet") {
      options->quiet = true;
      continue;
    }
    const std::string value = i + 1 < args.size() ? args[++i] : "";
    if (arg == "--seeds") {
      const std::vector<std::string> ends = absl::StrSplit(value, "..");
      if (ends.size() != 2 || !absl::SimpleAtoi(ends[0], &options->first) ||
          !absl::SimpleAtoi(ends[1], &options->last) || options->last < options->first) {
        return wrong(arg, value, "A..B, B no less than A, such as 1..1000");
      }
    } else if (arg == "--seed") {
      if (!absl::SimpleAtoi(value, &options->first)) return wrong(arg, value, "a seed's number");
      options->last = options->first;
    } else if (arg == "--jobs") {
      if (!absl::SimpleAtoi(value, &options->jobs) || options->jobs == 0) {
        return wrong(arg, value, "a number from 1 on");
      }
    } else if (arg == "--most-failures") {
      if (!absl::SimpleAtoi(value, &options->most_failures)) {
        return wrong(arg, value, "a number");
      }
    } else {
      return absl::StrCat(arg, " is no option here");
    }
  }
  return "";
}

struct Failure {
  uint32_t seed;
  std::string what;
};

// The totals of all seeds; shared by the jobs.
struct Sum {
  std::mutex mutex;
  Tally tally;
  uint64_t seeds = 0;
  uint64_t hash = 0;  // over all traces, independent of their order
  std::vector<Failure> failures;

  void Add(uint32_t seed, const Tally& one, uint64_t trace_hash, const std::string& wrong) {
    const std::lock_guard lock(mutex);
    ++seeds;
    hash += trace_hash * (2 * uint64_t{seed} + 1);
    if (!wrong.empty()) failures.push_back({seed, wrong});
    tally.turns += one.turns;
    tally.commits += one.commits;
    tally.outcomes += one.outcomes;
    tally.volumes += one.volumes;
    tally.pictures_compared += one.pictures_compared;
    tally.captures += one.captures;
    tally.watched += one.watched;
    tally.faults += one.faults;
    tally.time_ns += one.time_ns;
    for (const auto& [kind, n] : one.kinds) tally.kinds[kind] += n;
  }
};

std::string Quoted(const std::string& text) {
  std::string quoted = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') quoted += '\\';
    quoted += static_cast<unsigned char>(c) < 0x20 ? ' ' : c;
  }
  return quoted + "\"";
}

void Print(const Options& options, const Sum& sum, double seconds) {
  using Kind = CommitOutcome::Kind;
  const auto kind = [&](Kind k) {
    const auto it = sum.tally.kinds.find(k);
    return it == sum.tally.kinds.end() ? uint64_t{0} : it->second;
  };
  const Tally& t = sum.tally;
  if (options.json) {
    std::cout << "{\"seeds\": " << sum.seeds << ", \"first\": " << options.first
              << ", \"seconds\": " << seconds << ", \"simulated_seconds\": " << t.time_ns / 1e9
              << ", \"turns\": " << t.turns << ", \"commits\": " << t.commits
              << ", \"outcomes\": " << t.outcomes << ", \"presented\": " << kind(Kind::kPresented)
              << ", \"unchanged\": " << kind(Kind::kUnchanged)
              << ", \"superseded\": " << kind(Kind::kSuperseded)
              << ", \"lost\": " << kind(Kind::kLost) << ", \"not_shown\": " << kind(Kind::kNotShown)
              << ", \"volumes_shown\": " << t.volumes
              << ", \"pictures_compared\": " << t.pictures_compared
              << ", \"captures\": " << t.captures << ", \"watched\": " << t.watched
              << ", \"faults\": " << t.faults << ", \"trace_hash\": \""
              << absl::StrCat(absl::Hex(sum.hash, absl::kZeroPad16)) << "\", \"failures\": [";
    for (size_t i = 0; i < sum.failures.size(); ++i) {
      std::cout << (i > 0 ? ", " : "") << "{\"seed\": " << sum.failures[i].seed
                << ", \"wrong\": " << Quoted(sum.failures[i].what) << "}";
    }
    std::cout << "]}\n";
    return;
  }
  std::printf("%" PRIu64 " seeds in %.1f s (%.0f/s), %.0f s simulated, %" PRIu64 " turns: %" PRIu64
              " commits, %" PRIu64 " outcomes (presented %" PRIu64 ", unchanged %" PRIu64
              ", superseded %" PRIu64 ", lost %" PRIu64 ", not shown %" PRIu64 "), %" PRIu64
              " volumes shown, %" PRIu64 " pictures compared, %" PRIu64 " captures, %" PRIu64
              " watched, %" PRIu64 " faults; trace hash %016" PRIx64 "; %zu failed\n",
              sum.seeds, seconds, static_cast<double>(sum.seeds) / seconds,
              static_cast<double>(t.time_ns) / 1e9, t.turns, t.commits, t.outcomes,
              kind(Kind::kPresented), kind(Kind::kUnchanged), kind(Kind::kSuperseded),
              kind(Kind::kLost), kind(Kind::kNotShown), t.volumes, t.pictures_compared, t.captures,
              t.watched, t.faults, sum.hash, sum.failures.size());
  for (const Failure& failure : sum.failures) {
    std::printf("seed %u: %s\n", failure.seed, failure.what.c_str());
  }
}

int Main(const Options& options) {
  using Clock = std::chrono::steady_clock;
  const Clock::time_point begun = Clock::now();
  const auto seconds = [begun] {
    return std::chrono::duration<double>(Clock::now() - begun).count();
  };
  Sum sum;
  std::atomic<uint64_t> next = options.first;
  const auto work = [&] {
    for (uint64_t seed = next++; seed <= options.last; seed = next++) {
      SimulationRun run(MakeScenario(static_cast<uint32_t>(seed)),
                        options.verbose ? &std::cout : nullptr);
      const std::string wrong = run.Run();
      sum.Add(static_cast<uint32_t>(seed), run.tally(), run.trace_hash(), wrong);
      const std::lock_guard lock(sum.mutex);
      if (sum.failures.size() >= options.most_failures) return;
      if (!options.quiet && sum.seeds % 1000 == 0) {
        std::fprintf(stderr, "%" PRIu64 " seeds, %.0f/s\n", sum.seeds,
                     static_cast<double>(sum.seeds) / seconds());
      }
    }
  };
  std::vector<std::thread> jobs;
  for (uint32_t i = 1; i < options.jobs; ++i) jobs.emplace_back(work);
  work();
  for (std::thread& job : jobs) job.join();
  Print(options, sum, seconds());
  return sum.failures.empty() ? 0 : 1;
}

}  // namespace
}  // namespace voxeld::simulation

int main(int argc, char** argv) {
  const std::vector<std::string> args(argv + 1, argv + argc);
  voxeld::simulation::Options options;
  if (args.size() == 1 && args[0] == "--help") {
    std::fputs(voxeld::simulation::kUsage, stdout);
    return 0;
  }
  if (const std::string wrong = voxeld::simulation::Parse(args, &options); !wrong.empty()) {
    std::fprintf(stderr, "simulation: %s\n%s", wrong.c_str(), voxeld::simulation::kUsage);
    return 2;
  }
  return voxeld::simulation::Main(options);
}
