// SPDX-License-Identifier: Apache-2.0
// Tests that need what this machine lacks say so and are skipped.
#pragma once

#include <gtest/gtest.h>

#include <string>

namespace ks_test {

/// For constructors of fixtures: the test's body is not run then.
inline void skip(const std::string& why) { GTEST_SKIP() << why; }

}  // namespace ks_test

/// In a test's body. why_not: a std::string, empty where nothing is against it.
#define SKIP_IF(why_not) \
  if (const std::string why = why_not; !why.empty()) GTEST_SKIP() << why
