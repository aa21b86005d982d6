get_filename_component(TSDFPP_FOLDER ${CMAKE_CURRENT_LIST_DIR} DIRECTORY)

# tsdfpp_compile_together(<target>): those of its files that cmake/compiled_together.txt names in one line are compiled as
# one, where CMAKE_UNITY_BUILD asks for it.
function(tsdfpp_compile_together target)
  set_target_properties(${target} PROPERTIES UNITY_BUILD_MODE GROUP)
  get_target_property(sources ${target} SOURCES)
  get_target_property(folder ${target} SOURCE_DIR)
  foreach(source IN LISTS sources)
    get_filename_component(path ${source} ABSOLUTE BASE_DIR ${folder})
    file(RELATIVE_PATH path ${TSDFPP_FOLDER} ${path})
    get_property(group GLOBAL PROPERTY TSDFPP_GROUP_OF_${path})
    if(group)
      set_source_files_properties(${source} PROPERTIES UNITY_GROUP ${group})
    endif()
  endforeach()
endfunction()

file(READ ${CMAKE_CURRENT_LIST_DIR}/compiled_together.txt lines)
string(REGEX REPLACE "#[^\n]*\n" "" lines "${lines}")
string(REPLACE "\n " " " lines "${lines}")
string(REPLACE "\n" ";" lines "${lines}")
set_property(
  DIRECTORY
  APPEND
  PROPERTY CMAKE_CONFIGURE_DEPENDS ${CMAKE_CURRENT_LIST_DIR}/compiled_together.txt)
set(group 0)
foreach(line IN LISTS lines)
  math(EXPR group "${group} + 1")
  separate_arguments(files UNIX_COMMAND "${line}")
  foreach(file IN LISTS files)
    get_property(other GLOBAL PROPERTY TSDFPP_GROUP_OF_${file})
    if(other OR NOT EXISTS ${TSDFPP_FOLDER}/${file})
      message(FATAL_ERROR "cmake/compiled_together.txt: '${file}' is in two lines or no file")
    endif()
    set_property(GLOBAL PROPERTY TSDFPP_GROUP_OF_${file} together_${group})
  endforeach()
endforeach()

# tsdfpp_compile_options(<target>): the warnings and floating-point rules that every target of the project shares, and which
# of its files are compiled together.
function(tsdfpp_compile_options target)
  tsdfpp_compile_together(${target})
  target_compile_options(
    ${target}
    PRIVATE -Wall
            -Wextra
            -Wpedantic
            -Wshadow
            -Werror
            # One result for all compilers and instruction sets: no fused multiply-add behind our back.
            -ffp-contract=off
            # Values are unchanged by these; without them loops with a square root or a choice are not vectorised.
            -fno-math-errno
            -fno-trapping-math)
  if(NOT CMAKE_DISABLE_PRECOMPILE_HEADERS)
    # GCC 12 forgets of what it precompiled that its own headers are not to be warned about.
    target_compile_options(${target} PRIVATE -Wno-array-bounds -Wno-restrict -Wno-stringop-overflow)
  endif()
  if(TSDFPP_SANITIZE)
    # Instrumented, GCC 12 takes the error inside every tl::expected for uninitialised, and an empty vector for one that
    # is copied.
    target_compile_options(${target} PRIVATE -fsanitize=${TSDFPP_SANITIZE} -fno-omit-frame-pointer
                                             -Wno-maybe-uninitialized -Wno-array-bounds)
    target_link_options(${target} PRIVATE -fsanitize=${TSDFPP_SANITIZE})
  endif()
endfunction()

# tsdfpp_precompile(<target> <owner> [<header>...]): the headers of other projects that most files read, read once. The
# target <owner> makes them, others of the same compiler options take them from there. Without, most files take a
# quarter longer; every file still includes what it uses, of which scripts/nightly.sh makes sure
# (CMAKE_DISABLE_PRECOMPILE_HEADERS).
function(tsdfpp_precompile target owner)
  if(NOT target STREQUAL owner)
    target_precompile_headers(${target} REUSE_FROM ${owner})
    return()
  endif()
  target_precompile_headers(
    ${target}
    PRIVATE
    <algorithm>
    <array>
    <cmath>
    <cstdint>
    <filesystem>
    <functional>
    <map>
    <memory>
    <optional>
    <set>
    <string>
    <string_view>
    <vector>
    <fmt/format.h>
    <nlohmann/json.hpp>
    <tl/expected.hpp>
    <Eigen/Core>
    <Eigen/Geometry>
    <opencv2/core.hpp>
    ${ARGN})
endfunction()

