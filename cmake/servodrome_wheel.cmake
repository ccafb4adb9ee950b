# What scikit-build-core puts into the wheel (pyproject.toml): the program on the PATH, its page where it looks for it,
# and the library beside the Python module that loads it.
install(TARGETS servodrome RUNTIME DESTINATION ${SKBUILD_SCRIPTS_DIR} COMPONENT wheel)
install(DIRECTORY build/studio/ DESTINATION ${SKBUILD_DATA_DIR}/share/servodrome/studio COMPONENT wheel OPTIONAL
  PATTERN .built EXCLUDE)
if(TARGET servodrome_capi)
  install(FILES $<TARGET_FILE:servodrome_capi> RENAME libservodrome.so DESTINATION ${SKBUILD_PLATLIB_DIR}/servodrome/_lib
    COMPONENT wheel)
endif()

# The licences of what is linked into the program and bundled in its page; tools/package collects them.
set(SERVODROME_LICENCES "" CACHE FILEPATH "A text of third-party licences for the wheel")
if(SERVODROME_LICENCES)
  install(FILES ${SERVODROME_LICENCES} DESTINATION ${SKBUILD_METADATA_DIR}/licenses COMPONENT wheel)
endif()
