# Puts into FOLDER what a functional mock-up unit needs at run time: its program, in lib/ the libraries that it needs, MuJoCo's
# under a name of its own (CarryMujoco.cmake), and in licenses/ the licenses of all of them. What every Linux with a program
# compiled from C++ has is not carried.
#
# A script. Given: FOLDER, PROGRAM, LIBRARY, NM, PATCHELF (CarryMujoco.cmake), LICENSE_FILES (NAME=FILE), PACKAGES, Debian's of
# what is compiled from headers.
file(REMOVE_RECURSE ${FOLDER})
file(MAKE_DIRECTORY ${FOLDER}/lib ${FOLDER}/licenses)
cmake_path(GET PROGRAM FILENAME name)
configure_file(${PROGRAM} ${FOLDER}/${name} COPYONLY)
file(GET_RUNTIME_DEPENDENCIES LIBRARIES ${PROGRAM} RESOLVED_DEPENDENCIES_VAR needed UNRESOLVED_DEPENDENCIES_VAR missing
  PRE_EXCLUDE_REGEXES "^lib(c|m|dl|rt|pthread|stdc\\+\\+|gcc_s|mujoco)\\.so" "^ld-linux")
if(missing)
  message(FATAL_ERROR "CarryFmu: ${PROGRAM} needs ${missing}, which are nowhere to be found")
endif()
find_program(DPKG dpkg)
set(packages ${PACKAGES})
foreach(library ${needed})
  cmake_path(GET library FILENAME file)
  file(REAL_PATH ${library} real)
  configure_file(${real} ${FOLDER}/lib/${file} COPYONLY)
  execute_process(COMMAND ${PATCHELF} --set-rpath "$ORIGIN" ${FOLDER}/lib/${file} COMMAND_ERROR_IS_FATAL ANY)
  set(owner "")
  if(DPKG)
    cmake_path(GET real FILENAME real_file)
    execute_process(COMMAND ${DPKG} -S "*/${real_file}" OUTPUT_VARIABLE owner ERROR_QUIET)
    string(REGEX MATCH "^[^:,]+" owner "${owner}")
  endif()
  if(owner STREQUAL "")
    message(FATAL_ERROR "CarryFmu: no Debian package has ${real}, so that its license is unknown; "
      "build with -DFORK1S_BUILD_FMU=OFF, or on Debian")
  endif()
  list(APPEND packages ${owner})
endforeach()
foreach(package ${packages})
  set(notice /usr/share/doc/${package}/copyright)
  if(NOT EXISTS ${notice})
    message(FATAL_ERROR "CarryFmu: ${notice} is missing, the license of what a unit carries; reinstall ${package}, or build "
      "with -DFORK1S_BUILD_FMU=OFF")
  endif()
  configure_file(${notice} ${FOLDER}/licenses/${package}.txt COPYONLY)
endforeach()
foreach(entry ${LICENSE_FILES})
  string(REGEX MATCH "^([^=]+)=(.+)$" entry "${entry}")
  configure_file(${CMAKE_MATCH_2} ${FOLDER}/licenses/${CMAKE_MATCH_1}.txt COPYONLY)
endforeach()
set(USERS ${name})
include(${CMAKE_CURRENT_LIST_DIR}/CarryMujoco.cmake)
