# What our own targets are compiled with, and nothing that links the installed library.
# No fused multiply-add behind our back: runs of one scene stay bit-identical across optimisation levels.
add_compile_options(-Wall -Wextra -Wpedantic -Wshadow -Wconversion -Wno-sign-conversion -ffp-contract=off -fno-math-errno)
if(CMAKE_SYSTEM_PROCESSOR MATCHES "^(aarch64|arm64)$")
  add_compile_options(-U__ARM_FEATURE_FMA)  # else Eigen writes fused multiply-add itself, which x86-64 has not by default
endif()
if(RTBUS_WERROR)
  add_compile_options(-Werror)
  if(CMAKE_CROSSCOMPILING)
    # What is inlined of Bullet's headers gives false positives there. The native builds have this warning as an error.
    add_compile_options($<$<CXX_COMPILER_ID:GNU>:-Wno-error=maybe-uninitialized>)
  endif()
endif()
if(RTBUS_SANITIZE)
  add_compile_options(-fsanitize=${RTBUS_SANITIZE} -fno-omit-frame-pointer)
  add_link_options(-fsanitize=${RTBUS_SANITIZE})
  if(RTBUS_SANITIZE MATCHES "undefined")
    # Left out: checks that double the time to compile, and whose faults AddressSanitizer mostly sees too.
    add_compile_options(-fno-sanitize-recover=undefined -fno-sanitize=null,alignment,object-size,vptr)
    # GCC's manual: with sanitizers this warning has false positives. The builds without them have it as an error.
    add_compile_options($<$<CXX_COMPILER_ID:GNU>:-Wno-error=maybe-uninitialized>)
  endif()
  add_compile_definitions(RTBUS_SANITIZED=1)
endif()

# For the targets that the loop spends its ticks in: bit for bit the same forces, and the dearest cycles cost 5 % less.
# Not with sanitizers, whose checks make GCC see uses of uninitialized values at -O3 that are none.
function(rtbus_compile_for_speed target)
  if(NOT RTBUS_SANITIZE)
    target_compile_options(${target} PRIVATE $<$<CONFIG:RelWithDebInfo,Release>:-O3>)
    # GCC 12 then warns of a memcpy within std::string that is none (bug 105651).
    target_compile_options(${target} PRIVATE $<$<CXX_COMPILER_ID:GNU>:-Wno-restrict>)
  endif()
endfunction()

# What whoever includes our headers needs: the folder they are included from, and C++20.
add_library(rtbus_compiler INTERFACE)
add_library(rtbus::compiler ALIAS rtbus_compiler)
target_include_directories(rtbus_compiler INTERFACE $<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}> $<INSTALL_INTERFACE:include/rtbus>)
target_compile_features(rtbus_compiler INTERFACE cxx_std_20)

find_program(CCACHE_PROGRAM ccache)
if(CCACHE_PROGRAM)
  # Clones of the project in different folders share what they compiled.
  set(CMAKE_CXX_COMPILER_LAUNCHER
      ${CMAKE_COMMAND} -E env CCACHE_BASEDIR=${PROJECT_SOURCE_DIR} CCACHE_NOHASHDIR=1 ${CCACHE_PROGRAM})
endif()
