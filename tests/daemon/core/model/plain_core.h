// Sessions, turns, time and owners as the wire's rules say, one thing after another. Who says what
// happened next is the caller, who watches the core; the model says what must come of it.
#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "daemon/core/core.h"
#include "tests/daemon/core/model/plain_scene.h"

namespace voxeld::daemon::model {

struct PlainCommit {
  uint64_t sequence = 0;
  Commit commit;
  std::vector<Operation> operations;
  std::vector<uint64_t> credits;  // of each operation: bytes of the message that it came first in
  uint64_t credit = 0;            // of all, not given back
  std::vector<uint64_t> weights;  // of each operation: bytes of memory while it waits
  uint64_t refused = 0;           // on arrival
  uint64_t told = 0, left_out = 0;
  uint64_t dropped_frames = 0;
  bool late = false;
  bool late_known = true;
};

struct PlainHold {
  uint64_t sequence = 0;
  std::set<std::string> displays;
  sync::TimeNs deadline = 0;
};

struct PlainSession {
  uint64_t id = 0, incarnation = 0, owner = 0;
  OpenOptions options;
  std::string token;
  bool keeps = false;  // its layers
  bool closing = false;
  bool crowded = false;
  PlainCommit staged;
  std::deque<PlainCommit> queue, due;
  std::vector<PlainCommit> timed;
  std::optional<PlainHold> hold;
  uint64_t received = 0;  // bytes
  std::optional<uint64_t> last_frame_id, last_sequence;
  bool applied_any = false;
  sync::TimeNs was_dormant_ns = 0;    // before it was taken up
  uint64_t owed = 0;                  // outcomes of this incarnation's commits that are to be told
  uint64_t owed_most = 0;             // and of those before, which may be lost by now
  std::map<uint64_t, int> passed_by;  // sessions that had turns while this one waited for its own

  bool waits() const { return !queue.empty() || !due.empty(); }
  uint64_t outstanding() const;
  uint64_t staged_bytes() const;
  uint64_t waiting_bytes() const;   // of whole commits
  uint64_t detached_bytes() const;  // of those that wait for their time, or have waited
};

struct PlainDormant {
  uint64_t incarnation = 0, owner = 0;
  std::string token;
  std::optional<uint64_t> last_frame_id, last_sequence;
  uint64_t owed_most = 0;
  sync::TimeNs since = 0, until = 0;
};

// What a turn must come to.
struct PlainTurn {
  enum class Kind { kScheduled, kAccepted, kRefused };
  Kind kind = Kind::kAccepted;
  PlainCommit commit;
  PlainVerdict verdict;
  uint64_t refused_operations = 0;
  std::vector<Refusal> issues;         // told with it
  bool tells_rest = false;             // one more, of those left out
  bool durable = false;                // it is told when it is on the disk
  std::optional<Refusal> not_durable;  // told last: it asks for that in vain
};

class PlainCore {
 public:
  // How long outcomes wait for a session to be taken up.
  static constexpr sync::TimeNs kOutcomesKept = 10 * sync::kSecond;

  PlainCore(const Limits& limits, std::vector<std::string> displays)
      : scene(limits, !displays.empty()), limits_(limits), displays_(std::move(displays)) {}

  // Where displays tell of their sweeps, a timed commit is applied for its sweep: at most so much before its time, and no
  // later than so much after it.
  sync::TimeNs early = 0, slack = 0;

  // Somebody else has all of max_memory_bytes.
  bool memory_full = false;
  bool keeps_state = false;  // what sessions KEEP outlives the daemon

  PlainScene scene;
  std::map<uint64_t, PlainSession> sessions;
  std::map<uint64_t, PlainDormant> dormant;
  std::map<std::string, uint64_t> owner_tokens;

  struct Figures {
    uint64_t accepted = 0, refused = 0, operations_applied = 0, operations_refused = 0;
    uint64_t bytes_in = 0, client_drops = 0, frames_dropped = 0, timed_dropped = 0;
    uint64_t must_show_timeouts = 0, resumed = 0;
  };
  Figures figures;

  // ---- opening
  // What an Open must come to; kOk: it opens.
  absl::StatusCode MayOpen(const OpenOptions& options) const;
  // The session that a token names; 0: none.
  uint64_t SessionOf(const std::string& resume_token) const;
  // A new session, or one taken up that is dormant by now.
  PlainSession& Open(const OpenOptions& options, const SessionInfo& info, uint64_t open_bytes,
                     sync::TimeNs now);

  // ---- what a client sends
  bool HasRoom(const PlainSession& session) const;
  // Issues that are told at once. `local`: decoding's refusals.
  std::vector<Refusal> Take(PlainSession& session, const std::vector<Operation>& operations,
                            const std::vector<Issue>& malformed, uint64_t bytes);

  // ---- turns
  bool MayGo(const PlainSession& session, uint64_t owed) const;
  // What the core was heard to say of the turn; nothing, of a client that hears nothing.
  struct Heard {
    uint64_t sequence = 0;
    bool scheduled = false;
  };
  PlainTurn TakeTurn(PlainSession& session, sync::TimeNs now, const Heard* heard);
  // A commit that waits for its time, and may be applied by now.
  bool MayBeDue(const PlainSession& session, uint64_t sequence, sync::TimeNs now) const;
  // Whether a timed commit of the session may be due, or not yet: for the core to say.
  bool Uncertain(const PlainSession& session, sync::TimeNs now) const;
  void Told(PlainSession& session, const std::string& display, uint64_t sequence);

  // ---- ends
  void Finish(uint64_t session, sync::TimeNs now);
  // What becomes due by time alone: entities, layers, timed commits, dormant sessions.
  void PassTime(sync::TimeNs now);
  // When it has something to do next.
  sync::TimeNs NextDue() const;

  // ---- operators
  Cleared ClearLayer(uint64_t owner, const std::string& layer, bool keep_state);
  absl::StatusCode MayControl(const OwnerControl& control) const;
  void Control(const OwnerControl& control);
  // When its sessions have finished.
  void EndOwner(uint64_t owner);
  std::map<uint64_t, OwnerInfo> Owners() const;

 private:
  void Seal(PlainSession& session, const Operation& operation);
  void GiveUpFrames(PlainSession& session);
  // Whether one more operation would be too many, or too much, for what waits for a commit.
  bool TooMuchStaged(const PlainSession& session, uint64_t weight) const;
  void Idle(PlainSession& session);  // what is staged costs nothing while nothing waits
  void Tell(PlainTurn& turn, const Refusal& refusal) const;
  // Owners of whom nothing is left go, and the objects of those who have gone without layers.
  void Tidy();

  const Limits limits_;
  const std::vector<std::string> displays_;
  std::multimap<sync::TimeNs, uint64_t> lingering_;
};

}  // namespace voxeld::daemon::model
