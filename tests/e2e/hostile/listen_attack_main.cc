// Attacks a real voxeld, its own child, over loopback, and says what it cost: a line of JSON for each
// attack.
//
//   listen_attack [ATTACK…] [--seconds N] [--peers N] [--option VOXELD_OPTION…]
//   listen_attack descriptors [--cycles N]
//
// Of each attack, by so many peers at once, each again and again: the most bytes and seconds until one
// was cut, what the daemon's memory grew by, and another client's median and 99th percentile of a
// call, with and without the attack.
#include <grpcpp/grpcpp.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <nlohmann/json.hpp>
#include <string>
#include <thread>
#include <vector>

#include "tests/daemon/services/daemon_fixture.h"
#include "tests/e2e/hostile/attacks.h"
#include "tests/e2e/hostile/exhaustion.h"
#include "tests/e2e/hostile/process_view.h"
#include "tests/e2e/voxeld_process.h"

namespace voxeld::e2e {
namespace {

using Json = nlohmann::ordered_json;
using std::chrono::steady_clock;

constexpr std::chrono::milliseconds kBetweenCalls{5};

struct Options {
  std::vector<std::string> what, daemon;
  double seconds = 10;
  int peers = 4, cycles = 100;
};

// Milliseconds that calls took until `end`, on one connection that was there before.
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
    // The measured client's pace; nothing is waited for.
    std::this_thread::sleep_until(begin + kBetweenCalls);
  }
  std::sort(times.begin(), times.end());
  return times;
}

double Quantile(const std::vector<double>& sorted, double q) {
  return sorted.empty() ? 0
                        : sorted[static_cast<size_t>(q * static_cast<double>(sorted.size() - 1))];
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

  std::vector<std::vector<AttackResult>> results(static_cast<size_t>(options.peers));
  std::vector<std::thread> peers;
  for (auto& mine : results) {
    peers.emplace_back([&mine, attack, end, &daemon] {
      while (steady_clock::now() < end) {
        mine.push_back(RunAttack(attack, daemon.tcp_target(), end));
      }
    });
  }
  std::atomic<bool> done = false;
  uint64_t most_kib = before;
  std::thread watch([&] {
    while (!done) {
      most_kib = std::max(most_kib, ResidentKib(daemon.process().pid()));
      // Between two samples of the memory; nothing is waited for.
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
  });
  const std::vector<double> attacked = TimeCalls(*stub, end);
  for (std::thread& peer : peers) peer.join();
  done = true;
  watch.join();

  uint64_t connected = 0, cut = 0, most_bytes = 0;
  double most_seconds = 0;
  for (const auto& mine : results) {
    for (const AttackResult& one : mine) {
      if (!one.connected) continue;
      ++connected;
      most_bytes = std::max(most_bytes, one.bytes_delivered);
      if (!one.cut) continue;
      ++cut;
      most_seconds = std::max(most_seconds, one.seconds);
    }
  }
  const auto peers_count = static_cast<uint64_t>(options.peers);
  return {{"attack", AttackName(attack)},
          {"seconds", options.seconds},
          {"peers", options.peers},
          {"connections", connected},
          {"cut", cut},
          {"most_bytes", most_bytes},
          {"most_seconds_until_cut", most_seconds},
          {"rss_before_kib", before},
          {"rss_growth_kib", most_kib - before},
          {"rss_growth_kib_a_peer", (most_kib - before) / peers_count},
          {"calls_p50_ms_alone", Quantile(alone, 0.5)},
          {"calls_p99_ms_alone", Quantile(alone, 0.99)},
          {"calls_p50_ms_attacked", Quantile(attacked, 0.5)},
          {"calls_p99_ms_attacked", Quantile(attacked, 0.99)},
          {"calls", attacked.size()}};
}

Json RunExhaustion(const Options& options) {
  Daemon daemon(options.daemon);
  std::vector<double> seconds;
  for (int i = 0; i < options.cycles; ++i) {
    const std::optional<double> took = ExhaustAndRecover(daemon);
    if (!took.has_value()) return {{"attack", "descriptors"}, {"failed_in_cycle", i + 1}};
    seconds.push_back(*took);
  }
  std::sort(seconds.begin(), seconds.end());
  return {{"attack", "descriptors"},
          {"cycles", options.cycles},
          {"accepting_again_p50_s", Quantile(seconds, 0.5)},
          {"accepting_again_max_s", seconds.empty() ? 0 : seconds.back()}};
}

int Run(const Options& options) {
  bool failed = false;
  for (const std::string& what : options.what) {
    Json line;
    if (what == "descriptors") {
      line = RunExhaustion(options);
      failed = failed || line.contains("failed_in_cycle");
    } else {
      for (const Attack attack : AllAttacks()) {
        if (what == AttackName(attack)) line = RunOne(attack, options);
      }
    }
    if (line.is_null()) {
      std::fprintf(stderr, "listen_attack: there is no attack \"%s\"\n", what.c_str());
      return 2;
    }
    std::puts(line.dump().c_str());
    std::fflush(stdout);
  }
  return failed ? 1 : 0;
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
      return 2;
    }
  }
  if (options.what.empty()) {
    for (const auto attack : voxeld::e2e::AllAttacks()) {
      options.what.emplace_back(voxeld::e2e::AttackName(attack));
    }
    options.what.emplace_back("descriptors");
  }
  if (options.seconds <= 0 || options.peers <= 0 || options.cycles <= 0) {
    std::fprintf(stderr, "listen_attack: --seconds, --peers and --cycles are greater than 0\n");
    return 2;
  }
  return voxeld::e2e::Run(options);
}
