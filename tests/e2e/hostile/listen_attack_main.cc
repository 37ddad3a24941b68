// Attacks a real voxeld, its own child, over loopback, and judges the cost.
//
//   listen_attack [ATTACK…] [--seconds N] [--peers N] [--json] [--option VOXELD_OPTION…]
//   listen_attack descriptors [--cycles N]
//
// Without ATTACK, all are run, and descriptors. Each attack is made by N peers at once, each from
// an address of its own, repeatedly. Reports the most bytes and seconds until one was disconnected,
// the growth of the daemon's memory, and another client's median and 99th percentile of a call,
// before the attack (a quarter of the time) and during it; each is compared with the daemon's
// promises. The attackers' threads are in the system's idle class: they should cost the others only
// what the daemon spends on them, and not the processor, which in a real attack would be in another
// machine.
//
// Exits with 0 if all promises were kept, 1 if not, 2 if the options are wrong.
#include <grpcpp/grpcpp.h>
#include <pthread.h>
#include <sched.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <nlohmann/json.hpp>
#include <string>
#include <thread>
#include <vector>

#include "tests/daemon/services/daemon_fixture.h"
#include "tests/e2e/hostile/attacks.h"
#include "tests/e2e/hostile/exhaustion.h"
#include "tests/e2e/hostile/process_view.h"
#include "tests/e2e/hostile/verdict.h"
#include "tests/e2e/voxeld_process.h"