# tsdfpp_room(<name> [OTHER_OPTIONS] SOURCES ... [PUBLIC ...] [PRIVATE ...]): the library tsdfpp_<name>, alias
# tsdfpp::<name>. OTHER_OPTIONS: what it links changes the compiler's options, so that it precompiles headers of its own.
function(tsdfpp_room name)
  cmake_parse_arguments(ARG "OTHER_OPTIONS" "" "SOURCES;PUBLIC;PRIVATE" ${ARGN})
  add_library(tsdfpp_${name} STATIC ${ARG_SOURCES})
  add_library(tsdfpp::${name} ALIAS tsdfpp_${name})
  target_include_directories(tsdfpp_${name} PUBLIC $<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}>
                                                   $<INSTALL_INTERFACE:include/tsdfpp>)
  target_link_libraries(
    tsdfpp_${name}
    PUBLIC ${ARG_PUBLIC}
    PRIVATE ${ARG_PRIVATE})
  tsdfpp_compile_options(tsdfpp_${name})
  if(ARG_OTHER_OPTIONS)
    tsdfpp_precompile(tsdfpp_${name} tsdfpp_${name})
  else()
    tsdfpp_precompile(tsdfpp_${name} tsdfpp_core)
  endif()
endfunction()

# What has a program find them. The sanitizers' runtimes call dlopen in its place, and a RUNPATH is of the caller alone.
set(TSDFPP_FIND_LATE -Wl,-rpath,${PROJECT_BINARY_DIR})
if(TSDFPP_SANITIZE)
  list(APPEND TSDFPP_FIND_LATE -Wl,--disable-new-dtags)
endif()

# tsdfpp_late_library(<name> FOR <target> SOURCES ... LINK ...): a library that <target> loads where it first needs it
# (core/late_library.h); programs that link <target> find it in the build's folder.
function(tsdfpp_late_library name)
  cmake_parse_arguments(ARG "" "FOR" "SOURCES;LINK" ${ARGN})
  add_library(${name} MODULE ${ARG_SOURCES})
  set_target_properties(${name} PROPERTIES LIBRARY_OUTPUT_DIRECTORY ${PROJECT_BINARY_DIR})
  target_include_directories(${name} PRIVATE ${PROJECT_SOURCE_DIR})
  target_link_libraries(${name} PRIVATE ${ARG_LINK})
  tsdfpp_compile_options(${name})
  add_dependencies(${ARG_FOR} ${name})
  target_link_libraries(${ARG_FOR} INTERFACE ${TSDFPP_FIND_LATE})
endfunction()

# tsdfpp_order_tbb(<target>): what ThreadSanitizer has to be told of a libtbb that is not instrumented.
function(tsdfpp_order_tbb target)
  set(source ${PROJECT_SOURCE_DIR}/tests/sanitizers/tbb_happens_before.cc)
  target_sources(${target} PRIVATE ${source})
  set_source_files_properties(${source} PROPERTIES SKIP_PRECOMPILE_HEADERS ON)
  target_link_libraries(${target} PRIVATE TBB::tbb ${CMAKE_DL_LIBS})
endfunction()

# tsdfpp_test(<name> [OTHER_OPTIONS] SOURCES ... LINK ...): one GoogleTest binary, its tests discovered by CTest.
function(tsdfpp_test name)
  cmake_parse_arguments(ARG "OTHER_OPTIONS" "" "SOURCES;LINK" ${ARGN})
  add_executable(${name} ${ARG_SOURCES})
  target_include_directories(${name} PRIVATE ${PROJECT_SOURCE_DIR})
  target_link_libraries(${name} PRIVATE ${ARG_LINK} GTest::gtest GTest::gtest_main)
  target_compile_definitions(
    ${name} PRIVATE TSDFPP_SOURCE_DIR="${PROJECT_SOURCE_DIR}"
                    TSDFPP_SHARED_DIR="${PROJECT_SOURCE_DIR}/../shared"
                    TSDFPP_COMMAND="${PROJECT_BINARY_DIR}/tsdfpp")
  if(TSDFPP_SANITIZE MATCHES "thread")
    tsdfpp_order_tbb(${name})
  endif()
  tsdfpp_compile_options(${name})
  # Tests are compiled oftener than they are run; it saves a third of that time.
  target_compile_options(${name} PRIVATE $<$<CONFIG:Release>:-O1>)
  if(ARG_OTHER_OPTIONS)
    tsdfpp_precompile(${name} ${name} <gtest/gtest.h>)
  else()
    tsdfpp_precompile(${name} core_tests <gtest/gtest.h>)
  endif()
  tsdfpp_discover_tests(${name} PROPERTIES TIMEOUT 600)
endfunction()

# tsdfpp_discover_tests(<name> [...]): the tests of a GoogleTest binary, listed when CTest starts; options as of
# gtest_discover_tests. A binary that loads a hundred libraries from a cold disk needs longer to list its tests than the
# five seconds it has by default.
function(tsdfpp_discover_tests name)
  include(GoogleTest)
  gtest_discover_tests(${name} DISCOVERY_MODE PRE_TEST DISCOVERY_TIMEOUT 300 ${ARGN})
endfunction()
