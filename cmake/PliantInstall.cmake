# What `cmake --install` lays down: the programs, the weights, and a package for consumers:
#   find_package(Pliant REQUIRED)
#   target_link_libraries(app PRIVATE Pliant::index)
include(CMakePackageConfigHelpers)

set(PLIANT_CMAKE_DIR ${CMAKE_INSTALL_LIBDIR}/cmake/Pliant)

# Components: runtime (what runs), video (what reads videos, with 300 MB of Debian's libraries), development (what consumers
# build with).
set(CMAKE_INSTALL_DEFAULT_COMPONENT_NAME development)

install(TARGETS pliant pliant-server RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR} COMPONENT runtime)
install(TARGETS pliant-video RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR} COMPONENT video)
install(TARGETS pliant_simulation pliant_descriptor pliant_vocab pliant_index EXPORT PliantTargets
        ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR})
install(FILES descriptor/model/deal.safetensors descriptor/model/deal-small.safetensors
        DESTINATION ${CMAKE_INSTALL_DATADIR}/pliant COMPONENT runtime)
# Completion for bash and zsh is one script.
set(PLIANT_COMPLETION ${PROJECT_SOURCE_DIR}/index/usage/completion.sh)
install(FILES ${PLIANT_COMPLETION} DESTINATION ${CMAKE_INSTALL_DATADIR}/zsh/vendor-completions RENAME _pliant
        COMPONENT runtime)
# Manual pages, where help2man is installed.
find_program(PLIANT_HELP2MAN help2man)
add_custom_target(manual ALL)
foreach(program pliant pliant-server)
  install(FILES ${PLIANT_COMPLETION} DESTINATION ${CMAKE_INSTALL_DATADIR}/bash-completion/completions RENAME ${program}
          COMPONENT runtime)
  if(PLIANT_HELP2MAN)
    set(page ${PROJECT_BINARY_DIR}/${program}.1)
    add_custom_command(
      OUTPUT ${page}
      COMMAND ${CMAKE_COMMAND} -D HELP2MAN=${PLIANT_HELP2MAN} -D PROGRAM=$<TARGET_FILE:${program}> -D OUT=${page} -P
              ${PROJECT_SOURCE_DIR}/cmake/PliantManual.cmake
      DEPENDS ${program} ${PROJECT_SOURCE_DIR}/cmake/PliantManual.cmake
      VERBATIM)
    add_custom_target(${program}_manual DEPENDS ${page})
    add_dependencies(manual ${program}_manual)
    install(FILES ${page} DESTINATION ${CMAKE_INSTALL_MANDIR}/man1 COMPONENT runtime)
  endif()
endforeach()

install(FILES LICENSE DESTINATION ${CMAKE_INSTALL_DOCDIR} COMPONENT runtime)

# The public headers, each below pliant/, and what they include. Consumers see no others.
set(PLIANT_PUBLIC_HEADERS
    descriptor/base/error.h
    descriptor/base/sha256.h
    descriptor/features/descriptor.h
    descriptor/features/colour_grid.h
    descriptor/features/features.h
    descriptor/features/keypoints.h
    descriptor/image/image.h
    descriptor/match/distance.h
    descriptor/match/matching.h
    descriptor/simulation/simulate.h
    descriptor/warp/tps.h
    descriptor/warp/tps_ransac.h
    index/engine/engine.h
    index/engine/index_parts.h
    index/records/index_share.h
    index/records/explanation.h
    index/records/filter.h
    index/records/location.h
    index/records/listing.h
    index/records/records.h
    index/records/search.h
    index/verify/locate.h
    index/verify/verification.h
    index/verify/warp_geometry.h
    vocab/k_medoids.h
    vocab/quantizer.h
    vocab/vocabulary.h)
foreach(header IN LISTS PLIANT_PUBLIC_HEADERS)
  set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS ${header})
  file(READ ${header} text)
  string(REGEX REPLACE "#include \"(descriptor|vocab|index)/" "#include \"pliant/\\1/" text "${text}")
  file(WRITE ${PROJECT_BINARY_DIR}/include/pliant/${header} "${text}")
endforeach()
file(WRITE ${PROJECT_BINARY_DIR}/include/pliant/version.h "#pragma once\n\n#define PLIANT_VERSION \"${PROJECT_VERSION}\"\n")
install(DIRECTORY ${PROJECT_BINARY_DIR}/include/pliant DESTINATION ${CMAKE_INSTALL_INCLUDEDIR})

install(EXPORT PliantTargets NAMESPACE Pliant:: DESTINATION ${PLIANT_CMAKE_DIR})
configure_package_config_file(cmake/PliantConfig.cmake.in
                              ${PROJECT_BINARY_DIR}/PliantConfig.cmake
                              INSTALL_DESTINATION ${PLIANT_CMAKE_DIR})
write_basic_package_version_file(${PROJECT_BINARY_DIR}/PliantConfigVersion.cmake
                                 COMPATIBILITY SameMinorVersion)
install(FILES ${PROJECT_BINARY_DIR}/PliantConfig.cmake
              ${PROJECT_BINARY_DIR}/PliantConfigVersion.cmake
        DESTINATION ${PLIANT_CMAKE_DIR})
