#include "tests/e2e/process.h"

#include <gtest/gtest.h>

#include <cstdlib>
#include <iostream>
#include <utility>

namespace voxeld::e2e {

Process::Process(const std::vector<std::string>& arguments,
                 const std::map<std::string, std::string>& environment) {
  auto child =
      child::ChildProcess::Start(arguments, {.environment = environment, .patience = kPatience});
  if (!child.ok()) {  // nothing after this could mean anything
    std::cerr << child.status() << "\n";
    std::abort();
  }
  child_ = *std::move(child);
}

Ended RunToEnd(const std::vector<std::string>& arguments,
               const std::map<std::string, std::string>& environment) {
  Process process(arguments, environment);
  const std::optional<int> code = process.Wait();
  EXPECT_TRUE(code.has_value()) << "did not exit: " << process.output();
  return {code.value_or(-1), process.output()};
}

}  // namespace voxeld::e2e
