# SPDX-License-Identifier: Apache-2.0
# cpack: Debian packages of the two libraries, one for those who compile against them, and an archive of all.
set(CPACK_GENERATOR DEB TGZ)
set(CPACK_PACKAGE_VENDOR "The activestereo authors")
set(CPACK_PACKAGE_CONTACT "The activestereo authors <activestereo@localhost>")
set(CPACK_RESOURCE_FILE_LICENSE ${PROJECT_SOURCE_DIR}/LICENSE)
set(CPACK_STRIP_FILES ON)
set(CPACK_COMPONENTS_ALL kuafu simsense dev)
set(CPACK_COMPONENTS_GROUPING IGNORE)

set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_ARCHIVE_COMPONENT_INSTALL OFF)
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_PACKAGE_GENERATE_SHLIBS ON)  # and the trigger that runs ldconfig
set(CPACK_DEBIAN_KUAFU_PACKAGE_NAME libkuafu0)
set(CPACK_DEBIAN_KUAFU_PACKAGE_SECTION libs)
set(CPACK_DEBIAN_KUAFU_PACKAGE_DEPENDS libvulkan1)  # opened at run time, so dpkg-shlibdeps does not see it; nor Embree, where that is opened
if(NOT KUAFU_STATIC_EMBREE)
  string(PREPEND CPACK_DEBIAN_KUAFU_PACKAGE_DEPENDS "libembree3-3, ")
endif()
set(CPACK_DEBIAN_SIMSENSE_PACKAGE_NAME libsimsense0)
set(CPACK_DEBIAN_SIMSENSE_PACKAGE_SECTION libs)
set(CPACK_DEBIAN_SIMSENSE_PACKAGE_RECOMMENDS libvulkan1)
set(CPACK_DEBIAN_DEV_PACKAGE_NAME libactivestereo-dev)
set(CPACK_DEBIAN_DEV_PACKAGE_SECTION libdevel)
set(CPACK_DEBIAN_DEV_PACKAGE_DEPENDS "libkuafu0 (= ${PROJECT_VERSION}), libsimsense0 (= ${PROJECT_VERSION})")
include(CPack)
