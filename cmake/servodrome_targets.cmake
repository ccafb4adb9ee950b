# Compiler settings of all targets of this project, with one function each for a library, a test and a benchmark. So a
# folder's CMakeLists.txt contains only its own particulars.

add_library(servodrome_options INTERFACE)
add_library(servodrome::options ALIAS servodrome_options)
target_compile_features(servodrome_options INTERFACE cxx_std_20)
target_compile_options(servodrome_options INTERFACE
  # Clang counts a constant of another file in the same unit as shadowed.
  $<BUILD_INTERFACE:-Wall -Wextra -Wpedantic $<$<NOT:$<AND:$<BOOL:${SERVODROME_UNITY}>,$<CXX_COMPILER_ID:Clang>>>:-Wshadow> -Wconversion -Wsign-conversion -Wold-style-cast
  -Wnon-virtual-dtor -Woverloaded-virtual -Wnull-dereference -Wdouble-promotion -Wimplicit-fallthrough $<$<BOOL:${SERVODROME_WERROR}>:-Werror>>
  # Results must be reproducible to the last bit: no contraction into fused multiply-add, no unsafe maths.
  -ffp-contract=off)
if(WIN32)
  # Windows 10 or newer; of the system's headers only what is included, and no macros `min` and `max`.
  target_compile_definitions(servodrome_options INTERFACE _WIN32_WINNT=0x0a00 WIN32_LEAN_AND_MEAN NOMINMAX)
endif()
if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
  # GCC 12 gives false warnings of these kinds for inlined standard-library code. They depend on its inlining decisions, and
  # even on the length of the source folder's path. So they are shown, but are not errors.
  target_compile_options(servodrome_options INTERFACE
    $<BUILD_INTERFACE:-Wno-null-dereference -Wno-error=array-bounds -Wno-error=restrict
    -Wno-error=stringop-overflow -Wno-error=stringop-overread -Wno-error=maybe-uninitialized -Wno-error=free-nonheap-object
    -fconstexpr-ops-limit=500000000 -fconstexpr-loop-limit=5000000>)
  if(SERVODROME_UNITY)
    # The compiler begins to collect its garbage only at 768 MB: this saves a tenth of its time. Default: 128 MB or less.
    target_compile_options(servodrome_options INTERFACE $<BUILD_INTERFACE:--param=ggc-min-heapsize=786432>)
  endif()
else()
  target_compile_options(servodrome_options INTERFACE $<BUILD_INTERFACE:-fconstexpr-steps=500000000>)
endif()
if(SERVODROME_SANITIZE)
  # The vptr and function checks need type information, which portable libraries do not have.
  # GCC gives false warnings for instrumented code, so it gives none. Clang also warns of a float that becomes a double without
  # a computation.
  target_compile_options(servodrome_options INTERFACE $<BUILD_INTERFACE:-fsanitize=${SERVODROME_SANITIZE} -fno-omit-frame-pointer
    -fno-sanitize-recover=all -fno-sanitize=vptr $<IF:$<CXX_COMPILER_ID:GNU>,-w,-Wno-double-promotion>>)
  if(CMAKE_CXX_COMPILER_ID MATCHES "Clang")
    target_compile_options(servodrome_options INTERFACE $<BUILD_INTERFACE:-fno-sanitize=function>)
  endif()
  target_link_options(servodrome_options INTERFACE $<BUILD_INTERFACE:-fsanitize=${SERVODROME_SANITIZE}>)
  target_compile_definitions(servodrome_options INTERFACE $<BUILD_INTERFACE:SERVODROME_SANITIZED>)
endif()

# Headers (JSON, HTTP, the standard library) take longer to compile than the sources that include them: compiles several
# sources together if SERVODROME_UNITY is on. So two files of a target must not have the same name for different things,
# also not in namespaces without a name.
function(servodrome_compile_together target)
  set_target_properties(${target} PROPERTIES UNITY_BUILD ${SERVODROME_UNITY} UNITY_BUILD_BATCH_SIZE 20)
