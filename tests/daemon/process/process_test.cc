// Tests the message of a daemon that cannot start because the system refuses something.
#include "daemon/process/process.h"

#include <gmock/gmock.h>

#include <new>
#include <stdexcept>
#include <system_error>

namespace voxeld::daemon {
namespace {

using ::testing::HasSubstr;

TEST(WhyItEnds, NamesTheLimitToLookAt) {
  EXPECT_THAT(WhyItEnds(std::system_error(EAGAIN, std::generic_category())),
              HasSubstr("no more threads (Resource temporarily unavailable): allow it more of them "
                        "(TasksMax, LimitNPROC"));
  EXPECT_THAT(WhyItEnds(std::system_error(EAGAIN, std::system_category())),
              HasSubstr("no more threads"));
  EXPECT_THAT(WhyItEnds(std::system_error(EMFILE, std::generic_category())),
              HasSubstr("no more descriptors (Too many open files): allow it more of them "
                        "(LimitNOFILE"));
  EXPECT_THAT(WhyItEnds(std::bad_alloc()), HasSubstr("no memory (std::bad_alloc)"));
}

TEST(WhyItEnds, OthersSpeakForThemselves) {
  EXPECT_EQ(WhyItEnds(std::runtime_error("odd")), "odd");
  EXPECT_THAT(WhyItEnds(std::system_error(ENOENT, std::generic_category(), "there")),
              HasSubstr("there: No such file"));
}

}  // namespace
}  // namespace voxeld::daemon
