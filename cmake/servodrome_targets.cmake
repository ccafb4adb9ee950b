# How every target of this project is compiled. One function each for a library, a test and a benchmark, so
# that a folder's CMakeLists.txt says only what is particular to it.

add_library(servodrome_options INTERFACE)
add_library(servodrome::options ALIAS servodrome_options)
target_compile_features(servodrome_options INTERFACE cxx_std_20)
target_compile_options(servodrome_options INTERFACE
  $<BUILD_INTERFACE:-Wall -Wextra -Wpedantic -Wshadow -Wconversion -Wsign-conversion -Wold-style-cast
  -Wnon-virtual-dtor -Woverloaded-virtual -Wnull-dereference -Wdouble-promotion -Wimplicit-fallthrough -Werror>
  # Two runs of a drive agree to the last bit: no contraction into fused multiply-add, no unsafe maths.
  -ffp-contract=off)
if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
  # GCC 12 reports these falsely out of inlined standard-library code. Whether it does hangs on what it inlines, even on
  # the length of the source folder's path: they are told, but do not stop a build.
  target_compile_options(servodrome_options INTERFACE
    $<BUILD_INTERFACE:-Wno-null-dereference -Wno-error=array-bounds -Wno-error=restrict
    -Wno-error=stringop-overflow -Wno-error=stringop-overread -Wno-error=maybe-uninitialized -Wno-error=free-nonheap-object
    -fconstexpr-ops-limit=500000000 -fconstexpr-loop-limit=5000000>)
else()
  target_compile_options(servodrome_options INTERFACE $<BUILD_INTERFACE:-fconstexpr-steps=500000000>)
endif()
if(SERVODROME_SANITIZE)
  # The vptr and function checks need the type information that portable libraries are built without.
  # Warnings are the plain build's: out of instrumented code GCC reports false ones.
  target_compile_options(servodrome_options INTERFACE $<BUILD_INTERFACE:-fsanitize=${SERVODROME_SANITIZE} -fno-omit-frame-pointer
    -fno-sanitize-recover=all -fno-sanitize=vptr -w>)
  if(CMAKE_CXX_COMPILER_ID MATCHES "Clang")
    target_compile_options(servodrome_options INTERFACE $<BUILD_INTERFACE:-fno-sanitize=function>)
  endif()
  target_link_options(servodrome_options INTERFACE $<BUILD_INTERFACE:-fsanitize=${SERVODROME_SANITIZE}>)
endif()

# Sources whose headers (JSON, HTTP, command line) take longer to compile than they do, several at a time, where
# SERVODROME_UNITY is on.
function(servodrome_compile_together target)
  set_target_properties(${target} PROPERTIES UNITY_BUILD ${SERVODROME_UNITY} UNITY_BUILD_BATCH_SIZE 8)
endfunction()

# Headers that most sources of the target include, read once where SERVODROME_UNITY is on. ccache wants the option to know
# what was in them (and CCACHE_SLOPPINESS, see tools/build).
function(servodrome_precompile target)
  if(SERVODROME_UNITY)
    target_precompile_headers(${target} PRIVATE ${ARGN})
    target_compile_options(${target} PRIVATE $<$<CXX_COMPILER_ID:GNU>:-fpch-preprocess>)
  endif()
endfunction()

# What takes longer to optimise than it runs, or waits for people and buses, at another level where SERVODROME_UNITY is on.
function(servodrome_optimise_less target level)
  if(SERVODROME_UNITY)
    target_compile_options(${target} PRIVATE -O${level})
  endif()
endfunction()

# What runs in every tick of every axis: half as long as otherwise. GCC's packing of neighbouring variables is left out
# (clang knows the option too): what was stored as a pair and is then read one by one has the processor wait for memory.
function(servodrome_optimise_ticks target)
  if(NOT SERVODROME_SANITIZE AND NOT SERVODROME_SHARED)
    target_compile_options(${target} PRIVATE $<$<CONFIG:Release,RelWithDebInfo>:-O3 -fno-tree-slp-vectorize>)
  endif()
endfunction()