endfunction()
if(SERVODROME_UNITY)
  # Twenty sources together need up to 1.8 GB: no more compilers at a time than fit into the memory.
  cmake_host_system_information(RESULT memory_mb QUERY TOTAL_PHYSICAL_MEMORY)
  math(EXPR compilers "(${memory_mb} + 2047) / 2048")
  set_property(GLOBAL PROPERTY JOB_POOLS compilers=${compilers})
  set(CMAKE_JOB_POOL_COMPILE compilers)
endif()

# For code that takes longer to optimise than to run, or waits for users and buses: another level if SERVODROME_UNITY is on.
# With the address sanitizer, which makes optimising take several times as long, it is not optimised at all.
function(servodrome_optimise_less target level)
  if(SERVODROME_UNITY AND SERVODROME_SANITIZE MATCHES "address")
    target_compile_options(${target} PRIVATE -O0)
  elseif(SERVODROME_UNITY)
    target_compile_options(${target} PRIVATE -O${level})
  endif()
endfunction()

# For code that runs in every tick of every axis: it then takes half the time. Switches off GCC's packing of neighbouring
# variables (clang has the option too): reading single values after they were stored as a pair stalls the processor. Its
# sources are compiled one at a time: together, a tick takes 3 % more instructions.
function(servodrome_optimise_ticks target)
  set_target_properties(${target} PROPERTIES UNITY_BUILD OFF)
  if(NOT SERVODROME_SANITIZE AND NOT SERVODROME_SHARED)
    target_compile_options(${target} PRIVATE $<$<CONFIG:Release,RelWithDebInfo>:-O3 -fno-tree-slp-vectorize>)
  endif()
endfunction()

# servodrome_sources_here(VARIABLE [LINUX_ONLY FILE ...]): every .cpp of the current folder and its subfolders that the target's
# system needs. A file in the folder `windows` is for Windows, where it takes the place of the file with the same path beside
# that folder. LINUX_ONLY: files that have no counterpart on Windows.
function(servodrome_sources_here variable)
  cmake_parse_arguments(arg "" "" "LINUX_ONLY" ${ARGN})
  file(GLOB_RECURSE sources RELATIVE ${CMAKE_CURRENT_SOURCE_DIR} CONFIGURE_DEPENDS *.cpp)
  set(windows_sources ${sources})
  list(FILTER windows_sources INCLUDE REGEX "^windows/")
  list(FILTER sources EXCLUDE REGEX "^windows/")
  if(WIN32)
    list(TRANSFORM windows_sources REPLACE "^windows/" "" OUTPUT_VARIABLE replaced)
    list(REMOVE_ITEM sources ${replaced} ${arg_LINUX_ONLY})
    list(APPEND sources ${windows_sources})
    set_source_files_properties(${windows_sources} PROPERTIES SKIP_UNITY_BUILD_INCLUSION ON)  # for the macros of the system's headers
  endif()
  list(TRANSFORM sources PREPEND ${CMAKE_CURRENT_SOURCE_DIR}/)
  set(${variable} ${sources} PARENT_SCOPE)
endfunction()

# servodrome_library(NAME [PORTABLE] [COMPUTES] SOURCES ... [DEPENDS ...])
# PORTABLE libraries also run on a microcontroller: no exceptions, no run-time type information. These, and those with
# COMPUTES, are always optimised: they run in each tick, for each frame, or for long in the tests. A quick build optimises
# the others less. Portable ones are compiled one source at a time, as in a release: together, GCC inlines other functions,
# and an EtherCAT slave takes 13 % more instructions.
function(servodrome_library name)
  cmake_parse_arguments(arg "PORTABLE;COMPUTES" "" "SOURCES;DEPENDS" ${ARGN})
  if(SERVODROME_SHARED)
    add_library(servodrome_${name} SHARED ${arg_SOURCES})
  else()
    add_library(servodrome_${name} STATIC ${arg_SOURCES})
    # For src/capi, a shared library made of these.
    set_target_properties(servodrome_${name} PROPERTIES POSITION_INDEPENDENT_CODE ON CXX_VISIBILITY_PRESET hidden
      VISIBILITY_INLINES_HIDDEN ON)
  endif()
  if(NOT arg_PORTABLE)
    servodrome_compile_together(servodrome_${name})
  endif()
  if(NOT arg_PORTABLE AND NOT arg_COMPUTES)
    servodrome_optimise_less(servodrome_${name} 1)
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

