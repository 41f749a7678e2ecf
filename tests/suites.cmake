# SPDX-License-Identifier: Apache-2.0
# cmake -DPROGRAM=... -DSUITES=... -P suites.cmake writes a test of ctest's for each suite of a GoogleTest program: kuafu_laws.Glass.
execute_process(COMMAND ${PROGRAM} --gtest_list_tests OUTPUT_VARIABLE listed COMMAND_ERROR_IS_FATAL ANY)
string(REGEX MATCHALL "\n[^ \n]+\\." names "\n${listed}")
get_filename_component(program ${PROGRAM} NAME)
string(REGEX REPLACE "_tests$" "" program ${program})
set(tests "")
foreach(name IN LISTS names)
  string(REGEX REPLACE "[\n.]" "" suite ${name})
  string(APPEND tests "add_test(\"${program}.${suite}\" \"${PROGRAM}\" \"--gtest_filter=${suite}.*\")\n")
endforeach()
file(WRITE ${SUITES} "${tests}")
