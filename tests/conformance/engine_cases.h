// Every engine that must pass the conformance suite. The suite is compiled once; a program that runs it is linked with one of
// engines_*.cc, which says which engines are its own.
#pragma once

#include <string>
#include <vector>

#include "tests/conformance/engine_driver.h"

namespace voxeld::gpu::conformance {

// Of CreateEngine; with `in_worker` in a process of its own.
inline EngineCase CaseOf(const char* name, EngineKind kind, bool in_worker,
                         const std::vector<int>& devices = {}) {
  return {name, [kind, in_worker, devices](EngineOptions options) {
            options.kind = kind;
            options.in_worker = in_worker;
            options.worker_deadline_ns =
                int64_t{60} * 1'000'000'000;  // of a slow machine, or a sanitizer
            options.devices = devices;
            return CreateEngine(options);
          }};
}

// This program's engines, one line each.
std::vector<EngineCase> EngineCases();

}  // namespace voxeld::gpu::conformance
