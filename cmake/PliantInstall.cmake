# What `cmake --install` lays down: the programs, the weights, and a package for consumers:
#   find_package(Pliant REQUIRED)
#   target_link_libraries(app PRIVATE Pliant::index)
include(CMakePackageConfigHelpers)

set(PLIANT_CMAKE_DIR ${CMAKE_INSTALL_LIBDIR}/cmake/Pliant)

# Components: runtime (what runs), development (what consumers build with).
set(CMAKE_INSTALL_DEFAULT_COMPONENT_NAME development)

install(TARGETS pliant pliant-server RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR} COMPONENT runtime)
install(TARGETS pliant_simulation pliant_descriptor pliant_vocab pliant_index EXPORT PliantTargets
        ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR})
install(FILES descriptor/model/deal.safetensors DESTINATION ${CMAKE_INSTALL_DATADIR}/pliant
        COMPONENT runtime)
# Manual pages and completion scripts, which the programs print themselves.
set(PLIANT_PRINTED ${PROJECT_BINARY_DIR}/printed)
set(PLIANT_PRINTED_FILES)
foreach(program pliant pliant-server)
  set(pages ${PLIANT_PRINTED}/${program}.1 ${PLIANT_PRINTED}/${program} ${PLIANT_PRINTED}/_${program}
            ${PLIANT_PRINTED}/${program}.fish)
  add_custom_command(
    OUTPUT ${pages}
    COMMAND ${CMAKE_COMMAND} -D PROGRAM=$<TARGET_FILE:${program}> -D FOLDER=${PLIANT_PRINTED} -P
            ${PROJECT_SOURCE_DIR}/cmake/PliantPrint.cmake
    DEPENDS ${program} ${PROJECT_SOURCE_DIR}/cmake/PliantPrint.cmake
    VERBATIM)
  list(APPEND PLIANT_PRINTED_FILES ${pages})
  install(FILES ${PLIANT_PRINTED}/${program}.1 DESTINATION ${CMAKE_INSTALL_MANDIR}/man1 COMPONENT runtime)
  install(FILES ${PLIANT_PRINTED}/${program} DESTINATION ${CMAKE_INSTALL_DATADIR}/bash-completion/completions
          COMPONENT runtime)
  install(FILES ${PLIANT_PRINTED}/_${program} DESTINATION ${CMAKE_INSTALL_DATADIR}/zsh/vendor-completions
          COMPONENT runtime)
  install(FILES ${PLIANT_PRINTED}/${program}.fish DESTINATION ${CMAKE_INSTALL_DATADIR}/fish/vendor_completions.d
          COMPONENT runtime)
endforeach()
add_custom_target(printed ALL DEPENDS ${PLIANT_PRINTED_FILES})

install(FILES LICENSE DESTINATION ${CMAKE_INSTALL_DOCDIR} COMPONENT runtime)

# The public headers, each under the name that the sources include it by; the rest is each folder's
# own business.
set(PLIANT_PUBLIC_HEADERS
    descriptor/base/error.h
    descriptor/base/sha256.h
    descriptor/features/descriptor.h
    descriptor/features/colour_grid.h
    descriptor/features/features.h
    descriptor/features/keypoints.h
    descriptor/image/image.h
    descriptor/image/region.h
    descriptor/match/distance.h
    descriptor/match/matching.h
    descriptor/match/stepped.h
    descriptor/simulation/simulate.h
    descriptor/warp/tps.h
    descriptor/warp/tps_ransac.h
    index/engine/engine.h
    index/records/explanation.h
    index/records/filter.h
    index/records/location.h
    index/records/changes.h
    index/records/comparison.h
    index/records/listing.h
    index/records/records.h
    index/records/search.h
    index/verify/explain.h
    index/verify/locate.h
    index/verify/verification.h
    index/verify/warp_mesh.h
    vocab/k_medoids.h
    vocab/quantizer.h
    vocab/residual_codes.h
    vocab/vocabulary.h
    vocab/word_groups.h)
foreach(header IN LISTS PLIANT_PUBLIC_HEADERS)
  cmake_path(GET header PARENT_PATH folder)
  install(FILES ${header} DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/pliant/${folder})
endforeach()

install(EXPORT PliantTargets NAMESPACE Pliant:: DESTINATION ${PLIANT_CMAKE_DIR})
configure_package_config_file(cmake/PliantConfig.cmake.in
                              ${PROJECT_BINARY_DIR}/PliantConfig.cmake
                              INSTALL_DESTINATION ${PLIANT_CMAKE_DIR})
write_basic_package_version_file(${PROJECT_BINARY_DIR}/PliantConfigVersion.cmake
                                 COMPATIBILITY SameMinorVersion)
install(FILES ${PROJECT_BINARY_DIR}/PliantConfig.cmake
              ${PROJECT_BINARY_DIR}/PliantConfigVersion.cmake
        DESTINATION ${PLIANT_CMAKE_DIR})
