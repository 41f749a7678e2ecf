# SPDX-License-Identifier: Apache-2.0
# ks_install_library(name description): what a program links against, in the build tree, in an installed tree and by add_subdirectory, is the same
# target <name>::<name>. Everything written is relative to where it lies, so that an installed tree can be moved.
# Components: <name> is the shared library, dev is headers, CMake packages and pkg-config files of both.
include(CMakePackageConfigHelpers)
include(GNUInstallDirs)

set(ks_cmake_dir ${CMAKE_CURRENT_LIST_DIR})

# ks_debian_package(out library): the package of a shared library is named after its SONAME (Debian policy, 8.1).
function(ks_debian_package out library)
  get_target_property(version ${library} SOVERSION)
  set(${out} lib${library}${version} PARENT_SCOPE)
endfunction()

function(ks_install_licence package component)
  set(destination ${CMAKE_INSTALL_DATAROOTDIR}/doc/${package})
  install(FILES ${PROJECT_SOURCE_DIR}/LICENSE DESTINATION ${destination} COMPONENT ${component} RENAME copyright)
  install(FILES ${PROJECT_SOURCE_DIR}/NOTICE DESTINATION ${destination} COMPONENT ${component})
endfunction()

function(ks_install_library name description)
  add_library(${name}::${name} ALIAS ${name})
  target_include_directories(${name} PUBLIC $<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}/capi/include> $<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}>)
  if(NOT ACTIVESTEREO_INSTALL)
    return()
  endif()
  ks_debian_package(package ${name})
  ks_install_licence(${package} ${name})
  set(package_dir ${CMAKE_INSTALL_LIBDIR}/cmake/${name})
  set(generated ${CMAKE_CURRENT_BINARY_DIR}/package)
  install(TARGETS ${name} EXPORT ${name}
          LIBRARY DESTINATION ${CMAKE_INSTALL_LIBDIR} COMPONENT ${name} NAMELINK_COMPONENT dev)
  install(EXPORT ${name} NAMESPACE ${name}:: FILE ${name}-targets.cmake DESTINATION ${package_dir} COMPONENT dev)
  configure_package_config_file(${ks_cmake_dir}/package-config.cmake.in ${generated}/${name}-config.cmake INSTALL_DESTINATION ${package_dir})
  write_basic_package_version_file(${generated}/${name}-config-version.cmake COMPATIBILITY SameMinorVersion)
  install(FILES ${generated}/${name}-config.cmake ${generated}/${name}-config-version.cmake DESTINATION ${package_dir} COMPONENT dev)
  file(RELATIVE_PATH pkgconfig_to_prefix /${CMAKE_INSTALL_LIBDIR}/pkgconfig /)
  configure_file(${ks_cmake_dir}/package.pc.in ${generated}/${name}.pc @ONLY)
  install(FILES ${generated}/${name}.pc DESTINATION ${CMAKE_INSTALL_LIBDIR}/pkgconfig COMPONENT dev)
  install(DIRECTORY ${PROJECT_SOURCE_DIR}/capi/include/${name} DESTINATION ${CMAKE_INSTALL_INCLUDEDIR} COMPONENT dev)
endfunction()

if(ACTIVESTEREO_INSTALL)
  ks_install_licence(libactivestereo-dev dev)
  install(DIRECTORY ${PROJECT_SOURCE_DIR}/capi/include/ks DESTINATION ${CMAKE_INSTALL_INCLUDEDIR} COMPONENT dev)
  install(DIRECTORY ${KS_GENERATED}/clients/ DESTINATION ${CMAKE_INSTALL_DATAROOTDIR}/activestereo COMPONENT dev)
endif()
