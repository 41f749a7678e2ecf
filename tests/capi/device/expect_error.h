// SPDX-License-Identifier: Apache-2.0
// EXPECT_ERROR: the statement throws ks::Error with this status and a text that contains this part.
#pragma once

#include <gtest/gtest.h>

#include "device/error.h"

#define EXPECT_ERROR(statement, expected_status, part)                       \
  do {                                                                       \
    try {                                                                    \
      (void)(statement);                                                     \
      ADD_FAILURE() << "no error thrown by " #statement;                     \
    } catch (const ks::Error& error) {                                       \
      EXPECT_EQ(error.status(), expected_status) << error.what();            \
      EXPECT_NE(std::string(error.what()).find(part), std::string::npos)     \
          << "'" << error.what() << "' does not contain '" << (part) << "'"; \
    }                                                                        \
  } while (false)
