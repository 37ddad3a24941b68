// Runs a given number of exchanges with malicious devices and peers: the targets of tests/fuzz in
// long sessions. Each job is a process with sessions of its own, so that when one is terminated the
// session is known.
//
// Exits with 0 if everything held that must hold, with 1 and the command to repeat it if something
// did not, and with 2 if the arguments are wrong.

#include <google/protobuf/stubs/logging.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <new>
#include <string>
#include <thread>
#include <vector>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "tests/fuzz/exchanges.h"
#include "tests/fuzz/exchanges/sessions.h"

#ifdef VOXELD_SANITIZED
// Delaying the release of memory, or checking each function's own stack, would halve the number of
// exchanges.
extern "C" const char* __asan_default_options();
extern "C" const char* __asan_default_options() {
  return "quarantine_size_mb=16:malloc_context_size=6:detect_stack_use_after_return=0:"
         "allocator_may_return_null=1";
}
#endif

namespace voxeld::fuzz {
namespace {

constexpr std::chrono::seconds kStandstill{180};  // of one job
constexpr std::chrono::seconds kProgress{10};

struct Options {
  std::string side = "device";
  uint64_t seed = 1;
  uint64_t exchanges = 100'000;
  uint64_t jobs = 1;
  uint64_t session = 0;
  bool one = false;  // only that session
  std::string save;
  std::string corpus = VOXELD_FUZZ_CORPUS;
  double seconds = 0;
  bool json = false;
};

// The state of a job, in memory that it shares with its parent.
struct Job {
  Exchanges exchanges;
  std::atomic<uint64_t> session = 0, sessions = 0;
  pid_t process = 0;
  uint64_t seen = 0;
  std::chrono::steady_clock::time_point seen_at;
};

int Usage() {
  std::fputs(
      "usage: hostile_exchanges [--side device|peer] [--seed S] [--exchanges N] [--jobs J]\n"
      "                         [--seconds S] [--corpus FOLDER] [--json]\n"
      "       hostile_exchanges --side SIDE --seed S --session N [--save FILE]\n"
      "At least N exchanges (100,000), or as many as S seconds have time for, by J processes; or "
      "one session again,\n"
      "of which --save writes the input, for the fuzz target that is named.\n",
      stderr);
  return 2;
}

bool Parse(int argc, char** argv, Options& options) {
  for (int i = 1; i < argc; ++i) {
    const std::string name = argv[i];
    if (name == "--json") {
      options.json = true;
      continue;
    }
    if (++i == argc) return false;
    const std::string value = argv[i];
    bool good = true;
    if (name == "--side") {
      options.side = value;
    } else if (name == "--seed") {
      good = absl::SimpleAtoi(value, &options.seed);
    } else if (name == "--exchanges") {
      good = absl::SimpleAtoi(value, &options.exchanges);
    } else if (name == "--jobs") {
      good = absl::SimpleAtoi(value, &options.jobs) && options.jobs > 0 && options.jobs <= 1024;
    } else if (name == "--session") {
      good = options.one = absl::SimpleAtoi(value, &options.session);
    } else if (name == "--save") {
      options.save = value;
    } else if (name == "--corpus") {
      options.corpus = value;
    } else if (name == "--seconds") {
      good = absl::SimpleAtod(value, &options.seconds) && options.seconds > 0;
    } else {
      good = false;
    }
    if (!good) {
      std::fprintf(stderr, "hostile_exchanges: %s %s is none\n", argv[i - 1], argv[i]);
      return false;
    }
  }
  return true;
}

uint64_t Total(const Job& job) {
  return std::atomic_ref(const_cast<uint64_t&>(job.exchanges.total))
      .load(std::memory_order_relaxed);
}

// Runs in the process of a job.
[[noreturn]] void Work(const Sessions& sessions, const Options& options, Job& job, uint64_t first,
                       std::chrono::steady_clock::time_point end) {
  prctl(PR_SET_PDEATHSIG, SIGKILL);
  google::protobuf::SetLogHandler(nullptr);  // it reports each invalid string
  exchanges = &job.exchanges;
  const uint64_t share = (options.exchanges + options.jobs - 1) / options.jobs;
  for (uint64_t session = first;; session += options.jobs) {
    if (options.seconds > 0 ? std::chrono::steady_clock::now() >= end
                            : job.exchanges.total >= share) {
      break;
    }
    job.session = session;
    sessions.Run(session);
    ++job.sessions;
  }
  std::exit(0);  // with a check for leaks
}

void Say(const Job& job, const Options& options, const std::string& why) {
  std::fprintf(stderr,
               "hostile_exchanges: %s, in session %llu, after %llu exchanges of its job\n"
               "again: hostile_exchanges --side %s --seed %llu --session %llu\n",
               why.c_str(), static_cast<unsigned long long>(job.session.load()),
               static_cast<unsigned long long>(Total(job)), options.side.c_str(),
               static_cast<unsigned long long>(options.seed),
               static_cast<unsigned long long>(job.session.load()));
}

std::string Ended(int status) {
  if (WIFSIGNALED(status)) return absl::StrCat("ended by signal ", WTERMSIG(status));
  return absl::StrCat("ended with ", WEXITSTATUS(status));
}

uint64_t Sum(const std::vector<Job*>& jobs, uint64_t Exchanges::*what) {
  uint64_t sum = 0;
  for (const Job* job : jobs) sum += job->exchanges.*what;
  return sum;
}

void Report(const std::vector<Job*>& jobs, const Options& options, double seconds) {
  const uint64_t total = Sum(jobs, &Exchanges::total);
  uint64_t sessions = 0;
  for (const Job* job : jobs) sessions += job->sessions;
  std::string kinds, text;
  std::array<uint64_t, kOutcomeNames.size()> outcomes = {};
  for (size_t kind = 0; kind < kExchangeNames.size(); ++kind) {
    std::string told, said;
    uint64_t all = 0;
    for (size_t outcome = 0; outcome < kOutcomeNames.size(); ++outcome) {
      uint64_t count = 0;
      for (const Job* job : jobs) count += job->exchanges.by[kind][outcome];
      if (count == 0) continue;
      all += count;
      outcomes[outcome] += count;
      absl::StrAppend(&told, told.empty() ? "" : ", ", "\"", kOutcomeNames[outcome], "\": ", count);
      absl::StrAppend(&said, ", ", kOutcomeNames[outcome], " ", count);
    }
    if (all == 0) continue;
    absl::StrAppend(&kinds, kinds.empty() ? "" : ", ", "\"", kExchangeNames[kind], "\": {", told,
                    "}");
    absl::StrAppend(&text, "  ", kExchangeNames[kind], ": ", all, said, "\n");
  }
  const uint64_t refused = outcomes[static_cast<size_t>(ExchangeOutcome::kRefused)];
  const uint64_t accepted = outcomes[static_cast<size_t>(ExchangeOutcome::kAccepted)];
  const struct {
    const char* name;
    uint64_t value;
  } sums[] = {{"seed", options.seed},
              {"jobs", options.jobs},
              {"sessions", sessions},
              {"exchanges", total},
              {"accepted", accepted},
              {"refused", refused},
              {"lies", total - accepted - refused},
              {"sessions_overcome", Sum(jobs, &Exchanges::overcome)},
              {"attaches", Sum(jobs, &Exchanges::attaches)},
              {"transfers_failed", Sum(jobs, &Exchanges::transfers_failed)},
              {"slices_resent", Sum(jobs, &Exchanges::slices_resent)},
              {"volumes_shown", Sum(jobs, &Exchanges::volumes_shown)},
              {"volumes_lost", Sum(jobs, &Exchanges::volumes_lost)}};
  if (options.json) {
    std::string json = absl::StrCat("{\"side\": \"", options.side, "\"");
    for (const auto& sum : sums) absl::StrAppend(&json, ", \"", sum.name, "\": ", sum.value);
    absl::StrAppend(&json, ", \"seconds\": ", seconds, ", \"kinds\": {", kinds, "}}");
    std::puts(json.c_str());
    return;
  }
  std::printf("%s: %.0f exchanges a second\n", options.side.c_str(),
              static_cast<double>(total) / std::max(seconds, 1e-3));
  for (const auto& sum : sums) {
    std::printf("%s %llu\n", sum.name, static_cast<unsigned long long>(sum.value));
  }
  std::fputs(text.c_str(), stdout);
}

int RunJobs(const Sessions& sessions, const Options& options) {
  std::vector<Job*> jobs;
  const auto begin = std::chrono::steady_clock::now();
  const auto end = begin + std::chrono::duration_cast<std::chrono::steady_clock::duration>(
                               std::chrono::duration<double>(options.seconds));
  for (uint64_t i = 0; i < options.jobs; ++i) {
    void* memory =
        mmap(nullptr, sizeof(Job), PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
    if (memory == MAP_FAILED) {
      std::fprintf(stderr, "hostile_exchanges: no memory: %s\n", std::strerror(errno));
      return 2;
    }
    Job* job = jobs.emplace_back(new (memory) Job);
    job->seen_at = begin;
    const pid_t process = fork();
    if (process == 0) Work(sessions, options, *job, options.session + i, end);
    job->process = process;
    if (process < 0) {
      std::fprintf(stderr, "hostile_exchanges: no process: %s\n", std::strerror(errno));
      return 2;
    }
  }
  bool broken = false;
  size_t running = jobs.size();
  auto progress_at = begin + kProgress;
  while (running > 0) {
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
    const auto now = std::chrono::steady_clock::now();
    for (Job* job : jobs) {
      if (job->process == 0) continue;
      int status = 0;
      if (waitpid(job->process, &status, WNOHANG) == job->process) {
        job->process = 0;
        --running;
        if (status != 0) {
          broken = true;
          Say(*job, options, Ended(status));
        }
        continue;
      }
      if (const uint64_t seen = Total(*job) + job->sessions; seen != job->seen) {
        job->seen = seen;
        job->seen_at = now;
      } else if (now - job->seen_at > kStandstill) {
        job->seen_at = now;
        Say(*job, options, "stands still");
        kill(job->process, SIGABRT);
      }
    }
    if (now >= progress_at) {
      progress_at = now + kProgress;
      uint64_t total = 0;
      for (const Job* job : jobs) total += Total(*job);
      std::fprintf(stderr, "%.0f s: %llu exchanges\n",
                   std::chrono::duration<double>(now - begin).count(),
                   static_cast<unsigned long long>(total));
    }
  }
  Report(jobs, options,
         std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count());
  return broken ? 1 : 0;
}

int Main(int argc, char** argv) {
  Options options;
  if (!Parse(argc, argv, options)) return Usage();
  const absl::StatusOr<Sessions> sessions =
      Sessions::Make(options.side, options.seed, options.corpus);
  if (!sessions.ok()) {
    std::fprintf(stderr, "hostile_exchanges: %s\n",
                 std::string(sessions.status().message()).c_str());
    return 2;
  }
  if (!options.one) return RunJobs(*sessions, options);
  const Sessions::Known known = sessions->InputOf(options.session);
  std::fprintf(stderr, "session %llu: %s, %zu bytes\n",
               static_cast<unsigned long long>(options.session), known.target, known.input.size());
  if (!options.save.empty()) {
    std::ofstream out(options.save, std::ios::binary);
    out.write(reinterpret_cast<const char*>(known.input.data()),
              static_cast<std::streamsize>(known.input.size()));
    if (!out.flush()) {
      std::fprintf(stderr, "hostile_exchanges: %s cannot be written\n", options.save.c_str());
      return 2;
    }
  }
  sessions->Run(options.session);
  return 0;
}

}  // namespace
}  // namespace voxeld::fuzz

int main(int argc, char** argv) { return voxeld::fuzz::Main(argc, argv); }
