# The libraries of docs/dependencies.md for a build that must not see /usr/include, such as one with zig.cmake. find_package
# gives these targets, which are headers only, in place of Debian's. SERVODROME_DEPENDENCIES is a folder in which
# tools/package puts a link to the headers of each library.
set(SERVODROME_DEPENDENCIES "" CACHE PATH "Folder with the headers of other libraries; tools/package makes it")
if(NOT EXISTS ${SERVODROME_DEPENDENCIES}/fmt)
  message(FATAL_ERROR "SERVODROME_DEPENDENCIES=${SERVODROME_DEPENDENCIES}: there is no folder fmt; tools/package makes the folder")
endif()

# servodrome_provided_PACKAGE: its target. servodrome_headers_PACKAGE: the definition that its headers need.
set(servodrome_provided_fmt fmt::fmt)
set(servodrome_headers_fmt FMT_HEADER_ONLY)
set(servodrome_provided_pugixml pugixml::pugixml)
set(servodrome_headers_pugixml PUGIXML_HEADER_ONLY)
set(servodrome_provided_nlohmann_json nlohmann_json::nlohmann_json)
set(servodrome_provided_Boost Boost::headers)
set(servodrome_headers_Boost BOOST_ASIO_HAS_STD_INVOKE_RESULT)  # Asio 1.74 uses std::result_of otherwise, which C++20 removes

macro(servodrome_provide method package)
  if(servodrome_provided_${package})
    set(${package}_FOUND TRUE)
    if(NOT TARGET ${servodrome_provided_${package}})
      add_library(${servodrome_provided_${package}} INTERFACE IMPORTED GLOBAL)
      target_include_directories(${servodrome_provided_${package}} SYSTEM INTERFACE ${SERVODROME_DEPENDENCIES})
      target_compile_definitions(${servodrome_provided_${package}} INTERFACE ${servodrome_headers_${package}})
    endif()
  endif()
endmacro()
cmake_language(SET_DEPENDENCY_PROVIDER servodrome_provide SUPPORTED_METHODS FIND_PACKAGE)
