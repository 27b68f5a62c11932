# `cpack -G DEB` in the build folder makes the Debian packages pliant (programs, weights, service), pliant-video (what reads
# videos), pliant-dev (headers, static libraries, CMake package) and, where it was built, python3-pliant.
#
# The service's files have fixed places, so they go into packages only, never along with `cmake --install`.
install(FILES docker/pliant-server.service DESTINATION /lib/systemd/system COMPONENT service EXCLUDE_FROM_ALL)
install(FILES docker/server.toml DESTINATION /etc/pliant COMPONENT service EXCLUDE_FROM_ALL)
install(FILES server/README.md DESTINATION ${CMAKE_INSTALL_DOCDIR} RENAME SERVER.md COMPONENT runtime)
install(DIRECTORY server/reference DESTINATION ${CMAKE_INSTALL_DOCDIR} COMPONENT runtime)
install(FILES docker/README.md docker/POSTGRESQL.md server/PROXY.md CHANGELOG.md DESTINATION ${CMAKE_INSTALL_DOCDIR} COMPONENT runtime)

set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_NAME pliant)
set(CPACK_PACKAGE_VENDOR "The Pliant authors")
set(CPACK_PACKAGE_CONTACT "The Pliant authors <root@localhost>")
set(CPACK_PACKAGE_DESCRIPTION_SUMMARY ${PROJECT_DESCRIPTION})
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_INSTALL_PREFIX /usr)
set(CPACK_SET_DESTDIR ON)
set(CPACK_STRIP_FILES ON)
set(CPACK_COMPONENTS_ALL runtime service video development)
set(CPACK_COMPONENT_RUNTIME_GROUP programs)
set(CPACK_COMPONENT_SERVICE_GROUP programs)
set(CPACK_COMPONENT_VIDEO_GROUP video)
set(CPACK_COMPONENT_DEVELOPMENT_GROUP development)
set(CPACK_COMPONENTS_GROUPING ONE_PER_GROUP)
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
# 0.1.0-1~deb12: the packages for two releases of Debian have two names, and an upgrade of Debian upgrades Pliant.
cmake_host_system_information(RESULT debian QUERY DISTRIB_VERSION_ID)
set(CPACK_DEBIAN_PACKAGE_RELEASE "1~deb${debian}")
set(CPACK_DEBIAN_PACKAGE_SECTION graphics)
set(CPACK_DEBIAN_PROGRAMS_PACKAGE_NAME pliant)
set(CPACK_DEBIAN_PROGRAMS_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_PROGRAMS_PACKAGE_RECOMMENDS "ca-certificates") # for --fetch-hosts
set(CPACK_DEBIAN_PROGRAMS_PACKAGE_SUGGESTS "pliant-video, python3-pliant")
set(CPACK_DEBIAN_PROGRAMS_PACKAGE_CONTROL_EXTRA
    "${PROJECT_SOURCE_DIR}/docker/debian/conffiles;${PROJECT_SOURCE_DIR}/docker/debian/postinst;${PROJECT_SOURCE_DIR}/docker/debian/prerm;${PROJECT_SOURCE_DIR}/docker/debian/postrm"
)
set(CPACK_DEBIAN_PROGRAMS_PACKAGE_CONTROL_STRICT_PERMISSION ON)
set(same_pliant "pliant (= ${PROJECT_VERSION}-${CPACK_DEBIAN_PACKAGE_RELEASE})")
set(CPACK_DEBIAN_VIDEO_PACKAGE_NAME pliant-video)
set(CPACK_DEBIAN_VIDEO_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_VIDEO_PACKAGE_DEPENDS "${same_pliant}")
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_NAME pliant-dev)
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_SECTION libdevel)
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_DEPENDS
    "libopencv-dev, libdnnl-dev, libeigen3-dev, libsqlitecpp-dev, libsqlite3-dev, libpq-dev, libturbojpeg0-dev, libjpeg-dev, libpng-dev, libtiff-dev, libwebp-dev, libgif-dev, libheif-dev, zlib1g-dev, libzip-dev, libxxhash-dev, pkg-config, libssl-dev"
)
if(PLIANT_PYTHON_FOUND)
  math(EXPR next_minor "${Python3_VERSION_MINOR} + 1")
  list(APPEND CPACK_COMPONENTS_ALL python)
  set(CPACK_COMPONENT_PYTHON_GROUP python)
  set(CPACK_DEBIAN_PYTHON_PACKAGE_NAME python3-pliant)
  set(CPACK_DEBIAN_PYTHON_PACKAGE_SECTION python)
  set(CPACK_DEBIAN_PYTHON_PACKAGE_SHLIBDEPS ON)
  set(CPACK_DEBIAN_PYTHON_PACKAGE_DEPENDS
      "${same_pliant}, python3 (>= 3.${Python3_VERSION_MINOR}), python3 (<< 3.${next_minor}), python3-numpy")
endif()
include(CPack)
