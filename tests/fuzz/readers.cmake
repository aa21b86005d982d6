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
      address_space.cc
      data_folder.cc
      exr_header.cc
      files.cc
      folders.cc
      gltf_document.cc
      gltf_reader.cc
      gltf_writer.cc
      guard.cc
      image_header.cc
      json_text.cc
      limits.cc
      one_line.cc
      plain_name.cc
      ply.cc
      ply_header.cc
      polygon.cc
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
      models/blob_shapes.cc
      config/camera_config.cc
      config/camera_path.cc
      config/light_rig.cc
      models/mesh_import.cc
      models/mesh_repair.cc
      models/mesh_shapes.cc
      models/model_catalogue.cc
      models/obj_materials.cc
      models/obj_reader.cc
      config/object_motion.cc
      models/profile_shapes.cc
      config/random_scene_config.cc
      models/room_model.cc
      config/scene_config.cc
      config/scene_folder.cc
      scene/scene_inputs.cc
      config/scene_object_config.cc
      config/scene_readers.cc
      config/scene_toml.cc
      config/sensor_config.cc
      config/sensor_presets.cc
      config/spline.cc
      models/stl_reader.cc
      models/textures.cc
      models/toy_models.cc
      models/toys_buildings.cc
      models/toys_figures.cc
      models/toys_solids.cc
      models/toys_vessels.cc
      config/trajectory_folder.cc)
  set(eval
      adapters/adapter.cc
      tools/base64.cc
      sweep/bench_result.cc
      sweep/bench_set.cc
      sweep/cell.cc
      score/coco_panoptic.cc
      run/compare_names.cc
      score/evaluation_columns.cc
      score/evaluation_json.cc
      score/evaluate_panoptic.cc
      sweep/experiment.cc
      run/folder_lock.cc
      gate/axis_choice.cc
      gate/gate_config.cc
      gate/gate_reference.cc
      gate/gate_verdict.cc
      score/label_image.cc
      picture/map_output.cc
      score/mesh_matching.cc
      report/recording.cc
      report/report_gates.cc
      run/run_folder.cc
      sweep/sabotage.cc
      score/surface_file.cc
      sweep/sweep_metrics.cc
      sweep/sweep_settings.cc)
  set(metrics segmentation.cc statistics.cc tracking_quality.cc)
  set(cli command.cc metric.cc metric_panoptic.cc)
  set(targets configs meshes results sequences text)
  if(ARG_WITHOUT_MAPS)
    set(mapper associate/mask_repair_config.cc map_config.cc method_info.cc segment/segmentation.cc track/tracker.cc)
    target_compile_definitions(${target} PRIVATE TSDFPP_FUZZ_MAPS=0)
  else()
    list(APPEND targets map)
    file(GLOB_RECURSE mapper RELATIVE ${PROJECT_SOURCE_DIR}/mapper ${PROJECT_SOURCE_DIR}/mapper/*.cc)
    list(REMOVE_ITEM mapper pipeline.cc pipeline_remarks.cc track/icp_registration.cc track/pcl_icp.cc)
    list(FILTER mapper EXCLUDE REGEX "^network/")
  endif()
  if(NOT ARG_STAND_IN)
    list(APPEND core decode_image.cc image_codecs.cc late_library.cc)
  endif()
  foreach(room core sequence sim eval metrics cli mapper)
    foreach(source ${${room}})
      target_sources(${target} PRIVATE ${PROJECT_SOURCE_DIR}/${room}/${source})
    endforeach()
  endforeach()
  list(TRANSFORM targets REPLACE "(.+)" "targets_\\1.cc" OUTPUT_VARIABLE sources)
  list(APPEND sources complaint.cc file_set.cc targets.cc)
  if(ARG_STAND_IN)
    list(APPEND sources decode_image_stand_in.cc)
  endif()
  list(TRANSFORM sources PREPEND ${fuzz_folder}/)
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
    add_dependencies(${target} tsdfpp_image_codecs)
    target_link_libraries(${target} PRIVATE ${TSDFPP_FIND_LATE} ${CMAKE_DL_LIBS})
  endif()
endfunction()
