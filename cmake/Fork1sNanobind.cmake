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

# Texts of what nanobind_add_module compiles into a module, for who ships it: nanobind's own, and that of the hash map
# that it contains.
file(GLOB nanobind_license ${fork1s_nanobind_folder}/LICENSE ${fork1s_nanobind_folder}/../LICENSE
  ${fork1s_nanobind_folder}/../nanobind-*.dist-info/licenses/LICENSE)
file(READ ${fork1s_nanobind_folder}/ext/robin_map/include/tsl/robin_map.h robin_map_license)
string(REGEX MATCH "^/\\*.*SOFTWARE\\.\n \\*/" robin_map_license "${robin_map_license}")
if(nanobind_license STREQUAL "" OR robin_map_license STREQUAL "")
  message(FATAL_ERROR "${fork1s_nanobind_folder}: no license of nanobind or of its robin_map; unpack a whole wheel of nanobind")
endif()
file(WRITE ${PROJECT_BINARY_DIR}/licenses/robin_map.txt "${robin_map_license}\n")
configure_file(${nanobind_license} ${PROJECT_BINARY_DIR}/licenses/nanobind.txt COPYONLY)
