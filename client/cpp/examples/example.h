// What all examples share: an address as their first argument, and a status as their end.
#pragma once

#include <cstdio>
#include <string>

#include "absl/status/status.h"
#include "voxeld/client.h"

// The address is that of the server; empty: the default one.
inline int RunExample(int argc, char** argv, absl::Status (*run)(const std::string& address)) {
  std::setvbuf(stdout, nullptr, _IOLBF, 0);
  const absl::Status status = run(argc > 1 ? argv[1] : "");
  if (status.ok()) return 0;
  std::fprintf(stderr, "%s: %s\n", argv[0], std::string(status.message()).c_str());
  return 1;
}

// One word for what became of a commit.
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
