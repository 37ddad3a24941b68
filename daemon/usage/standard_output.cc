#include "daemon/usage/standard_output.h"

#include <poll.h>
#include <unistd.h>

#include <cstdio>
#include <iostream>

namespace voxeld::usage {
namespace {

// Returns: true if the reader of a pipe or socket has closed it.
bool ReaderIsGone() {
  pollfd output = {STDOUT_FILENO, 0, 0};
  return ::poll(&output, 1, 0) > 0 && (output.revents & (POLLERR | POLLHUP)) != 0;
}

}  // namespace

int CheckedExit(const char* program, int exit_code) {
  const bool lost =
      std::fflush(stdout) != 0 || std::ferror(stdout) != 0 || !std::cout.flush().good();
  if (!lost || exit_code != 0 || ReaderIsGone()) return exit_code;
  std::fprintf(
      stderr,
      "%s: standard output could not be written; is it closed, or is there no space left?\n",
      program);
  return 1;
}

}  // namespace voxeld::usage
