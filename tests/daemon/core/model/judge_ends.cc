// How clients leave.
#include "absl/strings/str_cat.h"
#include "tests/daemon/core/model/core_judge.h"

namespace voxeld::daemon::model {

void CoreJudge::EverybodyReads() {
  for (const std::unique_ptr<Stream>& stream : streams_) {
    PlainSession* session = SessionOf(*stream);
    if (stream->open && session != nullptr && session->crowded) Crowd(*stream, false);
  }
}

void CoreJudge::CheckNobodyWaits() {
  for (const std::unique_ptr<Stream>& stream : streams_) {
    if (!wrong_.empty()) return;
    const PlainSession* session = SessionOf(*stream);
    if (!stream->open || session == nullptr) continue;
    if (session->waits() || !session->timed.empty()) {
      return Fail(absl::StrCat("session ", session->id, " waits though all is shown"));
    }
    std::string which;
    if (const uint64_t n = Missing(session->id, session->incarnation, &which); n > 0) {
      return Fail(absl::StrCat(n, " outcomes were never told, the first: ", which));
    }
    const auto next = undurable_.lower_bound({session->id, session->incarnation, 0});
    if (next != undurable_.end() && std::get<0>(next->first) == session->id &&
        std::get<1>(next->first) == session->incarnation) {
      return Fail(absl::StrCat("session ", session->id, " sequence ", std::get<2>(next->first),
                               " was never told DURABLE"));
    }
  }
}

void CoreJudge::EverybodyLeaves() {
  for (uint32_t place = 0; place < kPlaces && wrong_.empty(); ++place) {
    Stream* stream = places_[place];
    if (stream == nullptr || !stream->open || SessionOf(*stream) == nullptr) continue;
    Close(place, place % 2 == 0, 0);
  }
  for (const std::unique_ptr<Stream>& stream : streams_) {
    if (wrong_.empty() && stream->open && SessionOf(*stream) != nullptr) {
      // A place was taken over by another stream.
      Control({.owner = SessionOf(*stream)->owner, .evict = true});
    }
  }
}

void CoreJudge::EvictEverybody() {
  if (!wrong_.empty()) return;
  ClearLayer(0, "", false);
  while (wrong_.empty() && !plain_.scene.owners.empty()) {
    Control({.owner = plain_.scene.owners.begin()->first, .evict = true});
  }
}

void CoreJudge::CheckNothingIsHeld(uint64_t owed, uint64_t told) {
  CheckStats();
  owed += durables_owed_;
  told += durables_told_;
  if (owed != told) {
    Fail(absl::StrCat(owed, " outcomes were owed, and ", told, " told or counted as undelivered"));
  }
  for (size_t use = 0; use < Budget::kUses; ++use) {
    // An engine holds memory as long as it exists.
    if (static_cast<Budget::Use>(use) == Budget::Use::kEngines) continue;
    const uint64_t held = core().budget()->used_bytes(static_cast<Budget::Use>(use));
    if (held != 0) {
      Fail(absl::StrCat("everybody has left, and use ", use, " of the budget is ", held));
    }
  }
}

// Clients that are connected at shutdown receive the outcome of each accepted commit.
void CoreJudge::StopInTheMiddle() {
  if (!wrong_.empty()) return;
  Trace("the core stops");
  stopping_ = true;
  std::vector<Stream*> open;
  for (const std::unique_ptr<Stream>& stream : streams_) {
    if (!stream->open || SessionOf(*stream) == nullptr) continue;
    stream->may_end = true;
    open.push_back(stream.get());
  }
  if (!core().Stop(sync::kSecond).ok()) return Fail("the core does not stop");
  Explain(UINT64_MAX);
  for (Stream* stream : open) {
    if (!wrong_.empty()) return;
    if (!stream->ended) return Fail("a stream was not ended");
    std::string which;
    if (const uint64_t n = Missing(stream->info.session, stream->info.incarnation, &which); n > 0) {
      return Fail(absl::StrCat(n, " outcomes were never told, the first: ", which));
    }
  }
}

}  // namespace voxeld::daemon::model
