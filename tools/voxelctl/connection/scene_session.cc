#include "tools/voxelctl/connection/scene_session.h"

#include <chrono>
#include <utility>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "common/text/printable.h"

namespace voxeld::voxelctl {
namespace {

constexpr std::chrono::seconds kOpenTime(15);

absl::Status Escaped(const absl::Status& status) {
  if (status.ok()) return status;
  return {status.code(), EscapeForTerminal(status.message())};
}

}  // namespace

absl::StatusOr<std::unique_ptr<SceneSession>> SceneSession::Open(client::Options options,
                                                                 Interrupt& interrupt) {
  // The tool's final report covers a single stream.
  options.reconnect = false;
  options.restore = false;
  options.ping_interval = client::Duration(0);
  absl::StatusOr<std::unique_ptr<client::Session>> opened =
      client::Session::Open(std::move(options));
  if (!opened.ok()) return Escaped(opened.status());
  std::unique_ptr<SceneSession> session(new SceneSession(*std::move(opened), interrupt));
  const absl::Status status = session->client_->WaitOpened(kOpenTime);
  if (!status.ok()) return Escaped(status);
  session->server_ = session->client_->server().value_or(client::ServerInfo());
  return session;
}

SceneSession::SceneSession(std::unique_ptr<client::Session> client, Interrupt& interrupt)
    : client_(std::move(client)),
      interrupt_(interrupt),
      listener_(interrupt.AddListener([this] { client_->Interrupt(); })) {}

SceneSession::~SceneSession() { interrupt_.RemoveListener(listener_); }

absl::Status SceneSession::CommitAndWait(sync::TimeNs timeout) {
  const absl::StatusOr<uint64_t> frame = client_->Commit();
  if (!frame.ok()) return Escaped(frame.status());
  const absl::StatusOr<client::Receipt> answer =
      client_->WaitAccepted(*frame, std::chrono::nanoseconds(timeout));
  if (answer.ok()) return absl::OkStatus();
  const std::optional<client::Receipt> receipt = client_->FindReceipt(*frame);
  if (!receipt || receipt->state != client::Receipt::State::kRefused)
    return Escaped(answer.status());
  std::string text =
      absl::StrCat("the server refused the scene: ", EscapeForTerminal(receipt->message));
  const client::Tally tally = client_->GetTally();
  for (const client::Issue& issue : tally.issues) {
    // The message already contains the first issue.
    if (absl::StrContains(receipt->message, client::DescribeIssue(issue))) continue;
    absl::StrAppend(&text, "\n  ", IssueForTerminal(issue));
  }
  if (tally.issue_count > tally.issues.size())
    absl::StrAppend(&text, "\n  and ", tally.issue_count - tally.issues.size(), " more");
  return absl::FailedPreconditionError(text);
}

absl::Status SceneSession::Commit() { return Escaped(client_->Commit().status()); }

absl::Status SceneSession::WaitSettled(sync::TimeNs timeout) {
  return Escaped(client_->WaitSettled(std::chrono::nanoseconds(timeout)));
}

absl::Status SceneSession::Close() { return Escaped(client_->Close()); }

std::string IssueForTerminal(const client::Issue& issue) {
  return EscapeForTerminal(client::DescribeIssue(issue));
}

}  // namespace voxeld::voxelctl
