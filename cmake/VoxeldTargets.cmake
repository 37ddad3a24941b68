# Defines the project's targets: the language level, warnings, sanitizers, and the two kinds of
# targets (library, test) that every folder uses.

set(CMAKE_CXX_STANDARD 20)
set(CMAKE_CXX_STANDARD_REQUIRED ON)
set(CMAKE_CXX_EXTENSIONS OFF)
set(CMAKE_POSITION_INDEPENDENT_CODE ON)
set(CMAKE_EXPORT_COMPILE_COMMANDS ON)
# RPATH lets programs find the libraries that tools/bundle puts beside them. RUNPATH, the linker's default, does not apply to the
# dependencies of those libraries. CMAKE_BUILD_RPATH is not used because it leaves an empty entry, that is, the working directory, in
# programs that are to be installed. add_link_options() is not used because it would escape the dollar signs twice.
add_link_options(-Wl,--disable-new-dtags)
string(APPEND CMAKE_EXE_LINKER_FLAGS " -Wl,-rpath,'$ORIGIN/../lib:$ORIGIN/../../lib'")
set(CMAKE_RUNTIME_OUTPUT_DIRECTORY ${CMAKE_BINARY_DIR}/bin)

if(NOT CMAKE_BUILD_TYPE)
  set(CMAKE_BUILD_TYPE Release CACHE STRING "Build type" FORCE)
endif()

find_program(VOXELD_CCACHE ccache)
if(VOXELD_CCACHE)
  set(CMAKE_C_COMPILER_LAUNCHER ${VOXELD_CCACHE})
  # Precompiled headers require the second option.
  set(CMAKE_CXX_COMPILER_LAUNCHER ${CMAKE_COMMAND} -E env CCACHE_SLOPPINESS=pch_defines,time_macros ${VOXELD_CCACHE})
endif()

find_program(VOXELD_MOLD mold)
if(VOXELD_MOLD)
  add_link_options(-fuse-ld=mold)
endif()

find_package(Threads REQUIRED)
find_package(absl REQUIRED)

add_library(voxeld_options INTERFACE)
target_include_directories(voxeld_options INTERFACE ${CMAKE_SOURCE_DIR})
# CPU and GPU must round identically, so never fuse a multiplication and an addition.
target_compile_options(voxeld_options INTERFACE -ffp-contract=off)
if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU" AND CMAKE_CXX_COMPILER_VERSION VERSION_LESS 13)
  # When GCC 12 vectorises straight-line code, it ignores that a double was rounded to float.
  target_compile_options(voxeld_options INTERFACE $<$<COMPILE_LANGUAGE:CXX>:-fno-tree-slp-vectorize>)
endif()
if(VOXELD_SANITIZE)
  target_compile_options(voxeld_options INTERFACE -fsanitize=${VOXELD_SANITIZE}
                                                  -fno-omit-frame-pointer)
  target_compile_definitions(voxeld_options INTERFACE VOXELD_SANITIZED)
  target_link_options(voxeld_options INTERFACE -fsanitize=${VOXELD_SANITIZE})
  if(VOXELD_SANITIZE MATCHES "undefined")
    # The vptr check opens a pipe to probe an object, and reports a false error
    # if a test has used up all file descriptors. The null check is not needed:
    # dereferencing a null pointer crashes anyway.
    target_compile_options(voxeld_options INTERFACE -fno-sanitize-recover=undefined -fno-sanitize=null,vptr)
  endif()
endif()
if(VOXELD_FUZZ)
  # Edge coverage guides libFuzzer; tools/fuzz --coverage reports the line coverage of the same programs.
  target_compile_options(voxeld_options INTERFACE -fsanitize=fuzzer-no-link -fprofile-instr-generate -fcoverage-mapping)
  target_link_options(voxeld_options INTERFACE -fprofile-instr-generate)
endif()
# AddressSanitizer builds by Clang also count edges, cheaply: tests run each fuzz target for a few
# seconds, guided by them.
set(VOXELD_FUZZ_TESTS OFF)
if(VOXELD_SANITIZE MATCHES "address" AND CMAKE_CXX_COMPILER_ID MATCHES "Clang" AND NOT VOXELD_FUZZ)
  set(VOXELD_FUZZ_TESTS ON)
  target_compile_options(voxeld_options INTERFACE -fsanitize-coverage=inline-8bit-counters,pc-table)
