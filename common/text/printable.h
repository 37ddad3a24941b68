// Escapes untrusted text for output: on a terminal, between quotes in a message, in JSON.
//
// Harmful characters are C0 and C1 controls, DEL, line and paragraph separators (U+2028, U+2029), and the invisible marks that
// change the direction of writing or have no width.
#pragma once

#include <string>

#include "absl/strings/string_view.h"

namespace voxeld {

// Returns: `text` with harmful characters as \u{N}, bytes that are not UTF-8 as \xNN, and each backslash doubled. The result
// cannot move the cursor or set the window title.
std::string EscapeForTerminal(absl::string_view text);

// Returns: `text` with C0 controls, DEL and bytes that are not UTF-8 as \xNN, and other harmful characters as \u{N}. Idempotent:
// code that builds or prints a message may apply it again.
std::string EscapeControls(absl::string_view text);

// Returns: as EscapeControls, but line feeds stay: for text of several lines.
std::string EscapeLines(absl::string_view text);

// Returns: `text` for a place between double quotes: as EscapeForTerminal does, but quotes, C0 controls and DEL are
// escaped as in C: \", \n, \r, \t, \xNN.
std::string EscapeQuoted(absl::string_view text);

// Requires: `json` is JSON text, in which C0 controls are escaped already. Returns: the same document, with its other harmful
// characters as \uNNNN.
std::string EscapeJson(absl::string_view json);

// Returns: whether all of `text` is UTF-8, as protobuf's strings must be.
bool IsUtf8(absl::string_view text);

}  // namespace voxeld
