#include "tools/bench/voxel_bench/servers.h"

#include <signal.h>
#include <unistd.h>

#include <fstream>
#include <nlohmann/json.hpp>
#include <optional>
#include <sstream>
#include <utility>

#include "absl/status/status.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "absl/strings/strip.h"
#include "tools/child/programs.h"

namespace voxeld::bench {
namespace {

constexpr char kAnyPort[] = "127.0.0.1:0";

std::string FileText(const std::string& path) {
  std::ifstream file(path);
  std::ostringstream text;
  text << file.rdbuf();
  return text.str();
}

absl::Status NotReady(const std::string& what, const child::ChildProcess& process) {
  return absl::UnavailableError(
      absl::StrCat(what, " did not come up; it said:\n", process.output()));
}

}  // namespace

absl::StatusOr<std::unique_ptr<ServerProcess>> ServerProcess::StartDaemon(
    const DaemonOptions& options) {
  absl::StatusOr<child::TemporaryFolder> folder = child::TemporaryFolder::Make("voxel-bench");
  if (!folder.ok()) return folder.status();
  std::unique_ptr<ServerProcess> server(new ServerProcess(*std::move(folder)));
  const std::string& path = server->folder_.path();
  const std::string config = absl::StrCat(path, "/voxeld.toml");
  std::string security;
  if (options.tls) {
    absl::StatusOr<std::string> made = server->MakeCertificate();
    if (!made.ok()) return made.status();
    security = *std::move(made);
  }
  std::ofstream(config) << "display = []\n" << options.config << security;
  server->unix_target_ = absl::StrCat("unix:", path, "/voxeld.sock");
  std::vector<std::string> arguments = {
      options.program.empty() ? child::ProgramBeside("voxeld") : options.program,
      "--config",
      config,
      "--listen",
      server->unix_target_,
      "--listen",
      options.tls ? absl::StrCat("tls:", kAnyPort) : kAnyPort,
      "--http",
      "off",
      "--engine",
      "cpu",
      "--log-format",
      "json"};
  for (const std::string& display : options.displays) {
    arguments.insert(arguments.end(), {"--display", display});
  }
  absl::StatusOr<std::unique_ptr<child::ChildProcess>> process =
      child::ChildProcess::Start(arguments, {.environment = child::CleanEnvironment(path)});
  if (!process.ok()) return process.status();
  server->process_ = *std::move(process);
  const std::optional<std::string> ready = server->process_->ReadLineWith("\"event\":\"ready\"");
  if (!ready.has_value()) return NotReady(arguments[0], *server->process_);
  const nlohmann::json line = nlohmann::json::parse(*ready, nullptr, false);
  const std::string listen = line.is_object() ? line.value("listen", "") : "";
  absl::string_view port = absl::string_view(listen).substr(listen.rfind(' ') + 1);
  if (options.tls) {
    absl::ConsumePrefix(&port, "tls:");
    server->tls_target_ = {std::string(port), FileText(absl::StrCat(path, "/certificate.pem")),
                           FileText(absl::StrCat(path, "/key.pem"))};
  } else {
    server->tcp_target_ = std::string(port);
  }
  return server;
}

absl::StatusOr<std::string> ServerProcess::MakeCertificate() {
  const std::string certificate = absl::StrCat(folder_.path(), "/certificate.pem");
  const std::string key = absl::StrCat(folder_.path(), "/key.pem");
  absl::StatusOr<std::unique_ptr<child::ChildProcess>> openssl = child::ChildProcess::Start(
      {"/usr/bin/openssl", "req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:P-256",
       "-nodes", "-days", "1", "-subj", "/CN=voxel-bench", "-addext", "subjectAltName=IP:127.0.0.1",
       "-keyout", key, "-out", certificate});
  if (!openssl.ok()) return openssl.status();
  if ((*openssl)->Wait() != 0) {
    return absl::UnavailableError(
        absl::StrCat("openssl made no certificate; it said:\n", (*openssl)->output()));
  }
  return absl::StrCat("[security]\ntls_certificate = \"", certificate, "\"\ntls_key = \"", key,
                      "\"\ncertificate_scopes = \"all\"\ntls_client_ca = \"", certificate, "\"\n");
}

absl::StatusOr<std::unique_ptr<ServerProcess>> ServerProcess::StartSink() {
  absl::StatusOr<child::TemporaryFolder> folder = child::TemporaryFolder::Make("voxel-bench");
  if (!folder.ok()) return folder.status();
  std::unique_ptr<ServerProcess> server(new ServerProcess(*std::move(folder)));
  const std::string& path = server->folder_.path();
  server->unix_target_ = absl::StrCat("unix:", path, "/sink.sock");
  absl::StatusOr<std::unique_ptr<child::ChildProcess>> process = child::ChildProcess::Start(
      {child::ProgramBeside("voxel-bench"), "sink", "--listen", server->unix_target_, "--listen",
       kAnyPort},
      {.environment = child::CleanEnvironment(path), .errors = child::Errors::kInherited});
  if (!process.ok()) return process.status();
  server->process_ = *std::move(process);
  const std::optional<std::string> ready = server->process_->ReadLineWith("ready ");
  if (!ready.has_value()) return NotReady("the bare sink", *server->process_);
  server->tcp_target_ = ready->substr(ready->rfind(' ') + 1);
  return server;
}

absl::StatusOr<uint64_t> ServerProcess::ResidentBytes() const {
  const uint64_t bytes =
      StatusBytes(FileText(absl::StrCat("/proc/", process_->pid(), "/status")), "VmRSS");
  if (bytes == 0) return absl::UnavailableError("the daemon has ended");
  return bytes;
}

absl::StatusOr<int64_t> ServerProcess::ProcessorNs() const {
  // The text is "PID (NAME) S …": after the name, user and system time are the 12th and 13th
  // fields.
  const std::string text = FileText(absl::StrCat("/proc/", process_->pid(), "/stat"));
  const std::vector<std::string> fields =
      absl::StrSplit(text.substr(std::min(text.size(), text.rfind(')') + 2)), ' ');
  int64_t user = 0, system = 0;
  if (fields.size() < 13 || !absl::SimpleAtoi(fields[11], &user) ||
      !absl::SimpleAtoi(fields[12], &system)) {
    return absl::UnavailableError("the daemon has ended");
  }
  return (user + system) * (1'000'000'000 / sysconf(_SC_CLK_TCK));
}

std::string RoomFor(int clients) {
  const int room = clients + 64;
  return absl::StrCat("[server]\nmax_connections = ", room,
                      "\nmax_connections_per_address = ", room, "\n[limits]\nmax_sessions = ", room,
                      "\n");
}

uint64_t StatusBytes(const std::string& text, const std::string& name) {
  for (absl::string_view line : absl::StrSplit(text, '\n')) {
    if (!absl::ConsumePrefix(&line, absl::StrCat(name, ":"))) continue;
    absl::ConsumeSuffix(&line, " kB");
    uint64_t kilobytes = 0;
    if (absl::SimpleAtoi(line, &kilobytes)) return kilobytes * 1024;
  }
  return 0;
}

}  // namespace voxeld::bench
