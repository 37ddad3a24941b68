// The other side: a separate daemon, or the bare sink, each in its own process and folder.
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
  std::string program;  // empty: voxeld beside this program
  // More of the configuration file, starting at its first section.
  std::vector<std::string> displays;  // as for --display; empty: none
  std::string config;
  bool tls = false;  // on its port, with a certificate that openssl makes for it
};

// A server on a unix socket and on a port that the system chooses. It ends with this object. Bound
// to one thread.
class ServerProcess {
 public:
  static absl::StatusOr<std::unique_ptr<ServerProcess>> StartDaemon(const DaemonOptions& options);
  // Starts this program again as the sink.
  static absl::StatusOr<std::unique_ptr<ServerProcess>> StartSink();

  const std::string& unix_target() const { return unix_target_; }
  const std::string& tcp_target() const { return tcp_target_; }  // not for a daemon with TLS
  const Target& tls_target() const { return tls_target_; }

  // Returns the resident memory of the process; an error if it has ended.
  absl::StatusOr<uint64_t> ResidentBytes() const;
  // Returns the CPU time that it has used.
  absl::StatusOr<int64_t> ProcessorNs() const;

 private:
  // Makes a certificate in the process's folder. Returns the section of the configuration that
  // names the files.
  absl::StatusOr<std::string> MakeCertificate();

  explicit ServerProcess(child::TemporaryFolder folder) : folder_(std::move(folder)) {}

  child::TemporaryFolder folder_;
  std::string unix_target_, tcp_target_;
  Target tls_target_;
  std::unique_ptr<child::ChildProcess> process_;
};

// Returns a configuration that admits `clients` clients, each on its own connection, and a few
// more.
std::string RoomFor(int clients);

// Returns the value of "NAME:   123 kB" in the text of /proc/PID/status, in bytes; 0 if it is
// missing.
uint64_t StatusBytes(const std::string& text, const std::string& name);

}  // namespace voxeld::bench
