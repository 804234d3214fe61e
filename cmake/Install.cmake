# cmake --install and find_package(semblance): targets semblance::core, semblance::geometry, ...
include(CMakePackageConfigHelpers)

# Which package makes an imported target. A module that links to a new library adds a line here;
# OpenCV's targets are its components.
set(package_of_Eigen3::Eigen Eigen3)
set(package_of_Ceres::ceres Ceres)
set(package_of_TBB::tbb TBB)
set(package_of_fmt::fmt fmt)
set(package_of_CLI11::CLI11 CLI11)
set(package_of_nlohmann_json::nlohmann_json nlohmann_json)
set(package_of_pugixml::pugixml pugixml)
set(package_of_tomlplusplus::tomlplusplus tomlplusplus)
set(package_of_yaml-cpp yaml-cpp)
set(package_of_TinyGLTF::TinyGLTF TinyGLTF)
set(package_of_Pagmo::pagmo Pagmo)
set(package_of_embree embree)
set(package_of_meshoptimizer::meshoptimizer meshoptimizer)
set(package_of_Threads::Threads Threads)
set(package_of_apriltag::apriltag apriltag)

# semblance_package_dependencies(PACKAGES VARIABLE OPENCV VARIABLE)
# The packages that the modules' link interfaces name. Static libraries hand on their private links
# too, so those count.
function(semblance_package_dependencies packages_variable opencv_variable)
  get_property(modules GLOBAL PROPERTY SEMBLANCE_MODULES)
  set(packages "")
  set(opencv "")
  foreach(module ${modules})
    get_target_property(links ${module} INTERFACE_LINK_LIBRARIES)
    foreach(link ${links})
      string(REGEX REPLACE "^\\$<LINK_ONLY:(.*)>$" "\\1" link "${link}")
      if(DEFINED package_of_${link})
        list(APPEND packages ${package_of_${link}})
      elseif(link MATCHES "^opencv_(.*)$")
        list(APPEND opencv ${CMAKE_MATCH_1})
      elseif(NOT link MATCHES "^semblance" AND (link MATCHES "::" OR TARGET ${link}))
        message(FATAL_ERROR "${module} links to ${link}: say in cmake/Install.cmake which package "
                            "makes it, so that an installed Semblance finds it too")
      endif()
    endforeach()
  endforeach()
  list(REMOVE_DUPLICATES packages)
  list(REMOVE_DUPLICATES opencv)
  list(SORT packages)
  list(SORT opencv)
  set(${packages_variable} ${packages} PARENT_SCOPE)
  set(${opencv_variable} ${opencv} PARENT_SCOPE)
endfunction()

semblance_package_dependencies(packages opencv)
set(SEMBLANCE_FIND_DEPENDENCIES "")
foreach(package ${packages})
  string(APPEND SEMBLANCE_FIND_DEPENDENCIES "find_dependency(${package})\n")
endforeach()
if(opencv)
  list(JOIN opencv " " components)
  string(APPEND SEMBLANCE_FIND_DEPENDENCIES "find_dependency(OpenCV COMPONENTS ${components})\n")
endif()

set(config_folder ${CMAKE_INSTALL_LIBDIR}/cmake/semblance)
configure_package_config_file(
  ${CMAKE_CURRENT_LIST_DIR}/semblanceConfig.cmake.in
  ${CMAKE_BINARY_DIR}/semblanceConfig.cmake INSTALL_DESTINATION ${config_folder})
write_basic_package_version_file(${CMAKE_BINARY_DIR}/semblanceConfigVersion.cmake
                                 COMPATIBILITY SameMinorVersion)
install(EXPORT semblanceTargets NAMESPACE semblance:: DESTINATION ${config_folder})
install(FILES ${CMAKE_BINARY_DIR}/semblanceConfig.cmake
              ${CMAKE_BINARY_DIR}/semblanceConfigVersion.cmake
        DESTINATION ${config_folder})
