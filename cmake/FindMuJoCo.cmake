# Finds MuJoCo 3.x and makes the imported target MuJoCo::MuJoCo.
#
# Searched in this order: MUJOCO_ROOT (CMake variable, then environment), the system, then
# .deps/mujoco, where scripts/setup.sh unpacks the pinned wheel.
# Sets MuJoCo_FOUND, MuJoCo_VERSION, MuJoCo_LIBRARY, MuJoCo_INCLUDE_DIR.

set(_mujoco_local ${PROJECT_SOURCE_DIR}/.deps/mujoco)
set(_mujoco_roots ${MUJOCO_ROOT} $ENV{MUJOCO_ROOT})

set(MuJoCo_VERSION "")
# Each place is taken whole or not at all, so that a header and a library of two versions never meet.
foreach(_mujoco_place IN ITEMS given system local)
  unset(MuJoCo_INCLUDE_DIR CACHE)
  unset(MuJoCo_LIBRARY CACHE)
  if(_mujoco_place STREQUAL "given")
    if(NOT _mujoco_roots)
      continue()
    endif()
    set(_mujoco_where PATHS ${_mujoco_roots} NO_DEFAULT_PATH)
  elseif(_mujoco_place STREQUAL "local")
    set(_mujoco_where PATHS ${_mujoco_local} NO_DEFAULT_PATH)
  else()
    set(_mujoco_where "")
  endif()
  find_path(MuJoCo_INCLUDE_DIR mujoco/mujoco.h ${_mujoco_where} PATH_SUFFIXES include)
  find_library(MuJoCo_LIBRARY mujoco ${_mujoco_where} PATH_SUFFIXES lib)
  if(MuJoCo_INCLUDE_DIR AND NOT MuJoCo_LIBRARY)
    # A Python wheel holds the library under its full name only, beside include/.
    get_filename_component(_mujoco_root ${MuJoCo_INCLUDE_DIR} DIRECTORY)
    file(GLOB _mujoco_wheel ${_mujoco_root}/libmujoco.so.3* ${_mujoco_root}/lib/libmujoco.so.3*)
    if(_mujoco_wheel)
      list(GET _mujoco_wheel 0 _mujoco_file)
      set(MuJoCo_LIBRARY ${_mujoco_file} CACHE FILEPATH "MuJoCo's library" FORCE)
    endif()
  endif()
  if(MuJoCo_INCLUDE_DIR AND MuJoCo_LIBRARY)
    file(STRINGS ${MuJoCo_INCLUDE_DIR}/mujoco/mujoco.h _mujoco_line
         REGEX "^#define mjVERSION_HEADER +[0-9]+")
    string(REGEX REPLACE ".* ([0-9]+).*" "\\1" _mujoco_number "${_mujoco_line}")
    # Before 3.4 the number was e.g. 222 for 2.2.2; since then 3004000 for 3.4.0.
    if(_mujoco_number GREATER_EQUAL 1000000)
      math(EXPR _mujoco_major "${_mujoco_number} / 1000000")
      math(EXPR _mujoco_minor "${_mujoco_number} / 1000 % 1000")
      math(EXPR _mujoco_patch "${_mujoco_number} % 1000")
    else()
      string(REGEX REPLACE "^([0-9])([0-9]+)([0-9])$" "\\1" _mujoco_major "${_mujoco_number}")
      string(REGEX REPLACE "^([0-9])([0-9]+)([0-9])$" "\\2" _mujoco_minor "${_mujoco_number}")
      string(REGEX REPLACE "^([0-9])([0-9]+)([0-9])$" "\\3" _mujoco_patch "${_mujoco_number}")
    endif()
    set(MuJoCo_VERSION ${_mujoco_major}.${_mujoco_minor}.${_mujoco_patch})
    if(MuJoCo_VERSION VERSION_GREATER_EQUAL 3)
      break()
    endif()
    message(STATUS "MuJoCo ${MuJoCo_VERSION} at ${MuJoCo_LIBRARY} is too old: 3.x is needed")
  endif()
  unset(MuJoCo_INCLUDE_DIR CACHE)
  unset(MuJoCo_LIBRARY CACHE)
endforeach()

include(FindPackageHandleStandardArgs)
find_package_handle_standard_args(
  MuJoCo
  REQUIRED_VARS MuJoCo_LIBRARY MuJoCo_INCLUDE_DIR
  VERSION_VAR MuJoCo_VERSION
  REASON_FAILURE_MESSAGE "set MUJOCO_ROOT to a MuJoCo 3.x, or run scripts/setup.sh")

if(MuJoCo_FOUND AND NOT TARGET MuJoCo::MuJoCo)
  add_library(MuJoCo::MuJoCo SHARED IMPORTED)
  set_target_properties(
    MuJoCo::MuJoCo PROPERTIES IMPORTED_LOCATION ${MuJoCo_LIBRARY} INTERFACE_INCLUDE_DIRECTORIES
                                                                  ${MuJoCo_INCLUDE_DIR})
endif()
mark_as_advanced(MuJoCo_INCLUDE_DIR MuJoCo_LIBRARY)
