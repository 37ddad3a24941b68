// The client's session as a command-line tool wants it: Ctrl-C ends its waits, a lost connection ends
// it, and its words are fit for a terminal.
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
  // Returns when the server has answered. `interrupt` must outlive it.
  static absl::StatusOr<std::unique_ptr<SceneSession>> Open(client::Options options,
                                                            Interrupt& interrupt);
  ~SceneSession();
  SceneSession(const SceneSession&) = delete;
  SceneSession& operator=(const SceneSession&) = delete;

  client::Session& client() { return *client_; }
  const client::ServerInfo& server() const { return server_; }

  // Commits what is staged and waits for the answer. FailedPrecondition with the server's words and
  // the session's first issues if it is refused.
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

// "layer/id, field: what was wrong", for people.
std::string IssueForTerminal(const client::Issue& issue);

}  // namespace voxeld::voxelctl
