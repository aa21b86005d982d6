# Installs core, the mapper and its networks, which need neither MuJoCo nor Open3D, for find_package(tsdfpp).
include(GNUInstallDirs)
include(CMakePackageConfigHelpers)

set(_tsdfpp_package ${CMAKE_INSTALL_LIBDIR}/cmake/tsdfpp)
foreach(room core mapper network)
  set_target_properties(tsdfpp_${room} PROPERTIES EXPORT_NAME ${room})
  target_compile_features(tsdfpp_${room} PUBLIC cxx_std_20)
endforeach()
# Headers include each other as "core/types.h", whatever folder holds the rooms.
install(DIRECTORY ${PROJECT_SOURCE_DIR}/core DESTINATION include/tsdfpp FILES_MATCHING PATTERN "*.h")
set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/mapper/public_headers.txt)
file(STRINGS ${PROJECT_SOURCE_DIR}/mapper/public_headers.txt _tsdfpp_public REGEX "^[^#]")
foreach(header ${_tsdfpp_public})
  get_filename_component(_tsdfpp_folder ${header} DIRECTORY)
  install(FILES ${PROJECT_SOURCE_DIR}/${header} DESTINATION include/tsdfpp/${_tsdfpp_folder})
endforeach()
install(TARGETS tsdfpp_core tsdfpp_mapper tsdfpp_network EXPORT tsdfppTargets ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR})
install(EXPORT tsdfppTargets NAMESPACE tsdfpp:: DESTINATION ${_tsdfpp_package})
configure_package_config_file(${PROJECT_SOURCE_DIR}/cmake/tsdfppConfig.cmake.in
                              ${PROJECT_BINARY_DIR}/tsdfppConfig.cmake INSTALL_DESTINATION ${_tsdfpp_package})
write_basic_package_version_file(${PROJECT_BINARY_DIR}/tsdfppConfigVersion.cmake COMPATIBILITY SameMinorVersion)
install(FILES ${PROJECT_BINARY_DIR}/tsdfppConfig.cmake ${PROJECT_BINARY_DIR}/tsdfppConfigVersion.cmake
        DESTINATION ${_tsdfpp_package})
