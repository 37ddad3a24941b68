// Shared by all examples: the first argument is an address, and the returned status ends the
// program.
#pragma once

#include <cstdio>
#include <string>

#include "absl/status/status.h"
#include "voxeld/client.h"

// `address` is the server's address; empty: the default.
inline int RunExample(int argc, char** argv, absl::Status (*run)(const std::string& address)) {
  std::setvbuf(stdout, nullptr, _IOLBF, 0);
  const absl::Status status = run(argc > 1 ? argv[1] : "");
  if (status.ok()) return 0;
  std::fprintf(stderr, "%s: %s\n", argv[0], std::string(status.message()).c_str());
  return 1;
}

// Returns one word for the outcome of a commit.
inline const char* Word(voxeld::client::Outcome::Kind kind) {
  using Kind = voxeld::client::Outcome::Kind;
  switch (kind) {
    case Kind::kPresented:
      return "presented";
    case Kind::kUnchanged:
      return "unchanged";
    case Kind::kSuperseded:
      return "superseded";
    case Kind::kLost:
      return "lost";
    case Kind::kNotShown:
      return "not shown";
  }
  return "";
}
