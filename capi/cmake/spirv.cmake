# ks_add_shaders(target shader_dir [stem ...]): compiles every shader_dir/entry/*.{comp,rgen,rchit,rmiss} to SPIR-V and embeds it.
# C++ sees it by #include "spirv/<stem>.h", which defines `const uint32_t <stem>_spirv[]`. The stem of trace.rgen is trace_rgen; of trace.comp, trace.
# Those named by their stems have all functions inlined: NVIDIA's compiler leaves long ones as they are, their arrays in memory.
find_program(GLSLANG_VALIDATOR glslangValidator REQUIRED)
function(ks_add_shaders target shader_dir)
  file(GLOB entries CONFIGURE_DEPENDS ${shader_dir}/entry/*.comp ${shader_dir}/entry/*.rgen ${shader_dir}/entry/*.rchit ${shader_dir}/entry/*.rmiss)
  set(out_dir ${CMAKE_CURRENT_BINARY_DIR}/shaders)
  set(headers)
  foreach(entry ${entries})
    get_filename_component(stem ${entry} NAME)
    string(REPLACE "." "_" stem ${stem})
    string(REGEX REPLACE "_comp$" "" stem ${stem})
    set(header ${out_dir}/spirv/${stem}.h)
    set(optimise)
    if(stem IN_LIST ARGN)
      set(optimise -Os)
    endif()
    add_custom_command(
      OUTPUT ${header}
      COMMAND ${CMAKE_COMMAND} -E make_directory ${out_dir}/spirv
      COMMAND ${GLSLANG_VALIDATOR} -V --quiet ${optimise} --target-env vulkan1.2 -I${shader_dir} --depfile ${header}.d --vn ${stem}_spirv -o ${header} ${entry}
      DEPENDS ${entry}
      DEPFILE ${header}.d
      COMMENT "SPIR-V ${stem}"
      VERBATIM)
    list(APPEND headers ${header})
  endforeach()
  add_custom_target(${target}_shaders DEPENDS ${headers})
  add_dependencies(${target} ${target}_shaders)
  target_include_directories(${target} PRIVATE ${out_dir})
endfunction()
