# semblance_module(name SOURCES ... [PUBLIC ...] [PRIVATE ...])
# A static library semblance_<name> with the alias semblance::<name>, warnings on, headers in
# include/ public and src/ private. SOURCES are listed explicitly: a glob would miss a new file.
function(semblance_module name)
  cmake_parse_arguments(ARG "" "" "SOURCES;PUBLIC;PRIVATE" ${ARGN})
  set(target semblance_${name})
  add_library(${target} STATIC ${ARG_SOURCES})
  add_library(semblance::${name} ALIAS ${target})
  target_include_directories(${target}
    PUBLIC $<BUILD_INTERFACE:${CMAKE_CURRENT_SOURCE_DIR}/include>
           $<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}>
    PRIVATE ${CMAKE_CURRENT_SOURCE_DIR}/src)
  target_link_libraries(${target} PUBLIC ${ARG_PUBLIC} PRIVATE ${ARG_PRIVATE})
  target_compile_features(${target} PUBLIC cxx_std_20)
  target_compile_options(${target} PRIVATE ${SEMBLANCE_WARNINGS})
  set_target_properties(${target} PROPERTIES EXPORT_NAME ${name})
  set_property(GLOBAL APPEND PROPERTY SEMBLANCE_MODULES ${target})
  install(TARGETS ${target} EXPORT semblanceTargets ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR})
  if(EXISTS ${CMAKE_CURRENT_SOURCE_DIR}/include)
    install(DIRECTORY include/ DESTINATION ${CMAKE_INSTALL_INCLUDEDIR})
  endif()
endfunction()

set(SEMBLANCE_WARNINGS -Wall -Wextra -Wshadow -Wnon-virtual-dtor -Wno-psabi)
