# Puts MuJoCo's library into a Python package under a name of its own, with names of its own for its functions:
#   FOLDER/lib/libfork1s_mujoco.so.VERSION, lib/plugin/libactuator.so, and the licenses
# so that it neither takes the place of the library of Python's package mujoco nor binds to it, in whatever order and by
# whatever flags of the loader the two are loaded into one process. USERS, files below FOLDER, are made to use it.
#
# A script, for the build tree and for an install. Given: FOLDER, LIBRARY, PLUGINS, LICENSES, NM, PATCHELF, USERS.
function(run)
  execute_process(COMMAND ${ARGN} COMMAND_ERROR_IS_FATAL ANY OUTPUT_VARIABLE output OUTPUT_STRIP_TRAILING_WHITESPACE)
  set(output "${output}" PARENT_SCOPE)
endfunction()

file(REAL_PATH ${FOLDER} FOLDER)  # the prefix may be relative
file(REAL_PATH ${LIBRARY} library)
run(${PATCHELF} --print-soname ${library})
set(soname ${output})
string(REGEX REPLACE "^lib" "libfork1s_" private ${soname})
file(MAKE_DIRECTORY ${FOLDER}/lib/plugin)
configure_file(${library} ${FOLDER}/lib/${private} COPYONLY)
if(LICENSES)
  file(COPY ${LICENSES} DESTINATION ${FOLDER}/lib)
endif()
set(users)
foreach(user ${USERS})
  list(APPEND users ${FOLDER}/${user})
endforeach()
if(EXISTS ${PLUGINS}/libactuator.so)  # the one whose law the importer reads
  file(COPY ${PLUGINS}/libactuator.so DESTINATION ${FOLDER}/lib/plugin)
  list(APPEND users ${FOLDER}/lib/plugin/libactuator.so)
endif()

run(${NM} --dynamic --defined-only --format=posix ${library})
string(REGEX REPLACE "(^|\n)([^ \n@]+)[^\n]*" "\\1\\2 fork1s_\\2" names "${output}")
set(map ${FOLDER}/lib/names.txt)
file(WRITE ${map} "${names}\n")
run(${PATCHELF} --set-soname ${private} --remove-rpath --rename-dynamic-symbols ${map} ${FOLDER}/lib/${private})
foreach(user ${users})
  cmake_path(GET user PARENT_PATH folder)
  file(RELATIVE_PATH to_library ${folder} ${FOLDER}/lib)
  run(${PATCHELF} --replace-needed ${soname} ${private} --rename-dynamic-symbols ${map} --set-rpath "$ORIGIN/${to_library}"
    ${user})
endforeach()
file(REMOVE ${map})
