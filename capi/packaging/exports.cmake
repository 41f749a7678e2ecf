# SPDX-License-Identifier: Apache-2.0
# ks_export_only(target map): the shared library exports the symbols of the map and nothing else, and resolves everything at link time.
function(ks_export_only target map)
  target_link_options(${target} PRIVATE -Wl,--version-script=${map} -Wl,--no-undefined -Wl,--exclude-libs,ALL)
  set_target_properties(${target} PROPERTIES LINK_DEPENDS ${map})
endfunction()
