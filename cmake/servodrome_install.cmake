# cmake --install installs the program, the C interface, and the C++ libraries with their headers, which find_package(servodrome)
# finds. tools/package installs only the components `program` and `interface`.
install(DIRECTORY build/studio/ DESTINATION ${CMAKE_INSTALL_DATADIR}/servodrome/studio COMPONENT program OPTIONAL
  PATTERN .built EXCLUDE)
install(DIRECTORY lines DESTINATION ${CMAKE_INSTALL_DATADIR}/servodrome COMPONENT program)
if(SKBUILD)
  include(servodrome_wheel)
endif()
include(CMakePackageConfigHelpers)
get_property(libraries GLOBAL PROPERTY servodrome_libraries)
install(TARGETS servodrome_options ${libraries} EXPORT servodrome-targets ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR})
set_target_properties(servodrome_options PROPERTIES EXPORT_NAME options)
install(DIRECTORY src/ DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/servodrome FILES_MATCHING PATTERN "*.hpp")
install(EXPORT servodrome-targets NAMESPACE servodrome:: DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/servodrome)
configure_package_config_file(cmake/servodrome-config.cmake.in servodrome-config.cmake
  INSTALL_DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/servodrome)
write_basic_package_version_file(servodrome-config-version.cmake COMPATIBILITY SameMinorVersion)
install(FILES ${CMAKE_CURRENT_BINARY_DIR}/servodrome-config.cmake ${CMAKE_CURRENT_BINARY_DIR}/servodrome-config-version.cmake
  DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/servodrome)
