#include "tests/e2e/hostile/verdict.h"

#include <algorithm>

namespace voxeld::e2e {

void Add(const AttackResult& result, bool last, AttackFigures& figures) {
  if (!result.connected) return;
  ++figures.connections;
  if (result.cut) ++figures.cut;
  if (!result.cut && last) ++figures.under_way;
  figures.most_bytes = std::max(figures.most_bytes, result.bytes_delivered);
  figures.most_seconds = std::max(figures.most_seconds, result.seconds);
}

void Add(const AttackFigures& peer, AttackFigures& figures) {
  figures.connections += peer.connections;
  figures.cut += peer.cut;
  figures.under_way += peer.under_way;
  figures.most_bytes = std::max(figures.most_bytes, peer.most_bytes);
  figures.most_seconds = std::max(figures.most_seconds, peer.most_seconds);
}

std::vector<Verdict> Judge(bool trusted, const AttackFigures& figures) {
  const auto most = [](const char* what, double measured, double target) {
    return Verdict{what, measured, target, measured <= target};
  };
  const auto ended = static_cast<double>(figures.connections - figures.under_way);
  const auto cut = static_cast<double>(figures.cut);
  std::vector<Verdict> out = {{"cut", cut, ended, cut >= 1 && cut >= ended}};
  if (trusted) return out;
  out.push_back(
      most("bytes", static_cast<double>(figures.most_bytes), static_cast<double>(kMostBytes)));
  out.push_back(most("seconds", figures.most_seconds, kMostSeconds));
  out.push_back(most("growth_kib_a_peer", figures.growth_kib, kMostGrowthKib));
  out.push_back(
      most("others_p99_ms", figures.p99_attacked_ms, kMostSlowdown * figures.p99_alone_ms));
  return out;
}

}  // namespace voxeld::e2e
