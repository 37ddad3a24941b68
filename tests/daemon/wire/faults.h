// Valid primitives, each with one fault: the error for each.
#pragma once

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>
#include <span>

#include "daemon/wire/primitive.h"
#include "voxeld/v1/primitives.pb.h"

namespace voxeld::daemon::wire {

struct FaultCase {
  const char* name;
  v1::Primitive (*good)();
  std::function<void(v1::Primitive&)> spoil;
  const char* field;
  Reason reason;
  const char* message;  // a part of the error message
};

// fault_of(primitive, content) returns the decoder's error.
template <typename FaultOf>
void ExpectFaults(std::span<const FaultCase> cases, FaultOf&& fault_of) {
  for (const FaultCase& c : cases) {
    SCOPED_TRACE(c.name);
    Content content;
    ASSERT_FALSE(fault_of(c.good(), &content).has_value());
    v1::Primitive spoilt = c.good();
    c.spoil(spoilt);
    const MaybeFault fault = fault_of(spoilt, &content);
    ASSERT_TRUE(fault.has_value());
    EXPECT_EQ(fault->field, c.field);
    EXPECT_EQ(fault->reason, c.reason) << fault->message;
    EXPECT_THAT(fault->message, ::testing::HasSubstr(c.message));
  }
}

inline void Set(v1::Vec3* out, double x, double y, double z) {
  out->set_x(x);
  out->set_y(y);
  out->set_z(z);
}

}  // namespace voxeld::daemon::wire
