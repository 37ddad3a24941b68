# Options that make memory errors harder to exploit, and builds reproducible.
# docs/security/hardening.md says what each flag costs and which are left out where; e2e.hardening
# checks the programs for them.
#
# VOXELD_HARDENING: OFF leaves out all but -fstack-protector-strong, to measure the cost of the
# others.
option(VOXELD_HARDENING "Build with the compiler's and the linker's defences" ON)

# For a target whose own options contain -O0: glibc's checks need optimisation.
define_property(TARGET PROPERTY VOXELD_UNOPTIMISED BRIEF_DOCS "Compiled with -O0")
# For a library with voxeld's performance-critical loops: omits options that slow these down by more
# than a fiftieth.
define_property(TARGET PROPERTY VOXELD_KERNELS BRIEF_DOCS "Compiled without VOXELD_NOT_IN_KERNELS")
set(VOXELD_NOT_IN_KERNELS -ftrivial-auto-var-init=zero -D_GLIBCXX_ASSERTIONS)

if(NOT VOXELD_SANITIZE)
  target_compile_options(voxeld_options INTERFACE -fstack-protector-strong)
endif()

if(VOXELD_HARDENING AND NOT VOXELD_SANITIZE)
  set(optimised OFF)
  if(CMAKE_BUILD_TYPE MATCHES "^(Release|RelWithDebInfo|MinSizeRel)$")
    set(optimised ON)
  endif()
  target_compile_options(voxeld_options INTERFACE
    "$<$<COMPILE_LANGUAGE:C,CXX>:-fstack-clash-protection;-fcf-protection=full;-Wformat;-Werror=format-security>"
    # Only in optimised builds: tools that look for uninitialised memory must find it in the others.
    "$<$<AND:$<BOOL:${optimised}>,$<COMPILE_LANGUAGE:C,CXX>,$<NOT:$<BOOL:$<TARGET_PROPERTY:VOXELD_KERNELS>>>>:-ftrivial-auto-var-init=zero>"
    "$<$<AND:$<BOOL:${optimised}>,$<COMPILE_LANGUAGE:CXX>,$<NOT:$<BOOL:$<TARGET_PROPERTY:VOXELD_KERNELS>>>>:-D_GLIBCXX_ASSERTIONS>"
    "$<$<AND:$<BOOL:${optimised}>,$<COMPILE_LANGUAGE:C,CXX>,$<NOT:$<BOOL:$<TARGET_PROPERTY:VOXELD_UNOPTIMISED>>>>:-U_FORTIFY_SOURCE;-D_FORTIFY_SOURCE=3>")
  include(CheckPIESupported)
  check_pie_supported(LANGUAGES C CXX)
  add_link_options("LINKER:-z,relro,-z,now,-z,noexecstack,-z,shstk")
endif()

# Embedded file names are relative to the root, because clones have different paths.
if(CMAKE_BUILD_TYPE STREQUAL "Release" AND NOT VOXELD_INSTRUMENTED)
  target_compile_options(voxeld_options INTERFACE
    $<$<COMPILE_LANGUAGE:C,CXX>:-ffile-prefix-map=${CMAKE_SOURCE_DIR}=. -ffile-prefix-map=${CMAKE_BINARY_DIR}=build>)
endif()

# The time stamp in archives: SOURCE_DATE_EPOCH if it is set, else the time of the commit, else a
# constant.
if(DEFINED ENV{SOURCE_DATE_EPOCH})
  set(VOXELD_EPOCH $ENV{SOURCE_DATE_EPOCH})
else()
  execute_process(COMMAND git -C ${CMAKE_SOURCE_DIR} log -1 --format=%ct OUTPUT_VARIABLE VOXELD_EPOCH ERROR_QUIET
                  OUTPUT_STRIP_TRAILING_WHITESPACE)
  if(NOT VOXELD_EPOCH MATCHES "^[0-9]+$")
    set(VOXELD_EPOCH 315532800)  # 1980, the earliest time in zip files
  endif()
endif()
