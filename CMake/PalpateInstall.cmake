# The installed tree: public headers, libraries, and what find_package(Palpate) and pkg-config read. Each library is a
# component of find_package() with an export file of its own, so that a package may leave it out. For cpack, the
# libraries that users run belong to the component NAME, all else of them to NAMEDevelopment: NAME is Library, or Vtk or
# Fcl for what needs those.
include(CMakePackageConfigHelpers)

set(packageFolder ${CMAKE_INSTALL_LIBDIR}/cmake/Palpate)
set(components)
foreach(component Palpate PalpateSimplify PalpateMeshFiles PalpateVtk PalpateFcl PalpateImstk)
  if(TARGET ${component})
    list(APPEND components ${component})
  endif()
endforeach()
set(mapsOfPalpate exportsOfC.map)
foreach(component IN LISTS components)
  if(NOT component STREQUAL PalpateImstk)
    palpate_export_own_symbols(${component} ${mapsOf${component}})
  endif()
endforeach()
if(NOT PALPATE_INSTALL)
  return()
endif()

set(withSimplify OFF)
if(TARGET PalpateSimplify)
  set(withSimplify ON)
endif()
set(besideIt $ORIGIN)
if(APPLE)
  set(besideIt @loader_path)
endif()
foreach(component IN LISTS components)
  # The libraries find each other wherever they are installed.
  set_target_properties(${component} PROPERTIES INSTALL_RPATH ${besideIt})
  set(package Library)
  if(component MATCHES "Palpate(Vtk|Fcl|Imstk)")
    set(package ${CMAKE_MATCH_1})
  endif()
  install(TARGETS ${component} EXPORT ${component}Targets
    RUNTIME COMPONENT ${package}
    LIBRARY COMPONENT ${package} NAMELINK_COMPONENT ${package}Development
    ARCHIVE COMPONENT ${package}Development
    FILE_SET HEADERS COMPONENT ${package}Development)
  install(EXPORT ${component}Targets NAMESPACE Palpate:: DESTINATION ${packageFolder} COMPONENT ${package}Development)
endforeach()
# A static Palpate::Vtk hands VTK on to its user's linker, and Palpate::Fcl FCL.
if(TARGET PalpateVtk)
  get_target_property(vtkComponents PalpateVtk LINK_LIBRARIES)
  list(FILTER vtkComponents INCLUDE REGEX "^VTK::")
  list(TRANSFORM vtkComponents REPLACE "^VTK::" "")
endif()

configure_package_config_file(${CMAKE_CURRENT_LIST_DIR}/PalpateConfig.cmake.in
  ${PROJECT_BINARY_DIR}/PalpateConfig.cmake INSTALL_DESTINATION ${packageFolder})
write_basic_package_version_file(${PROJECT_BINARY_DIR}/PalpateConfigVersion.cmake
  COMPATIBILITY SameMinorVersion)
install(FILES ${PROJECT_BINARY_DIR}/PalpateConfig.cmake ${PROJECT_BINARY_DIR}/PalpateConfigVersion.cmake
  DESTINATION ${packageFolder} COMPONENT LibraryDevelopment)

# For pkg-config: the core. The folder above the file is the prefix, so that the tree can be moved.
file(RELATIVE_PATH prefixOfPc /${CMAKE_INSTALL_LIBDIR}/pkgconfig /)
string(REGEX REPLACE "/$" "" prefixOfPc ${prefixOfPc})
set(threadsOfPc -pthread)
if(PALPATE_THREADS STREQUAL TBB)
  set(threadsOfPc -ltbb)
endif()
set(forStatic .private)
if(NOT BUILD_SHARED_LIBS)
  set(forStatic)
endif()
file(CONFIGURE OUTPUT ${PROJECT_BINARY_DIR}/palpate.pc @ONLY CONTENT
"prefix=\${pcfiledir}/@prefixOfPc@
Name: palpate
Description: @PROJECT_DESCRIPTION@; its C++ headers need C++20
Version: @PROJECT_VERSION@
Requires: eigen3
Requires@forStatic@: libhwy gmp
Cflags: -I\${prefix}/@CMAKE_INSTALL_INCLUDEDIR@
Libs: -L\${prefix}/@CMAKE_INSTALL_LIBDIR@ -lPalpate
Libs@forStatic@: @threadsOfPc@ -lstdc++ -lm
")
install(FILES ${PROJECT_BINARY_DIR}/palpate.pc DESTINATION ${CMAKE_INSTALL_LIBDIR}/pkgconfig
  COMPONENT LibraryDevelopment)
install(FILES ${PROJECT_SOURCE_DIR}/LICENSE DESTINATION ${CMAKE_INSTALL_DOCDIR} COMPONENT LibraryDevelopment)
