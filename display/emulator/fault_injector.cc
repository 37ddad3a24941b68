#include "display/emulator/fault_injector.h"

#include <algorithm>
#include <string>
#include <utility>

#include "absl/strings/escaping.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"

namespace voxeld::display::emulator {
namespace {

using What = Fault::What;
using When = Fault::When;

constexpr uint8_t kIn = 0x82;

struct Kind {
  std::string_view name;
  What what;
  bool has_amount;
  uint64_t unit;  // unit of the amount, in ns or bytes
};
constexpr uint64_t kMs = sync::kMillisecond;
constexpr Kind kKinds[] = {
    {"stall", What::kStall, false, 1},    {"nak", What::kNak, true, kMs},
    {"partial", What::kPartial, true, 1}, {"error", What::kError, true, 1},
    {"babble", What::kBabble, true, 1},   {"corrupt", What::kCorrupt, true, 1},
    {"drop", What::kDrop, true, 1},       {"unplug", What::kUnplug, true, kMs},
    {"delay", What::kDelay, true, kMs},
};
constexpr uint64_t kMostNumber = 1'000'000'000'000;

// Returns true for faults of the cable, which need no transfer.
bool ActsAlone(What what) {
  return what == What::kStall || what == What::kNak || what == What::kUnplug ||
         what == What::kDelay || what == What::kError || what == What::kBabble;
}

// Returns the text in quotes, with unprintable characters escaped, cut to a length fit for a
// message.
std::string Shown(std::string_view text) {
  constexpr size_t kMost = 64;  // bytes of the text
  return absl::StrCat("\"", absl::CHexEscape(std::string(text.substr(0, kMost))),
                      text.size() > kMost ? "…\"" : "\"");
}

absl::StatusOr<Fault> ParseFault(std::string_view text) {
  const auto bad = [&](const char* what) {
    return absl::InvalidArgumentError(absl::StrCat("fault ", Shown(text), ": ", what,
                                                   "; it is WHAT[:AMOUNT]@WHEN[/in], such as ",
                                                   "unplug:500@2000ms or stall@t10"));
  };
  Fault fault;
  const std::vector<std::string> parts = absl::StrSplit(std::string(text), absl::MaxSplits('@', 1));
  if (parts.size() != 2) return bad("there is no '@'");
  const std::vector<std::string> head = absl::StrSplit(parts[0], absl::MaxSplits(':', 1));
  const auto* kind = std::find_if(std::begin(kKinds), std::end(kKinds),
                                  [&](const Kind& k) { return k.name == head[0]; });
  if (kind == std::end(kKinds)) {
    return bad(
        "there is no such fault; there are stall, nak, partial, error, babble, corrupt, drop, "
        "unplug, delay");
  }
  fault.what = kind->what;
  if (kind->has_amount != (head.size() == 2)) {
    return bad(kind->has_amount ? "the amount is missing" : "it takes no amount");
  }
  if (kind->has_amount &&
      (!absl::SimpleAtoi(head[1], &fault.amount) || fault.amount > kMostNumber / kind->unit)) {
    return bad("the amount is not a number in range");
  }
  fault.amount *= kind->unit;
  std::string when = parts[1];
  if (when.ends_with("/in")) {
    fault.endpoint = kIn;
    when.resize(when.size() - 3);
  }
  uint64_t unit = 1;
  if (when.starts_with("t") || when.starts_with("b")) {
    fault.when = when[0] == 't' ? When::kTransfer : When::kByte;
    when.erase(0, 1);
  } else if (when.ends_with("ms")) {
    fault.when = When::kTime;
    unit = kMs;
    when.resize(when.size() - 2);
  } else {
    return bad("WHEN is tN, bN or Nms");
  }
  if (!absl::SimpleAtoi(when, &fault.at) || fault.at > kMostNumber / unit) {
    return bad("WHEN has no number in range");
  }
  fault.at *= unit;
  return fault;
}

}  // namespace

absl::StatusOr<FaultPlan> ParseFaultPlan(std::string_view text) {
  FaultPlan plan;
  const std::vector<std::string> parts = absl::StrSplit(std::string(text), ';', absl::SkipEmpty());
  for (const std::string& part : parts) {
    absl::StatusOr<Fault> fault = ParseFault(part);
    if (!fault.ok()) return fault.status();
    plan.push_back(*fault);
  }
  return plan;
}

std::string ToText(const Fault& fault) {
  const auto* kind = std::find_if(std::begin(kKinds), std::end(kKinds),
                                  [&](const Kind& k) { return k.what == fault.what; });
  std::string text(kind->name);
  if (kind->has_amount) absl::StrAppend(&text, ":", fault.amount / kind->unit);
  switch (fault.when) {
    case When::kTransfer:
      absl::StrAppend(&text, "@t", fault.at);
      break;
    case When::kByte:
      absl::StrAppend(&text, "@b", fault.at);
      break;
    case When::kTime:
      absl::StrAppend(&text, "@", fault.at / kMs, "ms");
      break;
  }
  if (fault.endpoint == kIn) absl::StrAppend(&text, "/in");
  return text;
}

FaultInjector::FaultInjector(std::unique_ptr<UsbDeviceModel> device, FaultPlan plan,
                             sync::Clock& clock)
    : device_(std::move(device)), clock_(clock) {
  device_->SetComplete(
      [this](uint64_t id, TransferStatus status, uint32_t actual, std::span<const std::byte> in) {
        OnComplete(id, status, actual, in);
      });
  for (const Fault& fault : plan) Add(fault);
}

void FaultInjector::Add(Fault fault) {
  Planned planned{fault, sync::kNever};
  const Endpoint& passed = endpoints_[fault.endpoint];
  switch (fault.when) {
    case When::kTransfer:
      planned.fault.at += passed.transfers;
      break;
    case When::kByte:
      planned.fault.at += passed.bytes;
      break;
    case When::kTime:
      planned.time = clock_.Now() + static_cast<sync::TimeNs>(fault.at);
      break;
  }
  plan_.push_back(planned);
}

void FaultInjector::Clear() {
  plan_.clear();
  replug_at_ = sync::kNever;
  EndAll(TransferStatus::kCancelled);
  endpoints_.clear();
}

void FaultInjector::Act(const Fault& fault, sync::TimeNs now) {
  Endpoint& endpoint = endpoints_[fault.endpoint];
  const auto amount = static_cast<sync::TimeNs>(fault.amount);
  switch (fault.what) {
    case What::kStall:
      endpoint.halted = true;
      return;
    case What::kNak:
      endpoint.nak_until = std::max(endpoint.nak_until, now + amount);
      return;
    case What::kDelay:
      endpoint.hold_until = std::max(endpoint.hold_until, now + amount);
      return;
    case What::kError:
      endpoint.errors_left += fault.amount;
      return;
    case What::kBabble:
      endpoint.babbles_left += fault.amount;
      return;
    case What::kUnplug:
      SetPlugged(false);
      replug_at_ = now + amount;
      return;
    case What::kPartial:
    case What::kCorrupt:
    case What::kDrop:
      return;  // these need a transfer: Apply
  }
}

void FaultInjector::Submit(const Urb& urb) {
  Tick();
  Endpoint& endpoint = endpoints_[urb.endpoint];
  if (plugged() && (!endpoint.waiting.empty() || clock_.Now() < endpoint.nak_until)) {
    endpoint.waiting.push_back(urb);
    return;
  }
  Pass(urb);
}

bool FaultInjector::Apply(const Urb& original, Urb& urb, Passing& passing) {
  Endpoint& endpoint = endpoints_[urb.endpoint];
  const sync::TimeNs now = clock_.Now();
  const uint64_t transfer = ++endpoint.transfers;
  const uint64_t first_byte = endpoint.bytes;
  const size_t size = urb.out.size();
  endpoint.bytes += size;
  std::vector<Planned> due;
  std::erase_if(plan_, [&](const Planned& planned) {
    const Fault& fault = planned.fault;
    const bool here =
        fault.endpoint == urb.endpoint &&
        (fault.when == When::kTransfer ? fault.at == transfer
         : fault.when == When::kByte   ? fault.at >= first_byte && fault.at < first_byte + size
                                       : planned.time <= now);
    if (here) due.push_back(planned);
    return here;
  });
  for (const Planned& planned : due) {
    const Fault& fault = planned.fault;
    const bool by_byte = fault.when == When::kByte;
    const size_t at = by_byte ? static_cast<size_t>(fault.at - first_byte) : 0;
    switch (fault.what) {
      case What::kPartial:
        urb.out = urb.out.first(std::min<size_t>(urb.out.size(), fault.amount));
        passing.halts = true;
        break;
      case What::kCorrupt: {
        const size_t victim = by_byte ? at : static_cast<size_t>(fault.amount);
        if (victim >= urb.out.size()) break;
        passing.changed.assign(urb.out.begin(), urb.out.end());
        passing.changed[victim] = ~passing.changed[victim];
        urb.out = passing.changed;
        break;
      }
      case What::kDrop: {
        const size_t begin = std::min(by_byte ? at : urb.out.size() / 2, urb.out.size());
        const size_t end = begin + std::min<size_t>(fault.amount, urb.out.size() - begin);
        std::vector<std::byte> rest(urb.out.begin(),
                                    urb.out.begin() + static_cast<ptrdiff_t>(begin));
        rest.insert(rest.end(), urb.out.begin() + static_cast<ptrdiff_t>(end), urb.out.end());
        passing.changed = std::move(rest);
        urb.out = passing.changed;
        passing.claim = static_cast<uint32_t>(size);
        break;
      }
      default:
        Act(fault, now);
        break;
    }
  }
  if (!plugged()) {
    complete_(urb.id, TransferStatus::kDisconnected, 0, {});
    return false;
  }
  // A NAK that began with this very transfer, which will be submitted again.
  if (now < endpoint.nak_until) {
    --endpoint.transfers;
    endpoint.bytes = first_byte;
    endpoint.waiting.push_front(original);
    return false;
  }
  if (endpoint.errors_left > 0) {
    --endpoint.errors_left;
    complete_(urb.id, TransferStatus::kError, 0, {});
    return false;
  }
  if (endpoint.babbles_left > 0) {
    --endpoint.babbles_left;
    complete_(urb.id, TransferStatus::kOverflow, 0, {});
    return false;
  }
  if (passing.halts) endpoint.halted = true;
  if ((endpoint.halted && !passing.halts) || (passing.halts && urb.out.empty())) {
    complete_(urb.id, TransferStatus::kStall, 0, {});
    return false;
  }
  return true;
}

void FaultInjector::Pass(const Urb& original) {
  Urb urb = original;
  Passing& passing = passing_[urb.id];
  passing.endpoint = urb.endpoint;
  if (urb.endpoint == 0 && urb.setup.request_type == 0x02 && urb.setup.request == 0x01) {
    endpoints_[urb.setup.index & 0xFF].halted = false;  // CLEAR_FEATURE(ENDPOINT_HALT)
  }
  const Endpoint& endpoint = endpoints_[urb.endpoint];
  if (endpoint.halted && plugged()) {
    passing_.erase(urb.id);
    return complete_(urb.id, TransferStatus::kStall, 0, {});
  }
  if (!Apply(original, urb, passing)) {
    passing_.erase(urb.id);
    return;
  }
  device_->Submit(urb);
}

void FaultInjector::OnComplete(uint64_t id, TransferStatus status, uint32_t actual,
                               std::span<const std::byte> in) {
  const auto it = passing_.find(id);
  if (it == passing_.end()) return;
  const Passing passing = std::move(it->second);
  passing_.erase(it);
  if (status == TransferStatus::kOk) {
    if (passing.halts) status = TransferStatus::kStall;
    if (passing.claim != 0) actual = passing.claim;
  }
  const Endpoint& endpoint = endpoints_[passing.endpoint];
  const bool queue = std::any_of(held_.begin(), held_.end(), [&](const Held& held) {
    return held.endpoint == passing.endpoint;
  });
  if ((queue || clock_.Now() < endpoint.hold_until) && status != TransferStatus::kDisconnected) {
    held_.push_back({id, passing.endpoint, status, actual, {in.begin(), in.end()}});
    return;
  }
  complete_(id, status, actual, in);
}

bool FaultInjector::Unlink(uint64_t id) {
  for (auto& [address, endpoint] : endpoints_) {
    if (std::erase_if(endpoint.waiting, [id](const Urb& urb) { return urb.id == id; }) > 0) {
      return true;
    }
  }
  if (std::erase_if(held_, [id](const Held& held) { return held.id == id; }) > 0) return true;
  const bool pending = device_->Unlink(id);
  if (pending) passing_.erase(id);
  return pending;
}

void FaultInjector::Tick() {
  const sync::TimeNs now = clock_.Now();
  if (replug_at_ <= now) {
    replug_at_ = sync::kNever;
    SetPlugged(true);
  }
  std::vector<Planned> due;
  std::erase_if(plan_, [&](const Planned& planned) {
    const bool act =
        planned.fault.when == When::kTime && planned.time <= now && ActsAlone(planned.fault.what);
    if (act) due.push_back(planned);
    return act;
  });
  for (const Planned& planned : due) Act(planned.fault, now);
  for (auto& [address, endpoint] : endpoints_) {
    while (!endpoint.waiting.empty() && endpoint.nak_until <= now) {
      const Urb urb = endpoint.waiting.front();
      endpoint.waiting.pop_front();
      Pass(urb);
    }
  }
  std::deque<Held> held;
  held.swap(held_);
  for (Held& completion : held) {
    if (now < endpoints_[completion.endpoint].hold_until) {
      held_.push_back(std::move(completion));
    } else {
      complete_(completion.id, completion.status, completion.actual, completion.in);
    }
  }
  device_->Tick();
}

sync::TimeNs FaultInjector::NextTimeout() const {
  sync::TimeNs next = std::min(device_->NextTimeout(), replug_at_);
  for (const Planned& planned : plan_) {
    if (ActsAlone(planned.fault.what)) next = std::min(next, planned.time);
  }
  for (const auto& [address, endpoint] : endpoints_) {
    if (!endpoint.waiting.empty()) next = std::min(next, endpoint.nak_until);
  }
  for (const Held& held : held_) {
    const auto endpoint = endpoints_.find(held.endpoint);
    if (endpoint != endpoints_.end()) next = std::min(next, endpoint->second.hold_until);
  }
  return next;
}

void FaultInjector::EndAll(TransferStatus status) {
  for (auto& [address, endpoint] : endpoints_) {
    endpoint.halted = false;
    std::deque<Urb> waiting;
    waiting.swap(endpoint.waiting);
    for (const Urb& urb : waiting) complete_(urb.id, status, 0, {});
  }
  std::deque<Held> held;
  held.swap(held_);
  for (const Held& completion : held) complete_(completion.id, status, 0, {});
}

void FaultInjector::Reset() {
  EndAll(TransferStatus::kCancelled);
  device_->Reset();
}

void FaultInjector::SetPlugged(bool plugged) {
  if (!plugged) {
    for (auto& [address, endpoint] : endpoints_) {
      endpoint.errors_left = endpoint.babbles_left = 0;
      endpoint.nak_until = endpoint.hold_until = 0;
    }
    EndAll(TransferStatus::kDisconnected);
  }
  device_->SetPlugged(plugged);
}

}  // namespace voxeld::display::emulator
