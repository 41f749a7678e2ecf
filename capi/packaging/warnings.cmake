# SPDX-License-Identifier: Apache-2.0
# Every target of ours is compiled with these; third-party headers are SYSTEM.
add_library(ks_warnings INTERFACE)
target_compile_options(ks_warnings INTERFACE -Wall -Wextra -Werror $<$<COMPILE_LANGUAGE:CXX>:-Wno-missing-field-initializers>)
if(ACTIVESTEREO_SANITIZE)
  add_compile_options(-fsanitize=${ACTIVESTEREO_SANITIZE} -fno-omit-frame-pointer -g1)
  add_link_options(-fsanitize=${ACTIVESTEREO_SANITIZE})
  # Instrumented code makes GCC warn of what is not there (the manual's page on -fsanitize says so): the uninstrumented build has -Werror.
  target_compile_options(ks_warnings INTERFACE -Wno-error)
endif()
