# SPDX-License-Identifier: Apache-2.0
# ks_add_shaders(target shader_dir [INLINED stem ...] [PER_BAND stem ...] [VARIANTS stem:suffix:definition ...]): compiles every
# shader_dir/entry/*.{comp,rgen,rchit,rahit,rmiss} to
# SPIR-V and embeds it. C++ sees it by #include "spirv/<stem>.h", which defines `const uint32_t <stem>_spirv[]`. The stem of trace.rgen is
# trace_rgen; of trace.comp, trace. INLINED: all functions are inlined: NVIDIA's compiler leaves long ones as they are, their arrays in memory.
# VARIANTS: compiled once for each, as <stem>_<suffix> with the macro defined (none where definition is empty).
# PER_BAND: the variants <stem>_infrared with KUAFU_CHANNELS=1 and <stem>_visible with 3.
find_program(GLSLANG_VALIDATOR glslangValidator REQUIRED)
function(ks_add_shaders target shader_dir)
  cmake_parse_arguments(PARSE_ARGV 2 shaders "" "" "INLINED;PER_BAND;VARIANTS")
  foreach(stem IN LISTS shaders_PER_BAND)
    list(APPEND shaders_VARIANTS ${stem}:infrared:KUAFU_CHANNELS=1 ${stem}:visible:KUAFU_CHANNELS=3)
  endforeach()
  file(GLOB entries CONFIGURE_DEPENDS ${shader_dir}/entry/*.comp ${shader_dir}/entry/*.rgen ${shader_dir}/entry/*.rchit ${shader_dir}/entry/*.rahit ${shader_dir}/entry/*.rmiss)
  set(out_dir ${CMAKE_CURRENT_BINARY_DIR}/shaders)
  file(RELATIVE_PATH generated ${PROJECT_SOURCE_DIR} ${shader_dir})
  set(headers)
  foreach(entry ${entries})
    get_filename_component(stem ${entry} NAME)
    string(REPLACE "." "_" stem ${stem})
    string(REGEX REPLACE "_comp$" "" stem ${stem})
    set(variants ${shaders_VARIANTS})
    list(FILTER variants INCLUDE REGEX "^${stem}:")
    if(NOT variants)
      set(variants ${stem})
    endif()
    set(optimise)
    if(stem IN_LIST shaders_INLINED)
      set(optimise -Os)
    endif()
    foreach(variant ${variants})
      set(name ${stem})
      set(definition)
      if(variant MATCHES "^[^:]*:([^:]*):(.*)$")
        set(name ${stem}_${CMAKE_MATCH_1})
        if(CMAKE_MATCH_2)
          set(definition -D${CMAKE_MATCH_2})
        endif()
      endif()
      set(header ${out_dir}/spirv/${name}.h)
      add_custom_command(
        OUTPUT ${header}
        COMMAND ${CMAKE_COMMAND} -E make_directory ${out_dir}/spirv
        COMMAND ${GLSLANG_VALIDATOR} -V --quiet ${optimise} ${definition} --target-env vulkan1.2 -I${shader_dir} -I${KS_GENERATED}/${generated} --depfile ${header}.d --vn ${name}_spirv -o ${header} ${entry}
        DEPENDS ${entry}
        DEPFILE ${header}.d
        COMMENT "SPIR-V ${name}"
        VERBATIM)
      list(APPEND headers ${header})
    endforeach()
  endforeach()
  add_custom_target(${target}_shaders DEPENDS ${headers})
  add_dependencies(${target} ${target}_shaders)
  target_include_directories(${target} PRIVATE ${out_dir})
endfunction()
