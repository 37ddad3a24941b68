// The other end: a daemon of one's own, or the bare sink, each in a process and a folder of its own.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "tools/bench/voxel_bench/wire.h"
#include "tools/child/child_process.h"

namespace voxeld::bench {

struct DaemonOptions {
  std::string program;                // empty: voxeld beside this program
  std::vector<std::string> displays;  // as of --display; empty: none at all
  std::string config;                 // more of the configuration file, from its first section on
  bool tls = false;                   // on its port; by a certificate made for it (by openssl)
};

// One that serves on a unix socket and on a port of the system's choice; it ends with this object.
// Bound to one thread.
class ServerProcess {
 public:
  static absl::StatusOr<std::unique_ptr<ServerProcess>> StartDaemon(const DaemonOptions& options);
  // Runs this program again.
  static absl::StatusOr<std::unique_ptr<ServerProcess>> StartSink();

  const std::string& unix_target() const { return unix_target_; }
  const std::string& tcp_target() const { return tcp_target_; }  // not of one with TLS
  const Target& tls_target() const { return tls_target_; }

  // Of its memory that is resident; an error if it has ended.
  absl::StatusOr<uint64_t> ResidentBytes() const;
  // Processor time that it has used.
  absl::StatusOr<int64_t> ProcessorNs() const;

 private:
  // Into its folder. The section of the configuration that names the files.
  absl::StatusOr<std::string> MakeCertificate();

  explicit ServerProcess(child::TemporaryFolder folder) : folder_(std::move(folder)) {}

  child::TemporaryFolder folder_;
  std::string unix_target_, tcp_target_;
  Target tls_target_;
  std::unique_ptr<child::ChildProcess> process_;
};

// Configuration that lets in so many clients, each on a connection of its own, and a few more.
std::string RoomFor(int clients);

// The value of "NAME:   123 kB" in the text of /proc/PID/status, in bytes; 0 if it is not there.
uint64_t StatusBytes(const std::string& text, const std::string& name);

}  // namespace voxeld::bench
