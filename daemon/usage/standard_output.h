// Whether what a program wrote to its standard output has arrived.
#pragma once

namespace voxeld::usage {

// Flushes standard output, of C and of C++. Returns: `exit_code`; if output was lost and `exit_code` is 0, 1, having said so on standard
// error. A reader that went away, as `head` does, is no error. Call it last.
int CheckedExit(const char* program, int exit_code);

}  // namespace voxeld::usage
