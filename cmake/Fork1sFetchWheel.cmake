# fork1s_fetch_wheel(NAME): unpacks the wheel that cmake/NAME.txt names by version and hash into the build folder, fetched once
# with pip. Sets NAME_VERSION and NAME_FOLDER. INSTEAD: what a message offers where it cannot be fetched.
function(fork1s_fetch_wheel name instead)
  set(pin ${CMAKE_CURRENT_FUNCTION_LIST_DIR}/${name}.txt)
  file(STRINGS ${pin} line REGEX "^${name}==")
  string(REGEX MATCH "==([0-9.]+)" line "${line}")
  set(version ${CMAKE_MATCH_1})
  set(folder ${CMAKE_BINARY_DIR}/${name}-${version})
  if(NOT EXISTS ${folder}/unpacked)
    message(STATUS "fork1s: fetching ${name} ${version} into ${folder}")
    execute_process(COMMAND ${Python_EXECUTABLE} -m pip download --quiet --disable-pip-version-check --no-deps
        --only-binary=:all: --require-hashes --requirement ${pin} --dest ${folder}
      RESULT_VARIABLE failed ERROR_VARIABLE complaint OUTPUT_VARIABLE complaint)
    if(failed)
      message(FATAL_ERROR "${name} ${version} could not be fetched by pip:\n${complaint}\nSee that Python's registry can be "
        "reached, ${instead}, or build without the Python module: -DFORK1S_BUILD_PYTHON=OFF")
    endif()
    file(GLOB wheel ${folder}/*.whl)
    file(ARCHIVE_EXTRACT INPUT ${wheel} DESTINATION ${folder})
    file(REMOVE ${wheel})
    file(TOUCH ${folder}/unpacked)
  endif()
  set(${name}_VERSION ${version} PARENT_SCOPE)
  set(${name}_FOLDER ${folder} PARENT_SCOPE)
endfunction()
