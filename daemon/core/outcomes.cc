// What became of commits, on its way to those who sent them.
#include <utility>

#include "daemon/core/core_impl.h"

namespace voxeld::daemon {

void Core::Impl::DeliverOutcome(const Rider& rider, const CommitOutcome& outcome) {
  budget_->Release(Budget::Use::kOwed, kOwedBytes);
  const auto it = sessions_.find(rider.session);
  if (it != sessions_.end()) {
    Session& session = it->second;
    const bool waited = MustWait(session);
    --session.owed_outcomes;
    if (session.hold.has_value() && session.incarnation == rider.incarnation &&
        session.hold->sequence == rider.sequence) {
      session.hold->displays.erase(outcome.display);
      if (session.hold->displays.empty()) ReleaseHold(session);
    }
    if (waited && !MustWait(session)) PostTurn(session.id);
  } else if (const auto kept = dormant_.find(rider.session); kept != dormant_.end()) {
    --kept->second.owed_outcomes;
  }
  if (!rider.asked) return;
  Receipt receipt;
  receipt.frame_id = rider.frame_id;
  receipt.sequence = rider.sequence;
  receipt.what = outcome;
  receipt.incarnation = rider.incarnation;
  Deliver(rider.session, receipt);
}

void Core::Impl::Deliver(SessionId id, const Receipt& receipt) {
  if (const auto live = sessions_.find(id);
      live != sessions_.end() && live->second.sink != nullptr) {
    return live->second.sink->OnReceipt(receipt);
  }
  GiveBack(id, receipt);
}

void Core::Impl::GiveBack(SessionId id, const Receipt& receipt) {
  if (!IsOwed(receipt)) return;
  const auto live = sessions_.find(id);
  // Taken up meanwhile; its own stream's end may still be on its way, and would bounce it back.
  if (live != sessions_.end() && live->second.sink != nullptr &&
      live->second.incarnation != receipt.incarnation) {
    return live->second.sink->OnReceipt(receipt);
  }
  const auto kept = dormant_.find(id);
  if (live != sessions_.end()) {
    if (!budget_->Charge(Budget::Use::kOwed, kOwedBytes)) {
      ++outcomes_undelivered_;
      return;
    }
    live->second.undelivered.push_back(receipt);
    return;
  }
  if (kept == dormant_.end() || kept->second.outcomes_until <= clock_.Now() ||
      !budget_->Charge(Budget::Use::kOwed, kOwedBytes)) {
    ++outcomes_undelivered_;
    return;
  }
  kept->second.outcomes.push_back(receipt);
}

}  // namespace voxeld::daemon
