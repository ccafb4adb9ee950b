# Compiles with zig's clang for Linux with glibc 2.28 or newer, or for Windows: decision 26. tools/package uses it:
#
#   cmake -DCMAKE_TOOLCHAIN_FILE=cmake/toolchains/zig.cmake -DSERVODROME_ZIG=PROGRAM -DSERVODROME_ZIG_TARGET=x86_64-linux-gnu.2.28
#         -DCMAKE_PROJECT_TOP_LEVEL_INCLUDES=cmake/toolchains/dependencies.cmake -DSERVODROME_DEPENDENCIES=FOLDER
#         -DSERVODROME_LIBGCC=libgcc.a
#
# zig has headers of glibc and of Linux, a stub of each version of glibc, the headers and libraries of mingw-w64, and the
# sources of libc++, which it links statically.
# Its own library of compiler functions, compiler_rt, also has mathematics, which would replace those of glibc and give other last
# bits. Therefore GCC's, libgcc.a, takes its place on Linux. For Windows zig's own is used, without SERVODROME_LIBGCC.
# zig must not see /usr/include, whose headers belong to this machine's glibc; dependencies.cmake has the other libraries.
set(SERVODROME_ZIG_TARGET x86_64-linux-gnu.2.28 CACHE STRING
  "Processor, system, and oldest glibc: ARCHITECTURE-linux-gnu.VERSION, or x86_64-windows-gnu")
if(NOT SERVODROME_ZIG)
  message(FATAL_ERROR "SERVODROME_ZIG is not set. Set it to the program zig, for example of the package ziglang from PyPI.")
endif()
if(SERVODROME_ZIG_TARGET MATCHES "windows")
  set(CMAKE_SYSTEM_NAME Windows)
elseif(NOT EXISTS "${SERVODROME_LIBGCC}")
  message(FATAL_ERROR "SERVODROME_LIBGCC=${SERVODROME_LIBGCC} is no file. Set it to the libgcc.a of Debian's g++, or of libgcc-12-dev-arm64-cross.")
else()
  set(CMAKE_SYSTEM_NAME Linux)
endif()
list(APPEND CMAKE_TRY_COMPILE_PLATFORM_VARIABLES SERVODROME_ZIG SERVODROME_ZIG_TARGET SERVODROME_LIBGCC)

string(REGEX REPLACE "-.*" "" CMAKE_SYSTEM_PROCESSOR ${SERVODROME_ZIG_TARGET})
# -mcpu=baseline: any processor of the architecture. -fno-sanitize=undefined: zig's clang traps on undefined behaviour otherwise.
set(zig_flags -target ${SERVODROME_ZIG_TARGET} -mcpu=baseline -fno-sanitize=undefined)
set(CMAKE_C_COMPILER ${SERVODROME_ZIG} cc ${zig_flags})
set(CMAKE_CXX_COMPILER ${SERVODROME_ZIG} c++ ${zig_flags})
if(CMAKE_SYSTEM_NAME STREQUAL Linux)
  foreach(kind EXE SHARED)
    set(CMAKE_${kind}_LINKER_FLAGS_INIT -rtlib=none)
  endforeach()
endif()
foreach(language C CXX)
  if(CMAKE_SYSTEM_NAME STREQUAL Linux)
    set(CMAKE_${language}_STANDARD_LIBRARIES_INIT ${SERVODROME_LIBGCC})
  endif()
  set(CMAKE_${language}_ARCHIVE_CREATE "\"${SERVODROME_ZIG}\" ar qcD <TARGET> <OBJECTS>")
  set(CMAKE_${language}_ARCHIVE_APPEND "\"${SERVODROME_ZIG}\" ar qD <TARGET> <OBJECTS>")
  set(CMAKE_${language}_ARCHIVE_FINISH "\"${SERVODROME_ZIG}\" ranlib <TARGET>")
endforeach()
