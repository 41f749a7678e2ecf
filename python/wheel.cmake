# SPDX-License-Identifier: Apache-2.0
# What goes into the wheel besides Python files: each package's module, its library, and under <package>/lib what that library needs and a
# machine without our build packages may lack. The modules look there by DT_RPATH, which, unlike DT_RUNPATH, also holds for what the libraries
# they load ask for. It does not hold for what a library opened at run time asks for (Embree's TBB): each copy also looks beside itself.
find_program(PATCHELF patchelf REQUIRED)
set(ks_on_every_machine "^(libc|libm|libdl|librt|libpthread|libgcc_s|libstdc\\+\\+|ld-linux.*|libvulkan)\\.so")

# ks_wheel_module(library [file ...]): the files are libraries that `library` opens at run time.
function(ks_wheel_module library)
  set_target_properties(_${library} PROPERTIES INSTALL_RPATH "$ORIGIN/lib")
  target_link_options(_${library} PRIVATE -Wl,--disable-new-dtags)
  install(TARGETS _${library} LIBRARY DESTINATION ${library} COMPONENT wheel)
  install(PROGRAMS $<TARGET_FILE:${library}::${library}> DESTINATION ${library}/lib COMPONENT wheel RENAME $<TARGET_SONAME_FILE_NAME:${library}::${library}>)
  install(CODE "
    set(opened \"${ARGN}\")
    file(GET_RUNTIME_DEPENDENCIES LIBRARIES \"$<TARGET_FILE:${library}::${library}>\" \${opened}
         RESOLVED_DEPENDENCIES_VAR found PRE_EXCLUDE_REGEXES \"${ks_on_every_machine}\")
    foreach(file IN LISTS found opened)
      get_filename_component(name \${file} NAME)  # a wheel has no symbolic links: one file, under the name that is asked for
      file(REAL_PATH \${file} real)
      set(copy \${CMAKE_INSTALL_PREFIX}/${library}/lib/\${name})
      file(COPY_FILE \${real} \${copy} ONLY_IF_DIFFERENT)
      execute_process(COMMAND ${PATCHELF} --set-rpath \$ORIGIN \${copy} COMMAND_ERROR_IS_FATAL ANY)
    endforeach()" COMPONENT wheel)
endfunction()

# Programs that kuafu starts to read scene files: beside the library, where it looks first, with what they need.
function(ks_wheel_helper program)
  if(TARGET ${program})
    install(TARGETS ${program} RUNTIME DESTINATION kuafu/lib COMPONENT wheel)
    set(file $<TARGET_FILE:${program}>)
  else()  # of an installed kuafu
    set(file $<TARGET_FILE_DIR:kuafu::kuafu>/kuafu/${program})
    install(PROGRAMS ${file} DESTINATION kuafu/lib COMPONENT wheel)
  endif()
  install(CODE "
    file(GET_RUNTIME_DEPENDENCIES EXECUTABLES \"${file}\" RESOLVED_DEPENDENCIES_VAR found PRE_EXCLUDE_REGEXES \"${ks_on_every_machine}\")
    foreach(library IN LISTS found)
      get_filename_component(name \${library} NAME)
      file(REAL_PATH \${library} real)
      file(COPY_FILE \${real} \${CMAKE_INSTALL_PREFIX}/kuafu/lib/\${name} ONLY_IF_DIFFERENT)
    endforeach()" COMPONENT wheel)
endfunction()

ks_wheel_helper(kuafu-import-gltf)
ks_wheel_helper(kuafu-import-mesh)
ks_wheel_helper(kuafu-import-assimp)

get_target_property(opens kuafu::kuafu KUAFU_OPENS)  # Embree, unless it is linked
if(opens)
  find_library(EMBREE_LIBRARY_FILE ${opens} REQUIRED)
  ks_wheel_module(kuafu ${EMBREE_LIBRARY_FILE})
else()
  ks_wheel_module(kuafu)
endif()
ks_wheel_module(simsense)
