// Sessions, turns, time and owners according to the wire's rules, one event after another. The
// caller, who watches the core, says what happened next; the model says what the result must be.
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
  std::vector<uint64_t> credits;  // for each operation: bytes of its first message
  uint64_t credit = 0;            // the total that has not been given back
  std::vector<uint64_t> weights;  // for each operation: bytes of memory while it waits
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
  bool keeps = false;  // its layers are persistent
  bool closing = false;
  bool crowded = false;
  PlainCommit staged;
  std::deque<PlainCommit> queue, due;
  std::vector<PlainCommit> timed;
  std::optional<PlainHold> hold;
  uint64_t received = 0;  // in bytes
  std::optional<uint64_t> last_frame_id, last_sequence;
  bool applied_any = false;
  sync::TimeNs was_dormant_ns = 0;    // before it was resumed
  uint64_t owed = 0;                  // outstanding outcomes of this incarnation's commits
  uint64_t owed_most = 0;             // and of earlier ones, which may be lost by now
  std::map<uint64_t, int> passed_by;  // sessions that had turns while this one waited for its own

  bool waits() const { return !queue.empty() || !due.empty(); }
  uint64_t outstanding() const;
  uint64_t staged_bytes() const;
  uint64_t waiting_bytes() const;   // of whole commits
  uint64_t detached_bytes() const;  // of commits that wait for their time, or have waited
};

struct PlainDormant {
  uint64_t incarnation = 0, owner = 0;
  std::string token;
  std::optional<uint64_t> last_frame_id, last_sequence;
  uint64_t owed_most = 0;
  sync::TimeNs since = 0, until = 0;
};

// The required result of a turn.
struct PlainTurn {
  enum class Kind { kScheduled, kAccepted, kRefused };
  Kind kind = Kind::kAccepted;
  PlainCommit commit;
  PlainVerdict verdict;
  uint64_t refused_operations = 0;
  std::vector<Refusal> issues;         // reported with it
  bool tells_rest = false;             // one more Issue, for those that were left out
  bool durable = false;                // reported when it is on the disk
  std::optional<Refusal> not_durable;  // reported last: the request for durability is refused
};

class PlainCore {
 public:
  // How long outcomes wait for a session to be resumed.
  static constexpr sync::TimeNs kOutcomesKept = 10 * sync::kSecond;

  PlainCore(const Limits& limits, std::vector<std::string> displays)
      : scene(limits, !displays.empty()), limits_(limits), displays_(std::move(displays)) {}

  // If displays report their sweeps, a timed commit is applied for its sweep: at most `early`
  // before its time, and at most `slack` after it.
  sync::TimeNs early = 0, slack = 0;

  // Another user holds all of max_memory_bytes.
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
  // Returns the required status of an Open; kOk: it opens.
  absl::StatusCode MayOpen(const OpenOptions& options) const;
  // Returns the session that a token names; 0: none.
  uint64_t SessionOf(const std::string& resume_token) const;
  // Opens a new session, or resumes a dormant one.
  PlainSession& Open(const OpenOptions& options, const SessionInfo& info, uint64_t open_bytes,
                     sync::TimeNs now);

  // ---- messages of a client
  bool HasRoom(const PlainSession& session) const;
  // Returns the Issues that are reported at once. `local`: decoding's refusals.
  std::vector<Refusal> Take(PlainSession& session, const std::vector<Operation>& operations,
                            const std::vector<Issue>& malformed, uint64_t bytes);

  // ---- turns
  bool MayGo(const PlainSession& session, uint64_t owed) const;
  // The core's report about the turn; null for a client that receives nothing.
  struct Heard {
    uint64_t sequence = 0;
    bool scheduled = false;
  };
  PlainTurn TakeTurn(PlainSession& session, sync::TimeNs now, const Heard* heard);
  // Returns whether a commit that waits for its time may be applied by now.
  bool MayBeDue(const PlainSession& session, uint64_t sequence, sync::TimeNs now) const;
  // Returns whether a timed commit of the session may be due or not: the core decides.
  bool Uncertain(const PlainSession& session, sync::TimeNs now) const;
  void Told(PlainSession& session, const std::string& display, uint64_t sequence);

  // ---- ends
  void Finish(uint64_t session, sync::TimeNs now);
  // Applies everything that becomes due by time alone: entities, layers, timed commits, dormant
  // sessions.
  void PassTime(sync::TimeNs now);
  // Returns the time at which it has something to do next.
  sync::TimeNs NextDue() const;

  // ---- operators
  Cleared ClearLayer(uint64_t owner, const std::string& layer, bool keep_state);
  absl::StatusCode MayControl(const OwnerControl& control) const;
  void Control(const OwnerControl& control);
  // Ends the owner when its sessions have finished.
  void EndOwner(uint64_t owner);
  std::map<uint64_t, OwnerInfo> Owners() const;

 private:
  void Seal(PlainSession& session, const Operation& operation);
  void GiveUpFrames(PlainSession& session);
  // Returns whether one more operation would exceed the number or the size of operations that may
  // wait for a commit.
  bool TooMuchStaged(const PlainSession& session, uint64_t weight) const;
  void Idle(PlainSession& session);  // staged operations cost nothing while no commit waits
  void Tell(PlainTurn& turn, const Refusal& refusal) const;
  // Removes owners of whom nothing is left, and the objects of those who have left without layers.
  void Tidy();

  const Limits limits_;
  const std::vector<std::string> displays_;
  std::multimap<sync::TimeNs, uint64_t> lingering_;
};

}  // namespace voxeld::daemon::model
