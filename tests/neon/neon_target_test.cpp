// SPDX-License-Identifier: Apache-2.0
// What the cross-built tests exercise is ARM's vectors, not a scalar substitute.
#include <gtest/gtest.h>
#include <hwy/targets.h>

TEST(neon, is_what_the_dispatch_chooses) {
  const auto targets = hwy::SupportedAndGeneratedTargets();
  ASSERT_FALSE(targets.empty());
  EXPECT_STREQ(hwy::TargetName(targets.front()), "NEON");
}
