# semblance_fuzzer(name SOURCES ... LINK ... CORPUS folder)
# A libFuzzer program fuzz_<name> that starts from the files of CORPUS. CTest runs it for some seconds under the label fuzz; longer runs
# are started by hand (docs/building.md).
if(NOT CMAKE_CXX_COMPILER_ID MATCHES "Clang")
  message(FATAL_ERROR "SEMBLANCE_FUZZERS needs Clang: configure with cmake --preset fuzz")
endif()
function(semblance_fuzzer name)
  cmake_parse_arguments(ARG "" "CORPUS" "SOURCES;LINK" ${ARGN})
  add_executable(fuzz_${name} ${ARG_SOURCES})
  target_link_libraries(fuzz_${name} PRIVATE ${ARG_LINK})
  target_compile_options(fuzz_${name} PRIVATE ${SEMBLANCE_WARNINGS})
  target_link_options(fuzz_${name} PRIVATE -fsanitize=fuzzer)
  # libFuzzer keeps the inputs that reached new code in this folder, and what broke beside them.
  set(found ${CMAKE_CURRENT_BINARY_DIR}/found_${name})
  file(MAKE_DIRECTORY ${found})
  add_test(NAME fuzz_${name} COMMAND fuzz_${name} -max_total_time=20 -timeout=10 -rss_limit_mb=2048
           -artifact_prefix=${found}/ ${found} ${ARG_CORPUS})
  set_tests_properties(fuzz_${name} PROPERTIES LABELS fuzz TIMEOUT 120)
endfunction()