namespace voxeld::e2e {
namespace {

using Json = nlohmann::ordered_json;
using std::chrono::steady_clock;

constexpr std::chrono::milliseconds kBetweenCalls{5};
constexpr int kMostPeers = 250;  // one address each, 127.0.1.x

struct Options {
  std::vector<std::string> what, daemon;
  double seconds = 10;
  int peers = 4, cycles = 100;
  bool json = false;
};

// Returns the milliseconds that calls took until `end`, on one existing connection.
std::vector<double> TimeCalls(v1::DisplayService::Stub& stub, steady_clock::time_point end) {
  std::vector<double> times;
  while (steady_clock::now() < end) {
    const auto begin = steady_clock::now();
    grpc::ClientContext context;
    daemon::services::SetDeadline(context);
    v1::ListDisplaysResponse response;
    if (!stub.ListDisplays(&context, {}, &response).ok()) {
      times.push_back(60'000);
      continue;
    }
    times.push_back(std::chrono::duration<double, std::milli>(steady_clock::now() - begin).count());
    // The measured client's pace; it does not wait for an event.
    std::this_thread::sleep_until(begin + kBetweenCalls);
  }
  std::sort(times.begin(), times.end());
  return times;
}

double Quantile(const std::vector<double>& sorted, double q) {
  return sorted.empty() ? 0
                        : sorted[static_cast<size_t>(q * static_cast<double>(sorted.size() - 1))];
}

void RunIdle() {
  const sched_param none = {};
  if (pthread_setschedparam(pthread_self(), SCHED_IDLE, &none) != 0) {
    std::fprintf(stderr, "listen_attack: the attackers run as all others do\n");
  }
}

// Adds the verdicts; returns false if a promise was broken.
bool AddVerdicts(const std::vector<Verdict>& verdicts, Json& out) {
  bool kept = true;
  for (const Verdict& verdict : verdicts) {
    out["verdicts"][verdict.what] = {
        {"measured", verdict.measured}, {"target", verdict.target}, {"reached", verdict.reached}};
    kept = kept && verdict.reached;
  }
  out["kept"] = kept;
  return kept;
}

uint64_t Refused(v1::DisplayService::Stub& stub) {
  const auto stats = daemon::services::AwaitStats(stub, [](const v1::Stats&) { return true; });
  return stats.has_value() ? stats->connections().refused_after_cut() : 0;
}

Json RunOne(Attack attack, const Options& options) {
  Daemon daemon(options.daemon);
  const auto stub = v1::DisplayService::NewStub(
      grpc::CreateChannel(daemon.tcp_target(), grpc::InsecureChannelCredentials()));
  const auto span = std::chrono::duration_cast<steady_clock::duration>(
      std::chrono::duration<double>(options.seconds));
  const std::vector<double> alone = TimeCalls(*stub, steady_clock::now() + span / 4);
  const uint64_t before = ResidentKib(daemon.process().pid());
  const auto end = steady_clock::now() + span;

  std::vector<AttackFigures> of_peers(static_cast<size_t>(options.peers));
  std::vector<std::thread> peers;
  for (size_t i = 0; i < of_peers.size(); ++i) {
    peers.emplace_back(
        [&mine = of_peers[i], source = "127.0.1." + std::to_string(1 + i), attack, end, &daemon] {
          RunIdle();
          while (steady_clock::now() < end) {
            const AttackResult one = RunAttack(attack, daemon.tcp_target(), source, end);
            Add(one, steady_clock::now() >= end, mine);
          }
        });
  }
  std::atomic<bool> done = false;
  uint64_t most_kib = before;
  std::thread watch([&] {
    while (!done) {
      most_kib = std::max(most_kib, ResidentKib(daemon.process().pid()));
      // The time between two samples of the memory; it does not wait for an event.
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
  });
  const std::vector<double> attacked = TimeCalls(*stub, end);
  for (std::thread& peer : peers) peer.join();
  done = true;
  watch.join();

  AttackFigures figures;
  for (const AttackFigures& mine : of_peers) Add(mine, figures);
  figures.growth_kib = static_cast<double>(most_kib - before) / options.peers;
  figures.p99_alone_ms = Quantile(alone, 0.99);
  figures.p99_attacked_ms = Quantile(attacked, 0.99);
  Json out = {{"attack", AttackName(attack)},
              {"trusted", NeedsTrust(attack)},
              {"seconds", options.seconds},
              {"peers", options.peers},
              {"connections", figures.connections},
              {"refused_after_a_cut", Refused(*stub)},
              {"most_bytes", figures.most_bytes},
              {"most_seconds", figures.most_seconds},
              {"under_way_at_the_end", figures.under_way},
              {"rss_before_kib", before},
              {"rss_growth_kib_a_peer", figures.growth_kib},
              {"calls", attacked.size()},
              {"calls_p50_ms_alone", Quantile(alone, 0.5)},
              {"calls_p99_ms_alone", figures.p99_alone_ms},
              {"calls_p50_ms_attacked", Quantile(attacked, 0.5)},
              {"calls_p99_ms_attacked", figures.p99_attacked_ms}};
  AddVerdicts(Judge(NeedsTrust(attack), figures), out);
  return out;
}

Json RunExhaustion(const Options& options) {
  Daemon daemon(options.daemon);
  std::vector<double> seconds;
  for (int i = 0; i < options.cycles; ++i) {
    const std::optional<double> took = ExhaustAndRecover(daemon);
    if (!took.has_value()) break;
    seconds.push_back(*took);
  }
  std::sort(seconds.begin(), seconds.end());
  const auto recovered = static_cast<double>(seconds.size());
  const double most = seconds.empty() ? 0 : seconds.back();
  Json out = {{"attack", "descriptors"},
              {"cycles", options.cycles},
              {"accepting_again_p50_s", Quantile(seconds, 0.5)},
              {"accepting_again_max_s", most}};
  AddVerdicts({{"recovered", recovered, static_cast<double>(options.cycles),
                seconds.size() == static_cast<size_t>(options.cycles)},
               {"accepting_again_s", most, kMostRecoverySeconds, most <= kMostRecoverySeconds}},
              out);
  return out;
}

void Print(const Json& line, bool json) {
  if (json) {
    std::puts(line.dump().c_str());
  } else {
    std::printf("%-22s", line["attack"].get<std::string>().c_str());
    for (const auto& [what, verdict] : line["verdicts"].items()) {
      std::printf("  %s %.4g (%.4g)%s", what.c_str(), verdict["measured"].get<double>(),
                  verdict["target"].get<double>(),
                  verdict["reached"].get<bool>() ? "" : " NOT REACHED");
    }
    std::puts("");
  }
  std::fflush(stdout);
}

void Usage(std::FILE* out) {
  std::fputs(
      "usage: listen_attack [ATTACK …] [--seconds S] [--peers N] [--cycles N] [--option OPTION]… "
      "[--json]\n"
      "  Attacks a voxeld of its own over loopback (all of them, one after another, if none is "
      "named), and says what came of it.\n"
      "  --seconds S      of each attack, a quarter of it before (10)\n"
      "  --peers N        that attack at once (4)\n"
      "  --cycles N       of the attack \"descriptors\" (100)\n"
      "  --option OPTION  for voxeld\n"
      "  Ends with 1 if a target was not reached. Attacks:\n",
      out);
  for (const Attack attack : AllAttacks()) std::fprintf(out, "    %s\n", AttackName(attack));
  std::fputs("    descriptors\n", out);
}

int Run(const Options& options) {
  bool kept = true;
  for (const std::string& what : options.what) {
    Json line;
    if (what == "descriptors") {
      line = RunExhaustion(options);
    } else {
      for (const Attack attack : AllAttacks()) {
        if (what == AttackName(attack)) line = RunOne(attack, options);
      }
    }
    if (line.is_null()) {
      std::fprintf(stderr, "listen_attack: there is no attack \"%s\"\n", what.c_str());
      Usage(stderr);
      return 2;
    }
    Print(line, options.json);
    kept = kept && line["kept"].get<bool>();
  }
  return kept ? 0 : 1;
}

}  // namespace
}  // namespace voxeld::e2e

int main(int argc, char** argv) {
  voxeld::e2e::Options options;
  for (int i = 1; i < argc; ++i) {
    const std::string argument = argv[i];
    if (argument.rfind("--", 0) != 0) {
      options.what.push_back(argument);
      continue;
    }
    if (argument == "--json") {
      options.json = true;
      continue;
    }
    if (argument == "--help") {
      voxeld::e2e::Usage(stdout);
      return 0;
    }
    const char* value = i + 1 < argc ? argv[++i] : "";
    if (argument == "--seconds") {
      options.seconds = std::atof(value);
    } else if (argument == "--peers") {
      options.peers = std::atoi(value);
    } else if (argument == "--cycles") {
      options.cycles = std::atoi(value);
    } else if (argument == "--option") {
      options.daemon.emplace_back(value);
    } else {
      std::fprintf(stderr, "listen_attack: there is no option %s\n", argument.c_str());
      voxeld::e2e::Usage(stderr);
      return 2;
    }
  }
  if (options.what.empty()) {
    for (const auto attack : voxeld::e2e::AllAttacks()) {
      options.what.emplace_back(voxeld::e2e::AttackName(attack));
    }
    options.what.emplace_back("descriptors");
  }
  if (options.seconds <= 0 || options.peers <= 0 || options.peers > voxeld::e2e::kMostPeers ||
      options.cycles <= 0) {
    std::fprintf(stderr,
                 "listen_attack: --seconds, --peers and --cycles are greater than 0, --peers at "
                 "most %d\n",
                 voxeld::e2e::kMostPeers);
    return 2;
  }
  return voxeld::e2e::Run(options);
}
