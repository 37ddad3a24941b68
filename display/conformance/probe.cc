#include "display/conformance/probe.h"

#include <algorithm>
#include <utility>

#include "absl/strings/str_format.h"

namespace voxeld::display::conformance {
namespace {

// Time that a transport needs to report that a transfer timed out.
constexpr sync::TimeNs kGrace = sync::kSecond;
constexpr sync::TimeNs kRoomRetry = 5 * sync::kMillisecond;
constexpr size_t kMostHex = 64;

}  // namespace

std::string Describe(const Answer& answer) {
  if (!answer.ok()) return TransferStatusName(answer.status);
  return absl::StrCat("an answer of ", answer.actual, " bytes");
}

std::string Hex(std::span<const std::byte> bytes) {
  std::string text;
  for (const std::byte byte : bytes.first(std::min(bytes.size(), kMostHex))) {
    absl::StrAppendFormat(&text, "%s%02X", text.empty() ? "" : " ", std::to_integer<int>(byte));
  }
  if (bytes.size() > kMostHex) absl::StrAppend(&text, " …");
  return text.empty() ? "no bytes" : text;
}

Probe::Probe(UsbTransport& transport, sync::Clock& clock, Waiter& waiter, uint64_t seed,
             std::function<bool()> cancelled)
    : transport_(transport),
      clock_(clock),
      waiter_(waiter),
      cancelled_(std::move(cancelled)),
      random_(static_cast<std::minstd_rand::result_type>(seed % 2147483646 + 1)) {}

Probe::~Probe() { Cancel({posted_.begin(), posted_.end()}); }

uint32_t Probe::Random(uint32_t bound) {
  return bound < 2 ? 0 : static_cast<uint32_t>(random_() % bound);
}

void Probe::Drain() {
  drained_.clear();
  transport_.Drain(drained_);
  for (TransferCompletion& completion : drained_) {
    // Ignore completions of transfers that were given up before.
    if (posted_.erase(completion.id) > 0) done_[completion.id] = std::move(completion);
  }
}

bool Probe::Step(sync::TimeNs until) {
  const size_t before = posted_.size();
  Drain();
  if (posted_.size() == before && clock_.Now() < until) {
    waiter_.Wait(until);
    Drain();
  }
  if (!cancelled_ || !cancelled_()) return true;
  check_.Fail("a whole run", "it was interrupted");
  return false;
}

bool Probe::WaitFor(sync::TimeNs limit, const std::function<bool()>& done) {
  const sync::TimeNs deadline = clock_.Now() + limit;
  while (!done()) {
    if (clock_.Now() >= deadline || !Step(deadline)) return done();
  }
  return true;
}

void Probe::Pause(sync::TimeNs duration) {
  WaitFor(duration, [] { return false; });
}

std::optional<TransferId> Probe::Post(Transfer&& transfer) {
  const sync::TimeNs deadline = clock_.Now() + kGrace;
  while (true) {
    // A refused transfer is unchanged. NOLINTNEXTLINE(bugprone-use-after-move)
    const absl::StatusOr<TransferId> id = transport_.Submit(std::move(transfer));
    if (id.ok()) {
      posted_.insert(*id);
      return *id;
    }
    if (!absl::IsResourceExhausted(id.status()) || clock_.Now() >= deadline ||
        !Step(std::min(deadline, clock_.Now() + kRoomRetry))) {
      return std::nullopt;
    }
  }
}

std::optional<TransferCompletion> Probe::Take(TransferId id) {
  const auto it = done_.find(id);
  if (it == done_.end()) return std::nullopt;
  TransferCompletion completion = std::move(it->second);
  done_.erase(it);
  return completion;
}

void Probe::Cancel(const std::vector<TransferId>& ids) {
  for (const TransferId id : ids) {
    if (posted_.contains(id)) transport_.Cancel(id);
  }
  // Also for a cancelled run: the next one must not find them.
  const sync::TimeNs deadline = clock_.Now() + kGrace;
  const auto all_ended = [&] {
    return std::none_of(ids.begin(), ids.end(),
                        [&](TransferId id) { return posted_.contains(id); });
  };
  while (transport_.is_open() && !all_ended() && clock_.Now() < deadline) {
    Drain();
    if (!all_ended()) waiter_.Wait(deadline);
    Drain();
  }
  for (const TransferId id : ids) {
    posted_.erase(id);
    done_.erase(id);
  }
}

Answer Probe::Await(TransferId id, sync::TimeNs limit) {
  if (!WaitFor(limit + kGrace, [&] { return done_.contains(id); })) {
    Cancel({id});
    return {.status = TransferStatus::kTimedOut};
  }
  const std::optional<TransferCompletion> completion = Take(id);
  return {.status = completion->status,
          .actual = completion->actual_length,
          .data = {completion->data.begin(), completion->data.end()}};
}

Answer Probe::Finish(absl::StatusOr<TransferId> id, sync::TimeNs limit) {
  if (!id.ok()) return {.status = TransferStatus::kDisconnected};
  posted_.insert(*id);
  return Await(*id, limit);
}

Answer Probe::In(const UsbSetup& setup) {
  Transfer transfer;
  transfer.type = TransferType::kControl;
  transfer.setup = setup;
  transfer.length = setup.length;
  transfer.timeout = kRequestLimit;
  const std::optional<TransferId> id = Post(std::move(transfer));
  return id ? Await(*id, kRequestLimit) : Answer{.status = TransferStatus::kDisconnected};
}

Answer Probe::Out(const UsbSetup& setup, std::span<const std::byte> data) {
  Transfer transfer;
  transfer.type = TransferType::kControl;
  transfer.setup = setup;
  transfer.data.Append(data);
  transfer.timeout = kRequestLimit;
  const std::optional<TransferId> id = Post(std::move(transfer));
  return id ? Await(*id, kRequestLimit) : Answer{.status = TransferStatus::kDisconnected};
}

Answer Probe::Bulk(uint8_t endpoint, std::span<const std::byte> data, bool zero_packet,
                   sync::TimeNs limit) {
  Transfer transfer;
  transfer.endpoint = endpoint;
  transfer.data.Append(data);
  transfer.zero_packet = zero_packet;
  transfer.timeout = limit;
  const std::optional<TransferId> id = Post(std::move(transfer));
  return id ? Await(*id, limit) : Answer{.status = TransferStatus::kDisconnected};
}

Answer Probe::ClearHalt(uint8_t endpoint) {
  return Finish(transport_.ClearHalt(endpoint), kRequestLimit);
}

Answer Probe::Reset() { return Finish(transport_.Reset(), kBulkLimit); }

}  // namespace voxeld::display::conformance
