#include "tools/voxelctl/import/sandbox.h"

#include <fcntl.h>
#include <linux/landlock.h>
#include <linux/seccomp.h>
#include <sched.h>
#include <seccomp.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <cerrno>
#include <cstdint>
#include <cstring>
#include <vector>

#include "absl/strings/str_cat.h"
#include "daemon/address/descriptor.h"

namespace voxeld::voxelctl {
namespace {

// The rights of each version of Landlock; the headers may be older than the kernel.
constexpr uint64_t kFirstRights = (LANDLOCK_ACCESS_FS_MAKE_SYM << 1) - 1;
constexpr uint64_t kRefer = uint64_t{1} << 13, kTruncate = uint64_t{1} << 14,
                   kIoctl = uint64_t{1} << 15;

long LandlockVersion() {
  return ::syscall(SYS_landlock_create_ruleset, nullptr, 0, LANDLOCK_CREATE_RULESET_VERSION);
}

absl::Status NoLandlock(int error) {
  return absl::UnavailableError(absl::StrCat(
      "this system cannot confine a process to files (Landlock: ", std::strerror(error), ")"));
}

// Returns false, with errno, if `path`, or files below it, cannot be allowed.
bool AllowReading(const daemon::Descriptor& rules, const std::string& path) {
  const daemon::Descriptor folder(::open(path.c_str(), O_PATH | O_CLOEXEC));
  landlock_path_beneath_attr below = {};
  struct stat info {};
  const bool directory = folder.ok() && ::fstat(folder.get(), &info) == 0 && S_ISDIR(info.st_mode);
  below.allowed_access =
      LANDLOCK_ACCESS_FS_READ_FILE | (directory ? LANDLOCK_ACCESS_FS_READ_DIR : 0);
  below.parent_fd = folder.get();
  return folder.ok() &&
         ::syscall(SYS_landlock_add_rule, rules.get(), LANDLOCK_RULE_PATH_BENEATH, &below, 0) == 0;
}

absl::Status ConfineFiles(const std::string& readable, const std::vector<std::string>& more) {
  const long version = LandlockVersion();
  if (version < 1) return NoLandlock(errno);
  landlock_ruleset_attr rights = {};
  rights.handled_access_fs = kFirstRights | (version >= 2 ? kRefer : 0) |
                             (version >= 3 ? kTruncate : 0) | (version >= 5 ? kIoctl : 0);
  const daemon::Descriptor rules(
      static_cast<int>(::syscall(SYS_landlock_create_ruleset, &rights, sizeof(rights), 0)));
  if (!rules.ok()) return NoLandlock(errno);
  if (!readable.empty() && !AllowReading(rules, readable)) return NoLandlock(errno);
  // On failure it stays inaccessible.
  for (const std::string& path : more) (void)AllowReading(rules, path);
  if (::syscall(SYS_landlock_restrict_self, rules.get(), 0) != 0) return NoLandlock(errno);
  return absl::OkStatus();
}

// Calls that reading needs, and that the C library makes for it. All others fail with EPERM.
constexpr int kCalls[] = {
    // Memory.
    SCMP_SYS(brk), SCMP_SYS(madvise), SCMP_SYS(mmap), SCMP_SYS(mprotect), SCMP_SYS(mremap),
    SCMP_SYS(munmap),
    // Open files, and opening files to read (restricted by Landlock).
    SCMP_SYS(access), SCMP_SYS(close), SCMP_SYS(faccessat), SCMP_SYS(faccessat2), SCMP_SYS(fstat),
    SCMP_SYS(fstatfs), SCMP_SYS(getcwd), SCMP_SYS(getdents64), SCMP_SYS(lseek), SCMP_SYS(lstat),
    SCMP_SYS(newfstatat), SCMP_SYS(openat2), SCMP_SYS(pread64), SCMP_SYS(read), SCMP_SYS(readlink),
    SCMP_SYS(readlinkat), SCMP_SYS(readv), SCMP_SYS(stat), SCMP_SYS(statx), SCMP_SYS(write),
    SCMP_SYS(writev),
    // Time and waiting.
    SCMP_SYS(clock_getres), SCMP_SYS(clock_gettime), SCMP_SYS(clock_nanosleep), SCMP_SYS(futex),
    SCMP_SYS(gettimeofday), SCMP_SYS(nanosleep), SCMP_SYS(sched_yield), SCMP_SYS(time),
    // Exiting. Without kill and tgkill, abort() ends by a fault.
    SCMP_SYS(exit), SCMP_SYS(exit_group), SCMP_SYS(restart_syscall), SCMP_SYS(rt_sigaction),
    SCMP_SYS(rt_sigprocmask), SCMP_SYS(rt_sigreturn), SCMP_SYS(sigaltstack),
    // Queries about the process itself.
    SCMP_SYS(getpid), SCMP_SYS(getrandom), SCMP_SYS(getrusage), SCMP_SYS(gettid),
    SCMP_SYS(sched_getaffinity), SCMP_SYS(sysinfo), SCMP_SYS(uname),
    // Threads (for starting one, see below).
    SCMP_SYS(rseq), SCMP_SYS(set_robust_list)};

// Returns: the filter in the kernel's form; empty if it could not be made.
std::vector<sock_filter> MakeFilter() {
  const scmp_filter_ctx filter = seccomp_init(SCMP_ACT_ERRNO(EPERM));
  if (filter == nullptr) return {};
  int error = 0;
  for (const int call : kCalls) {
    if (error == 0) error = seccomp_rule_add(filter, SCMP_ACT_ALLOW, call, 0);
  }
  // Files are opened only for reading, even without Landlock (openat2 is then left to it).
  constexpr scmp_datum_t kWrites = O_ACCMODE | O_CREAT | O_TRUNC;
  if (error == 0) {
    error = seccomp_rule_add(filter, SCMP_ACT_ALLOW, SCMP_SYS(open), 1,
                             SCMP_A1(SCMP_CMP_MASKED_EQ, kWrites, O_RDONLY));
  }
  if (error == 0) {
    error = seccomp_rule_add(filter, SCMP_ACT_ALLOW, SCMP_SYS(openat), 1,
                             SCMP_A2(SCMP_CMP_MASKED_EQ, kWrites, O_RDONLY));
  }
  // Allows threads, which are as confined as this one, but not processes. The flags of clone3
  // cannot be inspected; the C library uses clone if clone3 is missing.
  if (error == 0) {
    error = seccomp_rule_add(filter, SCMP_ACT_ALLOW, SCMP_SYS(clone), 1,
                             SCMP_A0(SCMP_CMP_MASKED_EQ, CLONE_THREAD, CLONE_THREAD));
  }
  if (error == 0) error = seccomp_rule_add(filter, SCMP_ACT_ERRNO(ENOSYS), SCMP_SYS(clone3), 0);
  // Excludes those with which the kernel would signal other processes.
  for (const scmp_datum_t command : {F_GETFD, F_SETFD, F_GETFL, F_DUPFD_CLOEXEC}) {
    if (error == 0) {
      error = seccomp_rule_add(filter, SCMP_ACT_ALLOW, SCMP_SYS(fcntl), 1,
                               SCMP_A1(SCMP_CMP_EQ, command));
    }
  }
  const daemon::Descriptor file(::memfd_create("voxelctl-filter", MFD_CLOEXEC));
  if (error == 0) error = seccomp_export_bpf(filter, file.get());
  seccomp_release(filter);
  const off_t size = ::lseek(file.get(), 0, SEEK_END);
  if (error != 0 || size <= 0) return {};
  std::vector<sock_filter> program(static_cast<size_t>(size) / sizeof(sock_filter));
  if (::pread(file.get(), program.data(), static_cast<size_t>(size), 0) != size) return {};
  return program;
}

}  // namespace

const Sandbox& Sandbox::Get() {
  static const Sandbox sandbox;
  return sandbox;
}

Sandbox::Sandbox() : filter_(MakeFilter()) {}

absl::Status Sandbox::CheckLandlock() const {
  return LandlockVersion() < 1 ? NoLandlock(errno) : absl::OkStatus();
}

absl::Status Sandbox::Enter(const std::string& readable,
                            const std::vector<std::string>& more) const {
  ::prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0);
  absl::Status status = ConfineFiles(readable, more);
  const sock_fprog program = {static_cast<unsigned short>(filter_.size()),
                              const_cast<sock_filter*>(filter_.data())};
  if (filter_.empty() || ::prctl(PR_SET_SECCOMP, SECCOMP_MODE_FILTER, &program, 0, 0) != 0) {
    status.Update(
        absl::UnavailableError("this system cannot confine a process to calls (seccomp)"));
  }
  return status;
}

}  // namespace voxeld::voxelctl
