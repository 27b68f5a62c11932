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
install(FILES LICENSE DESTINATION ${CMAKE_INSTALL_DOCDIR} COMPONENT runtime)

# The public headers; the rest is each folder's own business.
install(FILES descriptor/descriptor.h descriptor/distance.h descriptor/error.h descriptor/features.h descriptor/image.h
              descriptor/keypoints.h descriptor/matching.h descriptor/sha256.h descriptor/tps.h
              descriptor/tps_ransac.h
        DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/pliant/descriptor)
install(FILES descriptor/simulation/simulate.h
        DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/pliant/descriptor/simulation)
install(FILES vocab/k_medoids.h vocab/quantizer.h vocab/signature.h vocab/vocabulary.h
        DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/pliant/vocab)
install(FILES index/engine.h index/explanation.h index/filter.h index/search.h index/verification.h
              index/warp_mesh.h
        DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/pliant/index)

install(FILES index/tracking/location.h
        DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/pliant/index/tracking)

install(EXPORT PliantTargets NAMESPACE Pliant:: DESTINATION ${PLIANT_CMAKE_DIR})
configure_package_config_file(cmake/PliantConfig.cmake.in
                              ${PROJECT_BINARY_DIR}/PliantConfig.cmake
                              INSTALL_DESTINATION ${PLIANT_CMAKE_DIR})
write_basic_package_version_file(${PROJECT_BINARY_DIR}/PliantConfigVersion.cmake
                                 COMPATIBILITY SameMinorVersion)
install(FILES ${PROJECT_BINARY_DIR}/PliantConfig.cmake
              ${PROJECT_BINARY_DIR}/PliantConfigVersion.cmake
        DESTINATION ${PLIANT_CMAKE_DIR})
