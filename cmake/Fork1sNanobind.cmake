# nanobind, from the wheel that nanobind.txt names. Needs the target Python of find_package(Python ... Development.Module);
# gives nanobind_add_module and nanobind_add_stub. -DFORK1S_NANOBIND_ROOT=DIR takes an unpacked one of the same version
# instead (DIR/cmake/nanobind-config.cmake).
include(Fork1sFetchWheel)
if(FORK1S_NANOBIND_ROOT)
  set(fork1s_nanobind_folder ${FORK1S_NANOBIND_ROOT})
  file(STRINGS ${CMAKE_CURRENT_LIST_DIR}/nanobind.txt nanobind_VERSION REGEX "^nanobind==")
  string(REGEX REPLACE "^nanobind==([0-9.]+).*" "\\1" nanobind_VERSION "${nanobind_VERSION}")
else()
  fork1s_fetch_wheel(nanobind "point FORK1S_NANOBIND_ROOT at an unpacked nanobind")
  set(fork1s_nanobind_folder ${nanobind_FOLDER}/nanobind)
endif()
find_package(nanobind ${nanobind_VERSION} EXACT REQUIRED CONFIG PATHS ${fork1s_nanobind_folder}/cmake NO_DEFAULT_PATH)
