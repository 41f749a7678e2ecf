# SPDX-License-Identifier: Apache-2.0
# What follows from the tables of the public structs (capi/generation) and only the build needs is written here while CMake runs, and again where a table,
# a header or the generator has changed. Folders are those of the source tree.
set(KS_GENERATED ${PROJECT_BINARY_DIR}/generated)
set(capi ${CMAKE_CURRENT_LIST_DIR}/..)
function(ks_reads_toml valid python)
  execute_process(COMMAND ${python} -c "import tomllib" RESULT_VARIABLE failed OUTPUT_QUIET ERROR_QUIET)
  if(failed)
    set(${valid} FALSE PARENT_SCOPE)
  endif()
endfunction()
find_program(KS_GENERATOR_PYTHON NAMES python3 python3.11 python3.12 python3.13 PATHS /usr/bin VALIDATOR ks_reads_toml REQUIRED
             DOC "Python 3.11 or newer, which writes sources from tables")
file(GLOB generator CONFIGURE_DEPENDS ${capi}/generation/*.py ${capi}/generation/tables/*.toml
     ${capi}/include/*/*.h ${capi}/../python/*/*.pyi.in)
set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS ${generator})
execute_process(COMMAND ${KS_GENERATOR_PYTHON} -B ${capi}/generation/generate.py --build ${KS_GENERATED}
                OUTPUT_QUIET COMMAND_ERROR_IS_FATAL ANY)
