# One library a room: fork1s_module(NAME [SEPARATE] [OUTER] [SHARED] SOURCES ... ROOMS ... LIBRARIES ...).
# ROOMS are the rooms it may include; LIBRARIES are foreign and stay private to it. A room's files are compiled
# together, which for most takes a fraction of the time; SEPARATE for rooms where it does not. OUTER for rooms that no
# step runs through: they read, write and serve, and are compiled to be built soon rather than to run fast. SHARED for a
# library that programs load as it is: it has all rooms in itself, and whoever links it gets its headers alone.
include(CheckCXXSourceRuns)

if(FORK1S_ARCH STREQUAL "auto")
  # Eigen's alignment depends on the instruction set, so the choice travels with the installed targets.
  set(CMAKE_REQUIRED_FLAGS "-march=x86-64-v3")
  check_cxx_source_runs("#include <immintrin.h>
    int main() { __m256d a = _mm256_set1_pd(1.0); a = _mm256_fmadd_pd(a, a, a);
                 return __builtin_cpu_supports(\"avx2\") && _mm256_cvtsd_f64(a) == 2.0 ? 0 : 1; }"
    FORK1S_RUNS_X86_64_V3)
  unset(CMAKE_REQUIRED_FLAGS)
  if(FORK1S_RUNS_X86_64_V3)
    set(FORK1S_ARCH_FLAG "-march=x86-64-v3")
  else()
    message(STATUS "fork1s: this machine does not run x86-64-v3; building for the compiler's default")
    set(FORK1S_ARCH_FLAG "")
  endif()
elseif(FORK1S_ARCH)
  set(FORK1S_ARCH_FLAG "-march=${FORK1S_ARCH}")
endif()

add_library(fork1s_options INTERFACE)
target_compile_features(fork1s_options INTERFACE cxx_std_20)
target_compile_options(fork1s_options INTERFACE ${FORK1S_ARCH_FLAG})
target_link_libraries(fork1s_options INTERFACE Eigen3::Eigen tl::expected Threads::Threads)
set_target_properties(fork1s_options PROPERTIES EXPORT_NAME options)

add_library(fork1s_warnings INTERFACE)
target_compile_options(fork1s_warnings INTERFACE -Wall -Wextra -Wpedantic -Wshadow -Wconversion
  -Wno-sign-conversion)
if(FORK1S_WERROR)
  target_compile_options(fork1s_warnings INTERFACE -Werror)
endif()
# GCC collects its garbage less often. stepping, then the largest room: 72 -> 68 and 78 -> 69 CPU seconds in two tries, for
# 2.0 GB instead of 1.7.
set(fork1s_pch_preprocess "")
if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
  target_compile_options(fork1s_warnings INTERFACE -Wno-maybe-uninitialized -Wno-array-bounds
    --param=ggc-min-heapsize=800000)
  set(fork1s_pch_preprocess -fpch-preprocess)  # so that ccache sees through it
endif()
if(FORK1S_SANITIZE)
  # All but targets with the property FORK1S_UNSANITIZED.
  target_compile_options(fork1s_options INTERFACE "$<$<NOT:$<BOOL:$<TARGET_PROPERTY:FORK1S_UNSANITIZED>>>:\
-fsanitize=${FORK1S_SANITIZE};-fno-sanitize-recover=undefined;-fno-omit-frame-pointer>")
  if(FORK1S_SANITIZE_SKIP)
    target_compile_options(fork1s_options INTERFACE
      "$<$<NOT:$<BOOL:$<TARGET_PROPERTY:FORK1S_UNSANITIZED>>>:-fno-sanitize=${FORK1S_SANITIZE_SKIP}>")
  endif()
  target_link_options(fork1s_options INTERFACE -fsanitize=${FORK1S_SANITIZE})
endif()
if(FORK1S_FUZZ)
  # libFuzzer follows which branches an input takes. Eigen counts on from null where a matrix is empty, and reads nothing
  # there: clang alone calls that an error.
  target_compile_options(fork1s_options INTERFACE
    "$<$<NOT:$<BOOL:$<TARGET_PROPERTY:FORK1S_UNSANITIZED>>>:-fsanitize=fuzzer-no-link;-fno-sanitize=pointer-overflow>")
endif()

# fork1s_precompile(NAME HEADER [LIBRARIES ...]): the header, compiled once for all targets that share it.
function(fork1s_precompile name header)
  if(NOT FORK1S_PCH)
    return()
  endif()
  cmake_parse_arguments(ARG "" "" "LIBRARIES;OPTIONS" ${ARGN})
  set(stub ${CMAKE_CURRENT_BINARY_DIR}/${name}.cpp)
  file(CONFIGURE OUTPUT ${stub} CONTENT "// Nothing but the header.\n")
  add_library(${name} OBJECT ${stub})
  target_link_libraries(${name} PRIVATE fork1s_options fork1s_warnings ${ARG_LIBRARIES})
  target_compile_options(${name} PRIVATE ${fork1s_pch_preprocess} ${ARG_OPTIONS})
  target_precompile_headers(${name} PRIVATE ${CMAKE_CURRENT_SOURCE_DIR}/${header})
endfunction()

# Compiles a target's files as those of an outer room.
set(FORK1S_OUTER_OPTIONS $<$<CONFIG:Release>:-O1>)
set(FORK1S_PLAIN_OPTIONS $<$<CONFIG:Release>:-O0>)
function(fork1s_compile_outer target)
  set_target_properties(${target} PROPERTIES FORK1S_OUTER ON)
  target_compile_options(${target} PRIVATE ${FORK1S_OUTER_OPTIONS})
  fork1s_compile_together(${target} fork1s_precompiled_outer ${ARGN})
endfunction()

# Compiles a program's files without optimisation, which takes two thirds of the time that -O1 takes.
function(fork1s_compile_plain target)
  target_compile_options(${target} PRIVATE ${FORK1S_PLAIN_OPTIONS})
  fork1s_compile_together(${target} fork1s_precompiled_tests ${ARGN})
  fork1s_link_rooms_first(${target})
endfunction()

# Of an inline function that several files compile the linker keeps the copy that comes first. So that this is the
# optimised one of the rooms and never the target's, whose last bits may be others (each level of optimisation fuses other
# multiply-adds), the rooms are linked whole and before its own files, the inner ones first. INNER: of the outer ones only
# what it uses.
function(fork1s_link_rooms_first target)
  cmake_parse_arguments(ARG "INNER" "" "" ${ARGN})
  if(NOT CMAKE_CXX_COMPILER_ID MATCHES "GNU|Clang" OR APPLE)
    return()
  endif()
  fork1s_rooms_under(${target} rooms)
  set(inner "")
  set(outer "")
  foreach(room ${rooms})
    get_target_property(is_outer ${room} FORK1S_OUTER)
    if(is_outer AND ARG_INNER)
      continue()
    elseif(is_outer)
      list(APPEND outer $<TARGET_FILE:${room}>)
    else()
      list(APPEND inner $<TARGET_FILE:${room}>)
    endif()
  endforeach()
  target_link_options(${target} PRIVATE -Wl,--whole-archive ${inner} ${outer} -Wl,--no-whole-archive)
endfunction()

# The static libraries of this project that a target is linked with, each once.
function(fork1s_rooms_under target out)
  set(found "")
  get_target_property(waiting ${target} LINK_LIBRARIES)
  while(waiting)
    list(POP_FRONT waiting next)
    string(REGEX REPLACE "^\\$<LINK_ONLY:(.*)>$" "\\1" next "${next}")
    if(NOT TARGET "${next}" OR NOT next MATCHES "^fork1s_" OR next IN_LIST found)
      continue()
    endif()
    get_target_property(type ${next} TYPE)
    if(type STREQUAL STATIC_LIBRARY)
      list(APPEND found ${next})
    endif()
    get_target_property(more ${next} INTERFACE_LINK_LIBRARIES)
    if(more)
      list(APPEND waiting ${more})
    endif()
  endwhile()
  set(${out} ${found} PARENT_SCOPE)
endfunction()

# Compiles a target's files together, with the precompiled header of the given name. SEPARATE: each file alone.
function(fork1s_compile_together target precompiled)
  cmake_parse_arguments(ARG "SEPARATE" "" "" ${ARGN})
  if(FORK1S_SANITIZE)  # where all rooms have one level of optimisation
    set(precompiled fork1s_precompiled_outer)
  endif()
  if(FORK1S_UNITY AND NOT ARG_SEPARATE)
    set_target_properties(${target} PROPERTIES UNITY_BUILD ON UNITY_BUILD_BATCH_SIZE 0)
  endif()
  if(FORK1S_PCH)
    # A precompiled header serves only files compiled for the same kind of code, so programs are made of
    # position-independent code as libraries are.
    get_target_property(type ${target} TYPE)
    if(type STREQUAL EXECUTABLE)
      set_target_properties(${target} PROPERTIES POSITION_INDEPENDENT_CODE OFF)
      target_compile_options(${target} PRIVATE -fPIC)
    endif()
    target_compile_options(${target} PRIVATE ${fork1s_pch_preprocess} -Winvalid-pch)
    target_precompile_headers(${target} REUSE_FROM ${precompiled})
  endif()
endfunction()

set(FORK1S_ROOMS "" CACHE INTERNAL "")

function(fork1s_module name)
  cmake_parse_arguments(ARG "SEPARATE;OUTER;SHARED" "" "SOURCES;ROOMS;LIBRARIES" ${ARGN})
  if(ARG_SOURCES)
    if(ARG_SHARED)
      add_library(fork1s_${name} SHARED ${ARG_SOURCES})
      target_include_directories(fork1s_${name} INTERFACE ${PROJECT_SOURCE_DIR}/include)
      set(scope PRIVATE)
    else()
      add_library(fork1s_${name} STATIC ${ARG_SOURCES})
      set(scope PUBLIC)
    endif()
    if(ARG_OUTER)
      fork1s_compile_outer(fork1s_${name})
    elseif(ARG_SEPARATE)
      fork1s_compile_together(fork1s_${name} fork1s_precompiled SEPARATE)
    else()
      fork1s_compile_together(fork1s_${name} fork1s_precompiled)
    endif()
    target_link_libraries(fork1s_${name} PRIVATE $<BUILD_INTERFACE:fork1s_warnings> ${ARG_LIBRARIES})
  else()
    add_library(fork1s_${name} INTERFACE)
    set(scope INTERFACE)
  endif()
  add_library(fork1s::${name} ALIAS fork1s_${name})
  set_target_properties(fork1s_${name} PROPERTIES EXPORT_NAME ${name})
  target_include_directories(fork1s_${name} ${scope}
    $<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}/include> $<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}/src>
    $<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}>)
  target_link_libraries(fork1s_${name} ${scope} fork1s_options)
  foreach(room ${ARG_ROOMS})
    target_link_libraries(fork1s_${name} ${scope} fork1s_${room})
  endforeach()
  if(NOT ARG_SHARED)
    set(FORK1S_ROOMS ${FORK1S_ROOMS} fork1s_${name} CACHE INTERNAL "")
  endif()