endif()
if(VOXELD_COVERAGE)
  # Atomic, because threads that count concurrently would otherwise lose counts.
  target_compile_options(voxeld_options INTERFACE -fprofile-instr-generate -fcoverage-mapping -fprofile-update=atomic)
  target_link_options(voxeld_options INTERFACE -fprofile-instr-generate)
endif()
include(VoxeldHardening)
target_link_libraries(voxeld_options INTERFACE Threads::Threads)

# Link only the functions and data that a program uses, not whole object files.
if(CMAKE_BUILD_TYPE STREQUAL "Release" AND NOT VOXELD_SANITIZE)
  target_compile_options(voxeld_options INTERFACE $<$<COMPILE_LANGUAGE:C,CXX>:-ffunction-sections -fdata-sections>)
  add_link_options(LINKER:--gc-sections)
endif()

# Warnings are for our own code only, not for what protoc generates.
add_library(voxeld_warnings INTERFACE)
target_compile_options(voxeld_warnings INTERFACE -Wall -Wextra -Wno-unused-parameter
                                                 -Wno-missing-field-initializers)
if(VOXELD_SANITIZE AND CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
  # The checks that a sanitizer inserts confuse GCC's flow analysis, which then reports false positives, also in system headers.
  target_compile_options(voxeld_warnings INTERFACE -Wno-array-bounds -Wno-maybe-uninitialized -Wno-nonnull -Wno-restrict
                                                   -Wno-stringop-overflow -Wno-stringop-overread)
endif()
if(VOXELD_HARDENING AND NOT VOXELD_SANITIZE AND CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
  # The standard library's assertions also cause false positives, more of them with more inlining. They must not fail the build.
  target_compile_options(voxeld_warnings INTERFACE -Wno-error=array-bounds -Wno-error=maybe-uninitialized -Wno-error=nonnull -Wno-error=restrict
                                                   -Wno-error=stringop-overflow -Wno-error=stringop-overread)
endif()
if(CMAKE_CXX_COMPILER_ID STREQUAL "Clang")
  # Checks the lock annotations (display/sync/mutex.h).
  target_compile_options(voxeld_warnings INTERFACE $<$<COMPILE_LANGUAGE:CXX>:-Wthread-safety>)
endif()
if(CMAKE_UNITY_BUILD AND CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
  # A unity build includes the sources, so GCC would warn about types that use their anonymous namespaces.
  target_compile_options(voxeld_warnings INTERFACE $<$<COMPILE_LANGUAGE:CXX>:-Wno-subobject-linkage>)
endif()
if(VOXELD_QUICK AND CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
  # GCC otherwise collects its garbage every 128 MB, a tenth of its time. Memory stays below what tools/jobs counts for a compiler.
  target_compile_options(voxeld_warnings INTERFACE "$<$<COMPILE_LANGUAGE:CXX>:SHELL:--param ggc-min-heapsize=800000>")
endif()
if(VOXELD_WERROR)
  target_compile_options(voxeld_warnings INTERFACE -Werror)
endif()

# Sets the libraries and compile options of a test target.
function(voxeld_test_options name)
  target_link_libraries(${name} PRIVATE voxeld_options voxeld_warnings GTest::gmock GTest::gtest_main)
  # gRPC adds -pthread to the targets that link it. Precompiled headers can only be shared by targets with the same options, so
  # all test targets get it. With GCC, disable warnings that report false positives in library headers.
  target_compile_options(${name} PRIVATE -pthread)
  if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
    target_compile_options(${name} PRIVATE -Wno-array-bounds -Wno-restrict -Wno-stringop-overflow)
  endif()
  if((VOXELD_INSTRUMENTED OR VOXELD_QUICK) AND NOT ARG_HEAVY)
    # With optimisation, sanitizer-instrumented code takes several times as long to compile.
    target_compile_options(${name} PRIVATE -O0)
    set_target_properties(${name} PROPERTIES VOXELD_UNOPTIMISED ON)
  elseif(CMAKE_BUILD_TYPE STREQUAL "Release")
    # The code under test is built as it is shipped; only the test's own sources use -O1, to compile faster.
    target_compile_options(${name} PRIVATE -O1)
  endif()
endfunction()

# voxeld_reduce_optimisation(): the code in this directory and its subdirectories is not performance-critical. Quick builds (VOXELD_QUICK)
# compile it with -O1, instrumented builds with -O0, since optimising instrumented code takes longest.
macro(voxeld_reduce_optimisation)
  if(VOXELD_FUZZ)
    # Fuzz targets should run all of it as often as possible.
  elseif(VOXELD_INSTRUMENTED)
    add_compile_options($<$<COMPILE_LANGUAGE:CXX>:-O0>)
  elseif(VOXELD_QUICK)
    add_compile_options($<$<COMPILE_LANGUAGE:CXX>:-O1>)
  endif()
endmacro()

# voxeld_unoptimised_if_quick(TARGET …): these targets are not performance-critical; quick builds (VOXELD_QUICK) compile them with -O0.
function(voxeld_unoptimised_if_quick)
  if(NOT VOXELD_QUICK OR VOXELD_INSTRUMENTED)
    return()
  endif()
  foreach(target ${ARGN})
    target_compile_options(${target} PRIVATE $<$<COMPILE_LANGUAGE:CXX>:-O0>)
    set_target_properties(${target} PROPERTIES VOXELD_UNOPTIMISED ON)
  endforeach()
endfunction()

# voxeld_exclude_from_tsan(SOURCE …): excludes sources that share no data between threads from ThreadSanitizer's instrumentation.
function(voxeld_exclude_from_tsan)
  if(VOXELD_SANITIZE STREQUAL "thread")
    set_source_files_properties(${ARGN} PROPERTIES COMPILE_OPTIONS -fno-sanitize=thread SKIP_PRECOMPILE_HEADERS ON)
  endif()
endfunction()

# voxeld_build_tests_only(): makes the target `all` build the tests and what they need, and nothing else.
function(voxeld_build_tests_only)
  voxeld_targets_below(${CMAKE_SOURCE_DIR} targets)
  voxeld_targets_below(${CMAKE_SOURCE_DIR}/tests tests)
  list(REMOVE_ITEM targets ${tests})
  foreach(target ${targets})
    get_target_property(type ${target} TYPE)
    if(type MATCHES "EXECUTABLE|(STATIC|SHARED|OBJECT)_LIBRARY")
      set_target_properties(${target} PROPERTIES EXCLUDE_FROM_ALL ON)
    endif()
  endforeach()
endfunction()

# voxeld_exclude_from_unity(SOURCE …): excludes these sources from unity builds (CMAKE_UNITY_BUILD), because their file-local names
# conflict with those of other sources.
function(voxeld_exclude_from_unity)
  set_source_files_properties(${ARGN} PROPERTIES SKIP_UNITY_BUILD_INCLUSION ON)
endfunction()

# voxeld_library(NAME [SINGLE_THREADED] [KERNELS] SOURCES … LINK …): a static library `voxeld_NAME`.
#   SINGLE_THREADED  pure functions, and objects that no two threads share (voxeld_exclude_from_tsan)
#   KERNELS          it has the inner loops (VoxeldHardening.cmake)
function(voxeld_library name)
  cmake_parse_arguments(ARG "SINGLE_THREADED;KERNELS" "" "SOURCES;LINK" ${ARGN})
  set(unwatched OFF)
  if(ARG_SINGLE_THREADED AND VOXELD_SANITIZE STREQUAL "thread")
    set(unwatched ON)
  endif()
  add_library(voxeld_${name} STATIC ${ARG_SOURCES})
  target_link_libraries(voxeld_${name} PUBLIC voxeld_options ${ARG_LINK} PRIVATE voxeld_warnings)
  if(ARG_KERNELS)
    set_target_properties(voxeld_${name} PROPERTIES VOXELD_KERNELS ON)
    set_property(GLOBAL APPEND PROPERTY VOXELD_KERNEL_TARGETS voxeld_${name})
  endif()
  if(unwatched)
    target_compile_options(voxeld_${name} PRIVATE -fno-sanitize=thread)
  endif()
endfunction()

# voxeld_test_objects(NAME [HEAVY] SOURCES … LINK …): cases that several programs run, compiled once; each links NAME.
function(voxeld_test_objects name)
  cmake_parse_arguments(ARG "HEAVY" "" "SOURCES;LINK" ${ARGN})
  add_library(${name} OBJECT ${ARG_SOURCES})
  target_link_libraries(${name} PRIVATE ${ARG_LINK})
  voxeld_test_options(${name})
endfunction()

# voxeld_deep(TEST …): these tests run in the deep tier (tools/test --deep), not in the default one.
function(voxeld_deep)
  foreach(test ${ARGN})
    set_property(TEST ${test} APPEND PROPERTY LABELS deep)
  endforeach()
endfunction()

# voxeld_test(NAME [SINGLE_THREADED] [HEAVY] [DEEP] [FULL_ASAN] LABELS … SOURCES … LINK … LONG … ONE_THREAD … FULL_ASAN_CASES … SHARDS n
# TIMEOUT s COST s): an executable `NAME` in bin/tests. Each of its cases is a ctest test. With VOXELD_WHOLE_TESTS, all of them together are
# one test, or SHARDS (1) tests, which may run in parallel.
#   COST             how many seconds it takes, if that is long: such tests start first
#   LABELS           host (default), gpu (needs one; named gpu.…), hil, e2e (not where VOXELD_E2E_TESTS is off)
#   HEAVY            its own code computes much, and is optimised under a sanitizer as well
#   DEEP             all of it runs in the deep tier
#   LONG             patterns of cases that run in the deep tier (as the test NAME.long), and not where VOXELD_LONG_TESTS is off
#   FULL_ASAN        AddressSanitizer runs it in the full tier only: it takes long there and reads no untrusted input
#   FULL_ASAN_CASES  patterns of cases that take long there
#   SINGLE_THREADED  neither it nor what it tests has threads: left out of ThreadSanitizer's build
#   ONE_THREAD       patterns of cases that have no threads: left out under ThreadSanitizer
function(voxeld_test name)
  cmake_parse_arguments(ARG "SINGLE_THREADED;HEAVY;DEEP;FULL_ASAN" "TIMEOUT;SHARDS;COST" "SOURCES;LINK;LABELS;LONG;ONE_THREAD;FULL_ASAN_CASES" ${ARGN})
  if(ARG_SINGLE_THREADED AND VOXELD_SANITIZE STREQUAL "thread")
    return()
  endif()
  if(NOT ARG_SHARDS)
    set(ARG_SHARDS 1)
  endif()
  if(NOT ARG_LABELS)
    set(ARG_LABELS host)
  endif()
  if(NOT ARG_TIMEOUT)
    set(ARG_TIMEOUT 300)
  endif()
  if(NOT ARG_COST)
    set(ARG_COST 1)
  endif()
  add_executable(${name} ${ARG_SOURCES})
  target_link_libraries(${name} PRIVATE ${ARG_LINK})
  voxeld_test_options(${name})
  set_target_properties(${name} PROPERTIES RUNTIME_OUTPUT_DIRECTORY ${CMAKE_BINARY_DIR}/bin/tests)
  if((NOT VOXELD_E2E_TESTS AND "e2e" IN_LIST ARG_LABELS) OR (ARG_FULL_ASAN AND VOXELD_SHORT_ASAN))
    set_target_properties(${name} PROPERTIES EXCLUDE_FROM_ALL ON)
    return()
  endif()
  set(prefix "${name}.")
  if("gpu" IN_LIST ARG_LABELS)
    set(prefix "gpu.${name}.")
  endif()
  set(skipped "")
  if(VOXELD_SANITIZE STREQUAL "thread")
    set(skipped ${ARG_ONE_THREAD})
  elseif(VOXELD_SHORT_ASAN)
    set(skipped ${ARG_FULL_ASAN_CASES})
  endif()
  if(VOXELD_WHOLE_TESTS)
    string(REGEX REPLACE "\\.$" "" whole ${prefix})
    voxeld_whole_test(${whole} ${name} "${ARG_LABELS}" "*" "${ARG_LONG};${skipped}" ${ARG_TIMEOUT} ${ARG_COST} ${ARG_SHARDS} ${ARG_DEEP})
    if(ARG_LONG AND VOXELD_LONG_TESTS)
      list(JOIN ARG_LONG ":" long)
      voxeld_whole_test(${whole}.long ${name} "${ARG_LABELS}" "${long}" "${skipped}" ${ARG_TIMEOUT} ${ARG_COST} ${ARG_SHARDS} ON)
    endif()
    # The default tier does not build programs that only the deep tier runs.
    if(ARG_DEEP AND VOXELD_QUICK)
      set_target_properties(${name} PROPERTIES EXCLUDE_FROM_ALL ON)
      add_dependencies(deep_tests ${name})
    endif()
    return()
  endif()
  set(without ${skipped})
  if(NOT VOXELD_LONG_TESTS)
    list(APPEND without ${ARG_LONG})
  endif()
  set(chosen "")
  if(without)
    list(JOIN without ":" without)
    set(chosen TEST_FILTER "-${without}")
  endif()
  gtest_discover_tests(${name} ${chosen} TEST_PREFIX "${prefix}" DISCOVERY_TIMEOUT 60
                       PROPERTIES LABELS "${ARG_LABELS}" TIMEOUT ${ARG_TIMEOUT})
endfunction()

# Registers the cases of `program` that match `filter`, without those that match `without`, as one test for each shard.
function(voxeld_whole_test test program labels filter without timeout cost shards deep)
  list(JOIN without ":" without)
  string(REGEX REPLACE "^:|:$" "" without "${without}")
  if(without)
    string(APPEND filter ":-${without}")
    string(REGEX REPLACE "^\\*:-" "-" filter "${filter}")
  endif()
  if(deep)
    list(APPEND labels deep)
  endif()
  math(EXPR timeout "5 * ${timeout}")
  math(EXPR last "${shards} - 1")
  foreach(shard RANGE ${last})
    set(each ${test})
    if(last GREATER 0)
      set(each ${test}.${shard})
    endif()
    add_test(NAME ${each} COMMAND ${program} --gtest_filter=${filter} WORKING_DIRECTORY ${CMAKE_CURRENT_BINARY_DIR})
    # GoogleTest succeeds if no case matches the filter. A shard may have none.
    if(last EQUAL 0)
      set_tests_properties(${each} PROPERTIES FAIL_REGULAR_EXPRESSION "\\[  PASSED  \\] 0 tests")
    endif()
    set_tests_properties(${each} PROPERTIES LABELS "${labels}" TIMEOUT ${timeout} COST ${cost}
                         ENVIRONMENT "GTEST_TOTAL_SHARDS=${shards};GTEST_SHARD_INDEX=${shard}")
  endforeach()
endfunction()

# voxeld_fuzz(FOLDER/NAME SOURCES … LINK …): a fuzz target `NAME_fuzz` in bin/fuzz, built from
# FOLDER/NAME_fuzz.cc and SOURCES. With VOXELD_FUZZ it is driven by libFuzzer (tools/fuzz runs it).
# Otherwise it is a test, fuzz.NAME, which replays its corpus as unpacked into fuzz/corpus/NAME of
# the build (target fuzz_corpora). If edges are counted (VOXELD_FUZZ_TESTS), the test also lets
# libFuzzer search for VOXELD_FUZZ_SECONDS.
function(voxeld_fuzz path)
  cmake_parse_arguments(ARG "" "" "SOURCES;LINK" ${ARGN})
  get_filename_component(name ${path} NAME)
  set(target ${name}_fuzz)
  add_executable(${target} ${path}_fuzz.cc ${ARG_SOURCES})
  target_link_libraries(${target} PRIVATE ${ARG_LINK} voxeld_options voxeld_warnings absl::status absl::statusor absl::strings)
  target_compile_options(${target} PRIVATE -pthread)
  set_target_properties(${target} PROPERTIES RUNTIME_OUTPUT_DIRECTORY ${CMAKE_BINARY_DIR}/bin/fuzz)
  add_dependencies(${target} fuzz_corpora)
  if(VOXELD_FUZZ)
    target_link_options(${target} PRIVATE -fsanitize=fuzzer)
    add_dependencies(fuzz_targets ${target})
    return()
  endif()
  if(VOXELD_FUZZ_TESTS)
    target_link_options(${target} PRIVATE -fsanitize=fuzzer)
    add_test(NAME fuzz.${name} COMMAND ${CMAKE_SOURCE_DIR}/tools/fuzz ${name} ${VOXELD_FUZZ_SECONDS} --build ${CMAKE_BINARY_DIR})
    set_tests_properties(fuzz.${name} PROPERTIES LABELS host TIMEOUT 300)
    return()
  endif()
  target_sources(${target} PRIVATE ${CMAKE_SOURCE_DIR}/tests/fuzz/replay_main.cc)
  if(VOXELD_INSTRUMENTED OR VOXELD_QUICK)
    target_compile_options(${target} PRIVATE -O0)
  endif()
  if(NOT VOXELD_QUICK)
    add_test(NAME fuzz.${name} COMMAND ${target} ${CMAKE_BINARY_DIR}/fuzz/corpus/${name})
    set_tests_properties(fuzz.${name} PROPERTIES LABELS host TIMEOUT 300)
  else()
    set_target_properties(${target} PROPERTIES EXCLUDE_FROM_ALL ON)
  endif()
endfunction()
