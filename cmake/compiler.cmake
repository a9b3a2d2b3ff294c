# What every target is compiled with. Linked as rtbus::compiler.
add_library(rtbus_compiler INTERFACE)
add_library(rtbus::compiler ALIAS rtbus_compiler)
target_include_directories(rtbus_compiler INTERFACE ${PROJECT_SOURCE_DIR})
# No fused multiply-add behind our back: runs of one scene stay bit-identical across optimisation levels.
target_compile_options(rtbus_compiler INTERFACE -Wall -Wextra -Wpedantic -Wshadow -Wconversion -Wno-sign-conversion
                                                -ffp-contract=off -fno-math-errno)
if(RTBUS_WERROR)
  target_compile_options(rtbus_compiler INTERFACE -Werror)
endif()
if(RTBUS_SANITIZE)
  target_compile_options(rtbus_compiler INTERFACE -fsanitize=${RTBUS_SANITIZE} -fno-omit-frame-pointer)
  target_link_options(rtbus_compiler INTERFACE -fsanitize=${RTBUS_SANITIZE})
  if(RTBUS_SANITIZE MATCHES "undefined")
    target_compile_options(rtbus_compiler INTERFACE -fno-sanitize-recover=undefined)
  endif()
  target_compile_definitions(rtbus_compiler INTERFACE RTBUS_SANITIZED=1)
endif()

find_program(CCACHE_PROGRAM ccache)
if(CCACHE_PROGRAM)
  set(CMAKE_CXX_COMPILER_LAUNCHER ${CCACHE_PROGRAM})
endif()