endfunction()

# The umbrella target, and what `cmake --install` puts where find_package(fork1s) finds it.
function(fork1s_finish)
  add_library(fork1s INTERFACE)
  add_library(fork1s::fork1s ALIAS fork1s)
  target_link_libraries(fork1s INTERFACE ${FORK1S_ROOMS})
  include(CMakePackageConfigHelpers)
  install(TARGETS fork1s fork1s_options ${FORK1S_ROOMS} EXPORT fork1sTargets)
  install(EXPORT fork1sTargets NAMESPACE fork1s:: DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/fork1s)
  install(DIRECTORY ${PROJECT_SOURCE_DIR}/include/fork1s DESTINATION ${CMAKE_INSTALL_INCLUDEDIR})
  configure_package_config_file(${PROJECT_SOURCE_DIR}/cmake/fork1sConfig.cmake.in
    ${PROJECT_BINARY_DIR}/fork1sConfig.cmake INSTALL_DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/fork1s)
  if(mujoco_LIBRARY)  # not where the system has its own
    install(FILES ${mujoco_LIBRARY} ${mujoco_LICENSE} DESTINATION ${CMAKE_INSTALL_LIBDIR}/fork1s/mujoco)
    install(DIRECTORY ${mujoco_PLUGINS} DESTINATION ${CMAKE_INSTALL_LIBDIR}/fork1s/mujoco)
    install(DIRECTORY ${mujoco_INCLUDE_DIR}/mujoco DESTINATION ${CMAKE_INSTALL_LIBDIR}/fork1s/mujoco/include)
  endif()
  write_basic_package_version_file(${PROJECT_BINARY_DIR}/fork1sConfigVersion.cmake
    COMPATIBILITY SameMinorVersion)
  install(FILES ${PROJECT_BINARY_DIR}/fork1sConfig.cmake ${PROJECT_BINARY_DIR}/fork1sConfigVersion.cmake
    ${PROJECT_SOURCE_DIR}/cmake/Findmujoco.cmake ${PROJECT_SOURCE_DIR}/cmake/mujoco.txt
    DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/fork1s)
endfunction()
