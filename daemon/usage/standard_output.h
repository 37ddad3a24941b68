// Checks that a program's standard output was written.
#pragma once

namespace voxeld::usage {

// Flushes standard output, of C and of C++. Returns: `exit_code`; if output was lost and
// `exit_code` is 0, prints an error to standard error and returns 1. A closed pipe, as from `head`,
// is not an error. Call it last.
int CheckedExit(const char* program, int exit_code);

}  // namespace voxeld::usage