# servodrome_library(NAME [PORTABLE | HEAVY] SOURCES ... [DEPENDS ...])
# PORTABLE libraries also run on a microcontroller: no exceptions, no run-time type information.
function(servodrome_library name)
  cmake_parse_arguments(arg "PORTABLE;HEAVY" "" "SOURCES;DEPENDS" ${ARGN})
  if(SERVODROME_SHARED)
    add_library(servodrome_${name} SHARED ${arg_SOURCES})
  else()
    add_library(servodrome_${name} STATIC ${arg_SOURCES})
  endif()
  if(arg_HEAVY)
    servodrome_compile_together(servodrome_${name})
  endif()
  add_library(servodrome::${name} ALIAS servodrome_${name})
  set_target_properties(servodrome_${name} PROPERTIES EXPORT_NAME ${name})
  target_include_directories(servodrome_${name} PUBLIC
    $<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}/src> $<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}/servodrome>)
  target_link_libraries(servodrome_${name} PUBLIC servodrome::options ${arg_DEPENDS})
  if(arg_PORTABLE)
    target_compile_options(servodrome_${name} PRIVATE -fno-exceptions -fno-rtti -ffunction-sections)
    set_property(GLOBAL APPEND PROPERTY servodrome_portable_libraries servodrome_${name})
  endif()
  set_property(GLOBAL APPEND PROPERTY servodrome_libraries servodrome_${name})
endfunction()

# servodrome_tests_in_folder([DEPENDS ...] [ALONE NAME ...]): all *_test.cpp of the current folder become one program,
# FOLDER_tests, and each file becomes one ctest entry of its name. Where SERVODROME_UNITY is on, several files are compiled
# at a time, since their headers cost more than they do: what a file declares is in a namespace of the file's name.
# A file under ALONE becomes a program of its own, because it replaces something in the whole program.
function(servodrome_tests_in_folder)
  cmake_parse_arguments(arg "" "" "DEPENDS;ALONE" ${ARGN})
  get_filename_component(folder ${CMAKE_CURRENT_SOURCE_DIR} NAME)
  file(GLOB sources CONFIGURE_DEPENDS *_test.cpp)
  set(together)
  foreach(source IN LISTS sources)
    get_filename_component(name ${source} NAME_WE)
    if(SERVODROME_ONLY_TESTS AND NOT name MATCHES "${SERVODROME_ONLY_TESTS}")
      continue()
    endif()
    if(name IN_LIST arg_ALONE)
      servodrome_test_program(${name} ${source} ${arg_DEPENDS})
      set(command ${name})
    else()
      list(APPEND together ${source})
      set(command ${folder}_tests --source=${name})
    endif()
    get_property(known GLOBAL PROPERTY servodrome_tests)
    if(name IN_LIST known)  # two folders may have a test of the same name
      set(name ${folder}_${name})
    endif()
    set_property(GLOBAL APPEND PROPERTY servodrome_tests ${name})
    add_test(NAME ${name} COMMAND ${command})
    set_tests_properties(${name} PROPERTIES TIMEOUT 900 LABELS "unit")
  endforeach()
  if(together)
    servodrome_test_program(${folder}_tests "${together}" ${arg_DEPENDS})
    servodrome_compile_together(${folder}_tests)
  endif()
endfunction()

function(servodrome_test_program name sources)
  add_executable(${name} ${sources})
  target_link_libraries(${name} PRIVATE servodrome::options ${ARGN} servodrome_test_main)
  target_include_directories(${name} PRIVATE ${PROJECT_SOURCE_DIR}/tests ${PROJECT_BINARY_DIR}/generated)
  if(SERVODROME_SANITIZE)
    servodrome_optimise_less(${name} 0)
  else()
    servodrome_optimise_less(${name} 1)
  endif()
endfunction()

# servodrome_bench(NAME SOURCES ... [DEPENDS ...]): one program under bench/.
function(servodrome_bench name)
  cmake_parse_arguments(arg "" "" "SOURCES;DEPENDS" ${ARGN})
  add_executable(${name} ${arg_SOURCES})
  target_link_libraries(${name} PRIVATE servodrome::options ${arg_DEPENDS})
endfunction()
