# The installed tree: public headers, libraries, and the package file that find_package(Palpate) reads.
include(CMakePackageConfigHelpers)

set(packageFolder ${CMAKE_INSTALL_LIBDIR}/cmake/Palpate)
set(components Palpate)
set(withSimplify OFF)
if(TARGET PalpateSimplify)
  set(withSimplify ON)
  list(APPEND components PalpateSimplify)
endif()
foreach(component PalpateMeshFiles PalpateVtk)
  if(TARGET ${component})
    list(APPEND components ${component})
  endif()
endforeach()
set(withFcl OFF)
if(TARGET PalpateFcl)
  set(withFcl ON)
  list(APPEND components PalpateFcl)
endif()
foreach(component IN LISTS components)
  palpate_export_own_symbols(${component})
  # The libraries find each other wherever they are installed.
  set_target_properties(${component} PROPERTIES INSTALL_RPATH "$ORIGIN")
endforeach()
# A static Palpate::Vtk hands VTK on to its user's linker, and Palpate::Fcl FCL.
if(TARGET PalpateVtk)
  get_target_property(vtkComponents PalpateVtk LINK_LIBRARIES)
  list(FILTER vtkComponents INCLUDE REGEX "^VTK::")
  list(TRANSFORM vtkComponents REPLACE "^VTK::" "")
endif()
install(TARGETS ${components} EXPORT PalpateTargets FILE_SET HEADERS)
install(EXPORT PalpateTargets NAMESPACE Palpate:: DESTINATION ${packageFolder})

configure_package_config_file(${CMAKE_CURRENT_LIST_DIR}/PalpateConfig.cmake.in
  ${PROJECT_BINARY_DIR}/PalpateConfig.cmake INSTALL_DESTINATION ${packageFolder})
write_basic_package_version_file(${PROJECT_BINARY_DIR}/PalpateConfigVersion.cmake
  COMPATIBILITY SameMinorVersion)
install(FILES ${PROJECT_BINARY_DIR}/PalpateConfig.cmake ${PROJECT_BINARY_DIR}/PalpateConfigVersion.cmake
  DESTINATION ${packageFolder})
install(FILES ${PROJECT_SOURCE_DIR}/LICENSE DESTINATION ${CMAKE_INSTALL_DOCDIR})
