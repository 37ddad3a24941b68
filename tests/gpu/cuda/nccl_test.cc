// Tests finding and calling NCCL's library, with a library of the tests in its place.
#include "gpu/cuda/nccl.h"

#include <dlfcn.h>
#include <gmock/gmock.h>

#include <cstdlib>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "tests/programs.h"

namespace voxeld::gpu::cuda {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

std::string Fake() { return ProgramBeside("libfake_nccl.so"); }

std::function<std::string(const char*)> Environment(std::map<std::string, std::string> values) {
  return [values = std::move(values)](const char* name) {
    const auto it = values.find(name);
    return it == values.end() ? "" : it->second;
  };
}

class NcclTest : public ::testing::Test {
 protected:
  NcclTest() {
    unsetenv("VOXELD_FAKE_NCCL_FAILS");
    library_ = dlopen(Fake().c_str(), RTLD_NOW | RTLD_LOCAL);
    EXPECT_NE(library_, nullptr) << dlerror();
    Log();
  }
  ~NcclTest() override {
    unsetenv("VOXELD_FAKE_NCCL_FAILS");
    dlclose(library_);
  }
  // Returns the calls since the last query.
  std::string Log() const {
    return reinterpret_cast<const char* (*)()>(dlsym(library_, "FakeNcclLog"))();
  }
  static std::shared_ptr<const Nccl> Open() {
    auto nccl = Nccl::Open(std::vector<std::string>{Fake()});
    EXPECT_TRUE(nccl.ok()) << nccl.status();
    return *nccl;
  }
  static void Fail(const char* name) { setenv("VOXELD_FAKE_NCCL_FAILS", name, 1); }

  void* library_ = nullptr;
};

TEST_F(NcclTest, IsLookedForByTheOptionThenTheVariableThenTheLoader) {
  EXPECT_THAT(Nccl::Places("/a", Environment({{"VOXELD_NCCL", "/b"}})),
              ElementsAre("/a", "/b", "libnccl.so.2", "libnccl.so"));
  EXPECT_THAT(Nccl::Places("", Environment({})), ElementsAre("libnccl.so.2", "libnccl.so"));
}

TEST_F(NcclTest, ThatIsNowhereNamesAllPlacesThatWereTried) {
  const absl::Status status =
      Nccl::Open(std::vector<std::string>{"/nowhere/libnccl.so.2", "libnowhere-nccl.so"}).status();
  EXPECT_EQ(status.code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_THAT(status.message(), AllOf(HasSubstr("/nowhere/libnccl.so.2: cannot open"),
                                      HasSubstr("libnowhere-nccl.so: cannot open")));
}

TEST_F(NcclTest, ALibraryThatIsNotNcclSaysWhatItLacks) {
  const absl::Status status = Nccl::Open(std::vector<std::string>{"libm.so.6"}).status();
  EXPECT_EQ(status.code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_THAT(status.message(), HasSubstr("libm.so.6: has no ncclGetVersion"));
}

TEST_F(NcclTest, TheNextPlaceIsTriedAfterOneThatDoesNotServe) {
  const auto nccl = Nccl::Open({"/nowhere/libnccl.so.2", "libm.so.6", Fake()});
  ASSERT_TRUE(nccl.ok()) << nccl.status();
  EXPECT_EQ((*nccl)->place(), Fake());
  EXPECT_EQ((*nccl)->Version().value_or(""), "2.28.9");
}

TEST_F(NcclTest, ARankMeetsBroadcastsAgreesAndLeavesWithoutWaiting) {
  const std::shared_ptr<const Nccl> nccl = Open();
  const absl::StatusOr<Nccl::Id> id = nccl->MakeId();
  ASSERT_TRUE(id.ok()) << id.status();
  int32_t value = 1;
  char bytes[100];
  {
    auto comm = NcclComm::Join(nccl, *id, 1, 3);
    ASSERT_TRUE(comm.ok()) << comm.status();
    EXPECT_EQ((*comm)->rank(), 1);
    EXPECT_TRUE((*comm)->Broadcast(bytes, sizeof(bytes), nullptr).ok());
    EXPECT_TRUE((*comm)->Least(&value, nullptr).ok());
    EXPECT_TRUE((*comm)->Check().ok());
  }
  // According to nccl.h: ncclUint8 is 1, ncclInt32 2, ncclMin 3.
  EXPECT_EQ(Log(),
            "ncclGetUniqueId() ncclCommInitRank(1 of 3) "
            "ncclBroadcast(100 of type 1 from 0, in place) "
            "ncclAllReduce(1 of type 2 by 3, in place) ncclCommGetAsyncError() ncclCommAbort() ");
}

TEST_F(NcclTest, WhatFailsSaysWhichCallAndWhatNcclCallsIt) {
  const std::shared_ptr<const Nccl> nccl = Open();
  const Nccl::Id id = *nccl->MakeId();
  const auto expect = [](const absl::Status& status, absl::StatusCode code, const char* call) {
    EXPECT_EQ(status.code(), code) << call;
    EXPECT_THAT(status.message(),
                AllOf(HasSubstr(call), HasSubstr("a system error that was asked for")));
  };
  constexpr auto kCannot = absl::StatusCode::kFailedPrecondition;
  constexpr auto kLost = absl::StatusCode::kDataLoss;
  Fail("ncclGetUniqueId");
  expect(nccl->MakeId().status(), kCannot, "ncclGetUniqueId");
  Fail("ncclCommInitRank");
  Log();
  expect(NcclComm::Join(nccl, id, 0, 2).status(), kCannot, "ncclCommInitRank");
  EXPECT_EQ(Log(), "ncclCommInitRank(0 of 2) ") << "there is nothing to abort";
  auto comm = NcclComm::Join(nccl, id, 0, 2);
  EXPECT_FALSE(comm.ok());
  unsetenv("VOXELD_FAKE_NCCL_FAILS");
  comm = NcclComm::Join(nccl, id, 0, 2);
  ASSERT_TRUE(comm.ok());
  int32_t value = 1;
  Fail("ncclBroadcast");
  expect((*comm)->Broadcast(&value, 4, nullptr), kLost, "ncclBroadcast");
  Fail("ncclAllReduce");
  expect((*comm)->Least(&value, nullptr), kLost, "ncclAllReduce");
  Fail("ncclCommGetAsyncError");
  expect((*comm)->Check(), kLost, "NCCL");
}

}  // namespace
}  // namespace voxeld::gpu::cuda
