# What makes a mistake in memory harder to use, and what makes two builds of one source alike. docs/security/hardening.md says what each
# flag costs and which are left out where; e2e.hardening looks for them in the programs.
#
# VOXELD_HARDENING: OFF leaves out all but -fstack-protector-strong, for measuring what the others cost.
option(VOXELD_HARDENING "Build with the compiler's and the linker's defences" ON)

# For a target whose own options say -O0: glibc's checks need an optimiser.
define_property(TARGET PROPERTY VOXELD_UNOPTIMISED BRIEF_DOCS "Compiled with -O0")
# For a library whose inner loops are what voxeld takes its time for: what costs those more than a fiftieth is left out.
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
    # Where it is looked for what nobody wrote, that is to be seen.
    "$<$<AND:$<BOOL:${optimised}>,$<COMPILE_LANGUAGE:C,CXX>,$<NOT:$<BOOL:$<TARGET_PROPERTY:VOXELD_KERNELS>>>>:-ftrivial-auto-var-init=zero>"
    "$<$<AND:$<BOOL:${optimised}>,$<COMPILE_LANGUAGE:CXX>,$<NOT:$<BOOL:$<TARGET_PROPERTY:VOXELD_KERNELS>>>>:-D_GLIBCXX_ASSERTIONS>"
    "$<$<AND:$<BOOL:${optimised}>,$<COMPILE_LANGUAGE:C,CXX>,$<NOT:$<BOOL:$<TARGET_PROPERTY:VOXELD_UNOPTIMISED>>>>:-U_FORTIFY_SOURCE;-D_FORTIFY_SOURCE=3>")
  include(CheckPIESupported)
  check_pie_supported(LANGUAGES C CXX)
  add_link_options("LINKER:-z,relro,-z,now,-z,noexecstack,-z,shstk")
endif()

# Names of files, which differ from clone to clone, stand in messages as they are from the root.
if(CMAKE_BUILD_TYPE STREQUAL "Release" AND NOT VOXELD_INSTRUMENTED)
  target_compile_options(voxeld_options INTERFACE
    $<$<COMPILE_LANGUAGE:C,CXX>:-ffile-prefix-map=${CMAKE_SOURCE_DIR}=. -ffile-prefix-map=${CMAKE_BINARY_DIR}=build>)
endif()

# The time that archives carry: of whoever builds, as the environment says, else of the commit, else of no time at all.
if(DEFINED ENV{SOURCE_DATE_EPOCH})
  set(VOXELD_EPOCH $ENV{SOURCE_DATE_EPOCH})
else()
  execute_process(COMMAND git -C ${CMAKE_SOURCE_DIR} log -1 --format=%ct OUTPUT_VARIABLE VOXELD_EPOCH ERROR_QUIET
                  OUTPUT_STRIP_TRAILING_WHITESPACE)
  if(NOT VOXELD_EPOCH MATCHES "^[0-9]+$")
    set(VOXELD_EPOCH 315532800)  # 1980, where zip's time begins
  endif()
endif()
