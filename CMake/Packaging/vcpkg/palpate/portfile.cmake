# The port builds the copy of Palpate that it lies in.
get_filename_component(SOURCE_PATH "${CMAKE_CURRENT_LIST_DIR}/../../../.." ABSOLUTE)
vcpkg_find_acquire_program(PKGCONFIG)
string(COMPARE EQUAL "${VCPKG_LIBRARY_LINKAGE}" dynamic shared)
vcpkg_cmake_configure(SOURCE_PATH "${SOURCE_PATH}"
  OPTIONS "-DPKG_CONFIG_EXECUTABLE=${PKGCONFIG}" -DBUILD_SHARED_LIBS=${shared} -DPALPATE_WITH_SIMPLIFY=OFF
    -DPALPATE_WITH_MESH_FILES=ON -DPALPATE_WITH_VTK=OFF -DPALPATE_WITH_FCL=OFF -DPALPATE_WITH_PYTHON=OFF
    -DPALPATE_BUILD_TESTING=OFF -DPALPATE_BUILD_EXAMPLES=OFF)
vcpkg_cmake_install()
vcpkg_cmake_config_fixup(PACKAGE_NAME Palpate CONFIG_PATH lib/cmake/Palpate)
vcpkg_fixup_pkgconfig()
file(REMOVE_RECURSE "${CURRENT_PACKAGES_DIR}/debug/include" "${CURRENT_PACKAGES_DIR}/debug/share")
vcpkg_install_copyright(FILE_LIST "${SOURCE_PATH}/LICENSE")
