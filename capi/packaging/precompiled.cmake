# SPDX-License-Identifier: Apache-2.0
# ks_precompile(target headers...): the standard library's headers that most sources include, and those given, are read once for the target; a
# compiler spends two thirds of a small source's time on them. ks_precompiled_by(target other): the target takes what the other has read.
# With ccache nothing is precompiled: it would keep less, and so each source is seen to include what it uses.
if(CMAKE_CXX_COMPILER_LAUNCHER MATCHES "ccache$")
  set(CMAKE_DISABLE_PRECOMPILE_HEADERS ON)
endif()

function(ks_precompile target)
  target_precompile_headers(${target} PRIVATE <algorithm> <array> <chrono> <cmath> <cstring> <functional> <limits> <map> <memory> <mutex>
                            <optional> <span> <string> <vector> ${ARGN})
endfunction()

function(ks_precompiled_by target other)
  target_precompile_headers(${target} REUSE_FROM ${other})
endfunction()
