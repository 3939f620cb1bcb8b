# nanobind, from the wheel that nanobind.txt names by version and hash, fetched once with pip into the build folder.
# Needs the target Python of find_package(Python ... Development.Module); gives nanobind_add_module and
# nanobind_add_stub. -DFORK1S_NANOBIND_ROOT=DIR takes an unpacked one instead (DIR/cmake/nanobind-config.cmake).
set(fork1s_nanobind_pin ${CMAKE_CURRENT_LIST_DIR}/nanobind.txt)
file(STRINGS ${fork1s_nanobind_pin} fork1s_nanobind_line REGEX "^nanobind==")
string(REGEX MATCH "==([0-9.]+)" fork1s_nanobind_line "${fork1s_nanobind_line}")
set(fork1s_nanobind_version ${CMAKE_MATCH_1})

if(FORK1S_NANOBIND_ROOT)
  set(fork1s_nanobind_folder ${FORK1S_NANOBIND_ROOT})
else()
  set(fork1s_nanobind_download ${CMAKE_BINARY_DIR}/nanobind-${fork1s_nanobind_version})
  set(fork1s_nanobind_folder ${fork1s_nanobind_download}/nanobind)
  if(NOT EXISTS ${fork1s_nanobind_folder}/cmake/nanobind-config.cmake)
    message(STATUS "fork1s: fetching nanobind ${fork1s_nanobind_version} into ${fork1s_nanobind_download}")
    execute_process(COMMAND ${Python_EXECUTABLE} -m pip download --quiet --disable-pip-version-check --no-deps
        --only-binary=:all: --require-hashes --requirement ${fork1s_nanobind_pin} --dest ${fork1s_nanobind_download}
      RESULT_VARIABLE failed ERROR_VARIABLE complaint OUTPUT_VARIABLE complaint)
    if(failed)
      message(FATAL_ERROR "nanobind ${fork1s_nanobind_version} could not be fetched by pip:\n${complaint}\nSee that "
        "Python's registry can be reached, point FORK1S_NANOBIND_ROOT at an unpacked nanobind, or build without the "
        "Python module: -DFORK1S_BUILD_PYTHON=OFF")
    endif()
    file(GLOB fork1s_nanobind_wheel ${fork1s_nanobind_download}/*.whl)
    file(ARCHIVE_EXTRACT INPUT ${fork1s_nanobind_wheel} DESTINATION ${fork1s_nanobind_download})
    file(REMOVE ${fork1s_nanobind_wheel})
  endif()
endif()
find_package(nanobind ${fork1s_nanobind_version} EXACT REQUIRED CONFIG PATHS ${fork1s_nanobind_folder}/cmake
  NO_DEFAULT_PATH)
