// The engines that must pass the conformance suite. The suite is compiled once; a program that runs
// it is linked with one of engines_*.cc, which defines its engines.
#pragma once

#include <string>
#include <vector>

#include "tests/conformance/engine_driver.h"

namespace voxeld::gpu::conformance {

// Returns a case that uses CreateEngine; with `in_worker`, in a process of its own.
inline EngineCase CaseOf(const char* name, EngineKind kind, bool in_worker,
                         const std::vector<int>& devices = {}) {
  return {name, [kind, in_worker, devices](EngineOptions options) {
            options.kind = kind;
            options.in_worker = in_worker;
            options.worker_deadline_ns =
                int64_t{60} * 1'000'000'000;  // enough for a slow machine, or a sanitizer
            options.devices = devices;
            return CreateEngine(options);
          }};
}

// Returns this program's engines, one line each.
std::vector<EngineCase> EngineCases();

}  // namespace voxeld::gpu::conformance
