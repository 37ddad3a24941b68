#include "tools/bench/voxel_bench/paced_client.h"

#include <algorithm>
#include <utility>

#include "absl/strings/str_cat.h"
#include "tools/bench/voxel_bench/content.h"
#include "tools/bench/voxel_bench/pace.h"

namespace voxeld::bench {
namespace {

constexpr sync::TimeNs kSettleLimit = 30 * sync::kSecond;

v1::Open OpenAsked() {
  v1::Open open;
  open.set_client_name("voxel-bench");
  return open;
}

Tally Since(const Tally& now, const Tally& before) {
  Tally out = now;
  out.sent -= before.sent;
  out.accepted -= before.accepted;
  out.owed -= before.owed;
  out.presented -= before.presented;
  out.unchanged -= before.unchanged;
  out.superseded -= before.superseded;
  out.lost -= before.lost;
  out.not_shown -= before.not_shown;
  return out;
}

}  // namespace

PacedClient::PacedClient(Loop& loop, const std::string& target, Frames frames)
    : loop_(loop),
      connection_(target),
      session_(loop, connection_, OpenAsked()),
      sender_(session_, std::move(frames), FrameSender::WhenBehind::kWait) {
  session_.OnReceipt([this](const v1::Receipt& receipt) { OnReceipt(receipt); });
}

absl::StatusOr<std::unique_ptr<PacedClient>> PacedClient::Open(Loop& loop,
                                                               const std::string& target,
                                                               Frames frames) {
  std::unique_ptr<PacedClient> client(new PacedClient(loop, target, std::move(frames)));
  if (absl::Status opened = client->session_.WaitOpened(); !opened.ok()) return opened;
  return client;
}

void PacedClient::OnReceipt(const v1::Receipt& receipt) {
  if (!receipt.has_outcome() || !receipt.outcome().has_presented()) return;
  const v1::Presented& presented = receipt.outcome().presented();
  const sync::TimeNs sent = sender_.SentAt(receipt.frame_id());
  run_.latency_ms.push_back(static_cast<double>(presented.last_byte_ns() - sent) /
                            sync::kMillisecond);
  run_.stages.Add(sent, presented.stages());
}

absl::StatusOr<PacedRun> PacedClient::Run(sync::TimeNs duration, double rate) {
  run_ = {};
  const Tally before = session_.tally();
  const uint64_t first = sender_.begun();
  const sync::TimeNs begin = Now(), end = begin + duration;
  Pace pace(begin, rate);
  std::vector<sync::TimeNs> due;
  while (pace.due() < end && session_.status().ok()) {
    if (absl::Status ran = loop_.RunTo(pace.due()); !ran.ok()) return ran;
    while (pace.due() <= Now() && pace.due() < end) {
      due.push_back(pace.due());
      pace.Take(pace.due());
      sender_.Due();
    }
  }
  const absl::Status begun = loop_.RunUntil(
      Now() + kSettleLimit, [this] { return sender_.idle() || !session_.status().ok(); });
  if (!begun.ok()) return begun;
  if (absl::Status settled = session_.WaitSettled(kSettleLimit); !settled.ok()) return settled;
  for (size_t i = 0; i < due.size(); ++i) {
    run_.late_ms.push_back(static_cast<double>(sender_.SentAt(first + i + 1) - due[i]) /
                           sync::kMillisecond);
  }
  run_.tally = Since(session_.tally(), before);
  return std::move(run_);
}

Frames LineFrames(const std::string& layer, int lines, int entities, double voxels,
                  double size_voxels, int variants) {
  entities = std::min(entities, lines);
  Frames frames;
  for (int variant = 0; variant < variants; ++variant) {
    std::vector<Put> puts;
    for (int i = 0; i < entities; ++i) {
      const int count = lines / entities + (i < lines % entities ? 1 : 0);
      puts.push_back({layer,
                      absl::StrCat("entity-", i),
                      {.count = static_cast<uint32_t>(count),
                       .form = LineForm::k24Bytes,
                       .length = 2 * voxels / size_voxels,
                       .seed = static_cast<uint64_t>(variant) * entities + i + 1}});
    }
    frames.push_back({Message(BatchOf(puts))});
  }
  return frames;
}

}  // namespace voxeld::bench
