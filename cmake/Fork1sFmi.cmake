# The C headers of FMI, from the wheel that fmpy.txt names. Sets FORK1S_FMI_HEADERS, a folder with fmi2Functions.h and
# fmi3Functions.h; -DFORK1S_FMI_HEADERS=DIR takes others. Their license becomes licenses/fmi.txt in the build folder.
include(Fork1sFetchWheel)
if(NOT FORK1S_FMI_HEADERS)
  fork1s_fetch_wheel(fmpy "point FORK1S_FMI_HEADERS at a folder with the headers of FMI 2.0 and 3.0")
  set(FORK1S_FMI_HEADERS ${fmpy_FOLDER}/fmpy/c-code)
endif()
file(READ ${FORK1S_FMI_HEADERS}/fmi3Functions.h fork1s_fmi_license)
string(REGEX MATCH "Copyright.*----\n" fork1s_fmi_license "${fork1s_fmi_license}")
if(fork1s_fmi_license STREQUAL "")
  message(FATAL_ERROR "${FORK1S_FMI_HEADERS}/fmi3Functions.h has no license; take the headers of the FMI standard as they are")
endif()
file(WRITE ${PROJECT_BINARY_DIR}/licenses/fmi.txt "${fork1s_fmi_license}")
