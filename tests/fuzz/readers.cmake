# tsdfpp_add_readers(<target> [WITHOUT_MAPS] [STAND_IN]): gives the target the fuzz targets (tests/fuzz/targets*.cc)
# and the sources of all readers that they call, without the rooms' other sources, which take long to build. What those
# call beyond is not linked, because sections that nothing reaches are left out.
# WITHOUT_MAPS: all fuzz targets but that of saved maps, which needs the whole mapper. STAND_IN: images are not decoded by OpenCV's
# codecs (decode_image_stand_in.cc).
set(fuzz_folder ${CMAKE_CURRENT_LIST_DIR})
find_package(MuJoCo 3 REQUIRED) # its headers
find_package(CLI11 2.1 REQUIRED)
find_package(hwy 1.0 REQUIRED QUIET)
find_package(spdlog REQUIRED)
find_package(ZLIB REQUIRED QUIET)
find_library(TSDFPP_LIBDEFLATE deflate REQUIRED)

function(tsdfpp_add_readers target)
  cmake_parse_arguments(ARG "WITHOUT_MAPS;STAND_IN" "" "" ${ARGN})
  set(core
      data_folder.cc
      exr_header.cc
      files.cc
      folders.cc
      gltf_document.cc
      gltf_reader.cc
      gltf_writer.cc
      image_header.cc
      json_text.cc
      limits.cc
      one_line.cc
      plain_name.cc
      ply.cc
      pose_text.cc
      quiet_stderr.cc
      toml_reader.cc)
  set(sequence
      bop_instances.cc
      bop_reader.cc
      calibration.cc
      cofusion_layout.cc
      cofusion_reader.cc
      dataset_format.cc
      file_source.cc
      image_files.cc
      integer_images.cc
      klg_layout.cc
      klg_reader.cc
      open_sequence.cc
      plausibility.cc
      pose_matrix.cc
      replica_reader.cc
      resample.cc
      scannet_reader.cc
      sequence_json.cc
      sevenscenes_reader.cc
      text_lines.cc
      timed_poses.cc
      trajectory_file.cc
      tum_reader.cc)
  set(sim
      blob_shapes.cc
      camera_config.cc
      camera_path.cc
      light_rig.cc
      mesh_import.cc
      mesh_repair.cc
      mesh_shapes.cc
      model_catalogue.cc
      obj_reader.cc
      object_motion.cc
      profile_shapes.cc
      random_scene_config.cc
      room_model.cc
      scene_config.cc
      scene_folder.cc
      scene_inputs.cc
      scene_object_config.cc
      scene_readers.cc
      scene_toml.cc
      sensor_config.cc
      sensor_presets.cc
      spline.cc
      stl_reader.cc
      textures.cc
      toy_models.cc
      toys_buildings.cc
      toys_figures.cc
      toys_solids.cc
      toys_vessels.cc
      trajectory_folder.cc)
  set(eval
      adapter.cc
      base64.cc
      bench_set.cc
      cell.cc
      compare_names.cc
      evaluation_columns.cc
      evaluation_json.cc
      experiment.cc
      folder_lock.cc
      gate_config.cc
      gate_reference.cc
      gate_verdict.cc
      label_image.cc
      map_output.cc
      mesh_matching.cc
      recording.cc
      report_gates.cc
      run_folder.cc
      sabotage.cc
      surface_file.cc
      sweep_metrics.cc
      sweep_settings.cc)
  set(metrics segmentation.cc statistics.cc tracking_quality.cc)
  set(cli command.cc metric.cc metric_panoptic.cc)
  set(targets configs meshes results sequences text)
  if(ARG_WITHOUT_MAPS)
    set(mapper map_config.cc pipeline.cc)
    target_compile_definitions(${target} PRIVATE TSDFPP_FUZZ_MAPS=0)
  else()
    list(APPEND targets map)
    file(GLOB mapper RELATIVE ${PROJECT_SOURCE_DIR}/mapper ${PROJECT_SOURCE_DIR}/mapper/*.cc)
    list(REMOVE_ITEM mapper icp_tracker.cc)
  endif()
  if(NOT ARG_STAND_IN)
    list(APPEND core decode_image.cc)
  endif()
  # Files are compiled together as the rooms have it, four that follow one another; the mapper's one by one, as there.
  foreach(room core sequence sim eval metrics cli mapper)
    file(
      GLOB all
      RELATIVE ${PROJECT_SOURCE_DIR}/${room}
      ${PROJECT_SOURCE_DIR}/${room}/*.cc)
    foreach(source ${${room}})
      set(file ${PROJECT_SOURCE_DIR}/${room}/${source})
      target_sources(${target} PRIVATE ${file})
      list(FIND all ${source} index)
      math(EXPR group "${index} / 4")
      if("${room}" STREQUAL "mapper")
        set_source_files_properties(${file} PROPERTIES SKIP_UNITY_BUILD_INCLUSION ON)
      else()
        set_source_files_properties(${file} PROPERTIES UNITY_GROUP readers_${room}_${group})
      endif()
    endforeach()
  endforeach()
  list(TRANSFORM targets REPLACE "(.+)" "targets_\\1.cc" OUTPUT_VARIABLE sources)
  list(APPEND sources complaint.cc file_set.cc targets.cc)
  if(ARG_STAND_IN)
    list(APPEND sources decode_image_stand_in.cc)
  endif()
  list(TRANSFORM sources PREPEND ${fuzz_folder}/)
  set_source_files_properties(${sources} PROPERTIES UNITY_GROUP fuzz_targets)
  target_sources(${target} PRIVATE ${sources})
  target_include_directories(${target} PRIVATE ${PROJECT_SOURCE_DIR})
  target_compile_definitions(${target} PRIVATE TSDFPP_VERSION="${PROJECT_VERSION}")
  target_compile_options(${target} PRIVATE -ffunction-sections -fdata-sections)
  target_link_options(${target} PRIVATE -Wl,--gc-sections,-z,start-stop-gc)
  target_link_libraries(
    ${target}
    PRIVATE CLI11::CLI11
            Eigen3::Eigen
            fmt::fmt
            hwy::hwy
            nlohmann_json::nlohmann_json
            opencv_core
            opencv_imgproc
            spdlog::spdlog
            TBB::tbb
            tomlplusplus::tomlplusplus
            ZLIB::ZLIB)
  target_include_directories(${target} SYSTEM PRIVATE $<TARGET_PROPERTY:MuJoCo::MuJoCo,INTERFACE_INCLUDE_DIRECTORIES>)
  if(NOT ARG_STAND_IN)
    target_link_libraries(${target} PRIVATE opencv_imgcodecs)
  endif()
endfunction()
