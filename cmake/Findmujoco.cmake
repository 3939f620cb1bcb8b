# MuJoCo as the target mujoco::mujoco, for find_package(mujoco): the first of
#   MUJOCO_ROOT             a folder with include/mujoco/mujoco.h and libmujoco.so*, in it or in its lib/
#   fork1s_mujoco_beside    the folder where the install of fork1s put the one it was built with (fork1sConfig.cmake)
#   a system's own          by its CMake files, if it is of the version in mujoco.txt or newer
#   the wheel               that mujoco.txt names, by version and hash, fetched with pip into the build folder
# Sets mujoco_VERSION, mujoco_LIBRARY, mujoco_PLUGINS, mujoco_INCLUDE_DIR and mujoco_LICENSE.
if(TARGET mujoco::mujoco)
  set(mujoco_FOUND TRUE)
  return()
endif()

set(fork1s_mujoco_pin ${CMAKE_CURRENT_LIST_DIR}/mujoco.txt)
file(STRINGS ${fork1s_mujoco_pin} fork1s_mujoco_line REGEX "^mujoco-core==")
string(REGEX MATCH "==([0-9.]+)" fork1s_mujoco_line "${fork1s_mujoco_line}")
set(fork1s_mujoco_wanted ${CMAKE_MATCH_1})

# Whether FOLDER holds a MuJoCo; makes the target of it.
function(fork1s_take_mujoco folder)
  if(NOT EXISTS ${folder}/include/mujoco/mujoco.h)
    return()
  endif()
  file(GLOB libraries ${folder}/libmujoco.so* ${folder}/lib/libmujoco.so* ${folder}/libmujoco*.dylib)
  if(NOT libraries)
    return()
  endif()
  list(GET libraries 0 library)
  file(STRINGS ${folder}/include/mujoco/mujoco.h header REGEX "define mjVERSION_HEADER|define mjVERSION ")
  string(REGEX MATCH "[0-9]+$" number "${header}")
  if(number LESS 1000000)  # 3.3.7 was written 337, 4.0.1 is 4000001
    string(REGEX REPLACE "^(.)(.*)(.)$" "\\1.\\2.\\3" version "${number}")
  else()
    math(EXPR major "${number} / 1000000")
    math(EXPR minor "${number} / 1000 % 1000")
    math(EXPR patch "${number} % 1000")
    set(version ${major}.${minor}.${patch})
  endif()
  if(version VERSION_LESS fork1s_mujoco_wanted)
    message(STATUS "fork1s: MuJoCo ${version} in ${folder} is older than ${fork1s_mujoco_wanted}; not taken")
    return()
  endif()
  file(GLOB license ${folder}/LICENSE* ${folder}/licenses/LICENSE*)
  add_library(mujoco::mujoco SHARED IMPORTED GLOBAL)
  set_target_properties(mujoco::mujoco PROPERTIES IMPORTED_LOCATION ${library}
    INTERFACE_INCLUDE_DIRECTORIES ${folder}/include INTERFACE_SYSTEM_INCLUDE_DIRECTORIES ${folder}/include)
  set(mujoco_LIBRARY ${library} PARENT_SCOPE)
  if(EXISTS ${folder}/plugin)
    set(mujoco_PLUGINS ${folder}/plugin PARENT_SCOPE)
  endif()
  set(mujoco_INCLUDE_DIR ${folder}/include PARENT_SCOPE)
  set(mujoco_LICENSE "${license}" PARENT_SCOPE)
  set(mujoco_VERSION ${version} PARENT_SCOPE)
endfunction()

# The wheel, unpacked under the build folder; fetched once.
function(fork1s_fetch_mujoco folder)
  find_program(FORK1S_PYTHON NAMES python3 python)
  if(NOT FORK1S_PYTHON)
    message(FATAL_ERROR "MuJoCo ${fork1s_mujoco_wanted} comes from Python's registry, and there is no python3: install "
      "python3 and python3-pip, or point MUJOCO_ROOT at a MuJoCo (include/mujoco/mujoco.h, libmujoco.so)")
  endif()
  message(STATUS "fork1s: fetching MuJoCo ${fork1s_mujoco_wanted} (10 MB) into ${folder}")
  string(TOLOWER "${CMAKE_HOST_SYSTEM_PROCESSOR}" processor)
  set(platforms)
  foreach(version 2_28 2_27)
    list(APPEND platforms --platform manylinux_${version}_${processor})
  endforeach()
  execute_process(COMMAND ${FORK1S_PYTHON} -m pip download --quiet --disable-pip-version-check --no-deps
      --only-binary=:all: --implementation cp --python-version 3.11 ${platforms} --require-hashes
      --requirement ${fork1s_mujoco_pin} --dest ${folder}/wheel
    RESULT_VARIABLE failed ERROR_VARIABLE complaint OUTPUT_VARIABLE complaint)
  if(failed)
    message(FATAL_ERROR "MuJoCo ${fork1s_mujoco_wanted} could not be fetched by pip:\n${complaint}\nInstall python3-pip "
      "and see that Python's registry can be reached, or point MUJOCO_ROOT at a MuJoCo "
      "(include/mujoco/mujoco.h, libmujoco.so)")
  endif()
  file(GLOB wheel ${folder}/wheel/mujoco_core-*.whl)
  file(ARCHIVE_EXTRACT INPUT ${wheel} DESTINATION ${folder}/wheel
    PATTERNS "mujoco/include/*" "mujoco/libmujoco*" "mujoco/plugin/libactuator*" "*.dist-info/licenses/*")
  file(GLOB parts ${folder}/wheel/mujoco/* ${folder}/wheel/*.dist-info/licenses/*)
  file(COPY ${parts} DESTINATION ${folder})
  file(REMOVE_RECURSE ${folder}/wheel)
endfunction()

if(MUJOCO_ROOT)
  fork1s_take_mujoco(${MUJOCO_ROOT})
  if(NOT TARGET mujoco::mujoco)
    message(FATAL_ERROR "MUJOCO_ROOT=${MUJOCO_ROOT} holds no MuJoCo ${fork1s_mujoco_wanted} or newer: "
      "include/mujoco/mujoco.h and libmujoco.so are looked for there")
  endif()
endif()
if(NOT TARGET mujoco::mujoco AND fork1s_mujoco_beside)
  fork1s_take_mujoco(${fork1s_mujoco_beside})
endif()
if(NOT TARGET mujoco::mujoco)
  find_package(mujoco ${fork1s_mujoco_wanted} CONFIG QUIET GLOBAL)
endif()
if(NOT TARGET mujoco::mujoco)
  set(fork1s_mujoco_folder ${CMAKE_BINARY_DIR}/mujoco-${fork1s_mujoco_wanted})
  if(NOT EXISTS ${fork1s_mujoco_folder}/include/mujoco/mujoco.h)
    fork1s_fetch_mujoco(${fork1s_mujoco_folder})
  endif()
  fork1s_take_mujoco(${fork1s_mujoco_folder})
endif()

include(FindPackageHandleStandardArgs)
find_package_handle_standard_args(mujoco REQUIRED_VARS mujoco_VERSION VERSION_VAR mujoco_VERSION)
