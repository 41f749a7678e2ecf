# SPDX-License-Identifier: Apache-2.0
# ks_precompile(target headers...): the standard library's headers that most sources include, and those given, are read once for the target; a
# compiler spends two thirds of a small source's time on them. ks_precompiled_by(target other): the target takes what the other has read.
# With ACTIVESTEREO_UNITY several sources are compiled as one besides, in half the time. With ccache nothing is precompiled and each source is on its
# own: the cache would keep less, and so each source is seen to include what it uses.
if(CMAKE_CXX_COMPILER_LAUNCHER MATCHES "ccache$")
  set(CMAKE_DISABLE_PRECOMPILE_HEADERS ON)
  set(ACTIVESTEREO_UNITY OFF)
endif()

function(ks_unite target)
  set_target_properties(${target} PROPERTIES UNITY_BUILD ${ACTIVESTEREO_UNITY} UNITY_BUILD_BATCH_SIZE 12)
  if(ACTIVESTEREO_UNITY)
    target_compile_options(${target} PRIVATE -Wno-subobject-linkage)  # a class of one source that holds another of it
  endif()
endfunction()

function(ks_precompile target)
  target_precompile_headers(${target} PRIVATE <algorithm> <array> <chrono> <cmath> <cstring> <functional> <limits> <map> <memory> <mutex>
                            <optional> <span> <string> <vector> ${ARGN})
  ks_unite(${target})
endfunction()

function(ks_precompiled_by target other)
  target_precompile_headers(${target} REUSE_FROM ${other})
  ks_unite(${target})
endfunction()