# servodrome_tests_in_folder([DEPENDS ...] [ALONE NAME ...] [RELEASED NAME ...] [LONG NAME ...] [COMPUTES]): all *_test.cpp of the current folder
# become one program, FOLDER_tests, and each file becomes one ctest entry of its name. Where SERVODROME_UNITY is on, several
# files are compiled at a time, since their headers cost more than they do: what a file declares is in a namespace of the
# file's name. A file under ALONE becomes a program of its own, because it replaces something in the whole program. COMPUTES:
# with sanitizers the tests run for longer than it takes to optimise them.
# RELEASED: files whose tests are about the released code (its bits, its allocations), or take long with a sanitizer, where only
# each fifth of them runs. SERVODROME_ONLY_RELEASED_TESTS selects these, and those that include draws.hpp.
# LONG: files whose tests take more than five seconds and depend on no real time. `./test --quick` leaves them out.
function(servodrome_tests_in_folder)
  cmake_parse_arguments(arg "COMPUTES" "" "DEPENDS;ALONE;RELEASED;LONG" ${ARGN})
  get_filename_component(folder ${CMAKE_CURRENT_SOURCE_DIR} NAME)
  file(GLOB sources CONFIGURE_DEPENDS *_test.cpp)
  set(together)
  foreach(source IN LISTS sources)
    get_filename_component(name ${source} NAME_WE)
    if(SERVODROME_ONLY_TESTS AND NOT name MATCHES "${SERVODROME_ONLY_TESTS}")
      continue()
    endif()
    if(SERVODROME_ONLY_RELEASED_TESTS AND NOT name IN_LIST arg_RELEASED)
      file(STRINGS ${source} draws REGEX "#include \"draws.hpp\"")
      if(NOT draws)
        continue()
      endif()
    endif()
    set(environment)
    if(name IN_LIST arg_RELEASED AND SERVODROME_SANITIZE)
      set(environment GTEST_TOTAL_SHARDS=5 GTEST_SHARD_INDEX=0)
    endif()
    if(name IN_LIST arg_ALONE)
      servodrome_test_program(${name} ${source} ${arg_DEPENDS})
      set(command ${name})
    else()
      list(APPEND together ${source})
      set(command ${folder}_tests --source=${name})
    endif()
    set(name_of_file ${name})
    get_property(known GLOBAL PROPERTY servodrome_tests)
    if(name IN_LIST known)  # two folders may have a test of the same name
      set(name ${folder}_${name})
    endif()
    set_property(GLOBAL APPEND PROPERTY servodrome_tests ${name})
    add_test(NAME ${name} COMMAND ${command})
    set_tests_properties(${name} PROPERTIES TIMEOUT 900 LABELS "unit" ENVIRONMENT "${environment}")
    if(name_of_file IN_LIST arg_LONG)
      set_tests_properties(${name} PROPERTIES LABELS "unit;long" COST 100)  # ctest begins with the highest cost
    endif()
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
  if(NOT SERVODROME_SANITIZE OR NOT arg_COMPUTES)
    servodrome_optimise_less(${name} 0)
  endif()
endfunction()

# servodrome_bench(NAME SOURCES ... [DEPENDS ...]): one program under bench/.
function(servodrome_bench name)
  cmake_parse_arguments(arg "" "" "SOURCES;DEPENDS" ${ARGN})
  add_executable(${name} ${arg_SOURCES})
  target_link_libraries(${name} PRIVATE servodrome::options ${arg_DEPENDS})
endfunction()
