// The client's session adapted to a command-line tool: Ctrl-C ends its waits, a lost connection
// ends it, and its messages are escaped for a terminal.
#pragma once

#include <memory>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "display/sync/clock.h"
#include "tools/voxelctl/process/interrupt.h"
#include "voxeld/client.h"

namespace voxeld::voxelctl {

class SceneSession {
 public:
  // Returns when the server has answered. `interrupt` must outlive the session.
  static absl::StatusOr<std::unique_ptr<SceneSession>> Open(client::Options options,
                                                            Interrupt& interrupt);
  ~SceneSession();
  SceneSession(const SceneSession&) = delete;
  SceneSession& operator=(const SceneSession&) = delete;

  client::Session& client() { return *client_; }
  const client::ServerInfo& server() const { return server_; }

  // Commits what is staged and waits for the answer. Errors: if it is refused, FailedPrecondition
  // with the server's message and the session's first issues.
  absl::Status CommitAndWait(sync::TimeNs timeout);
  absl::Status Commit();
  absl::Status WaitSettled(sync::TimeNs timeout);
  absl::Status Close();

 private:
  SceneSession(std::unique_ptr<client::Session> client, Interrupt& interrupt);
  std::unique_ptr<client::Session> client_;
  client::ServerInfo server_;
  Interrupt& interrupt_;
  const int listener_;
};

// Returns "layer/id, field: what was wrong", for people.
std::string IssueForTerminal(const client::Issue& issue);

}  // namespace voxeld::voxelctl
