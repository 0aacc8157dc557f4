# Debian packages: CMake/package.sh configures for them and calls cpack. libpalpate0 has the libraries that do not need
# VTK, libpalpate-dev what programs are compiled against, libpalpate-vtk0 and libpalpate-vtk-dev the same of
# Palpate::Vtk, python3-palpate the Python package, and palpate-tools the scenes, charts, replay and check as commands
# with man pages. FCL has no package.
set(tools OrganScene LiverLift FastNeedle Suturing Cutting Threading BoneDrilling Palpation Retraction RobotArms Haptics XRay
  SpeedAccuracy Replay)
set(manual ${PROJECT_BINARY_DIR}/manual)
find_program(HELP2MAN help2man REQUIRED)
find_program(GZIP gzip REQUIRED)

# palpate_manual(COMMAND NAME): the manual page of a command, from what its --help prints.
function(palpate_manual command name)
  add_custom_command(OUTPUT ${manual}/${name}.1.gz
    COMMAND ${CMAKE_COMMAND} -E env LD_LIBRARY_PATH=$<TARGET_FILE_DIR:Palpate>:$<TARGET_FILE_DIR:PalpateMeshFiles>:$<TARGET_FILE_DIR:PalpateVtk>:$<TARGET_FILE_DIR:PalpateSimplify>
      PYTHONPATH=${PROJECT_BINARY_DIR}/Python ${HELP2MAN} --no-info --no-discard-stderr
      --version-string=${PROJECT_VERSION} --name=${ARGN} --output=${manual}/${name}.1 ${command}
    COMMAND ${GZIP} --force --best --no-name ${manual}/${name}.1
    DEPENDS ${command} VERBATIM)
  set(pages ${pages} ${manual}/${name}.1.gz PARENT_SCOPE)
endfunction()

file(MAKE_DIRECTORY ${manual})
set(pages)
foreach(tool IN LISTS tools)
  string(REGEX REPLACE "([a-z])([A-Z])" "\\1-\\2" name ${tool})
  string(TOLOWER palpate-${name} name)
  string(REPLACE xray x-ray name ${name})
  install(PROGRAMS $<TARGET_FILE:${tool}> DESTINATION ${CMAKE_INSTALL_BINDIR} RENAME ${name} COMPONENT Tools)
  # The command that the manual names is the installed one.
  add_custom_command(OUTPUT ${manual}/${name} DEPENDS ${tool}
    COMMAND ${CMAKE_COMMAND} -E create_symlink $<TARGET_FILE:${tool}> ${manual}/${name})
  palpate_manual(${manual}/${name} ${name} "Palpate's program ${tool}")
endforeach()
file(WRITE ${manual}/palpate-check "#!/usr/bin/python3\nfrom palpate.check import main\n\nmain()\n")
file(CHMOD ${manual}/palpate-check PERMISSIONS OWNER_READ OWNER_WRITE OWNER_EXECUTE GROUP_READ GROUP_EXECUTE WORLD_READ
  WORLD_EXECUTE)
install(PROGRAMS ${manual}/palpate-check DESTINATION ${CMAKE_INSTALL_BINDIR} COMPONENT Tools)
palpate_manual(${manual}/palpate-check palpate-check "check a recorded sequence of meshes for contacts and crossings")
add_custom_target(Manual ALL DEPENDS ${pages} PalpatePython)
install(FILES ${pages} DESTINATION ${CMAKE_INSTALL_MANDIR}/man1 COMPONENT Tools)

set(modules lib/python3/dist-packages/palpate)
file(GLOB python ${PROJECT_SOURCE_DIR}/Source/Adapters/Python/palpate/*)
list(FILTER python INCLUDE REGEX "\\.(py|pyi|html)$|py\\.typed$")
install(TARGETS PalpatePython LIBRARY DESTINATION ${modules} COMPONENT PythonPackage)
install(FILES ${python} DESTINATION ${modules} COMPONENT PythonPackage)

# What each Debian package must have. Date and text of the changelog are those of the last commit.
execute_process(COMMAND git -C ${PROJECT_SOURCE_DIR} log -1 --format=%aD OUTPUT_VARIABLE date OUTPUT_STRIP_TRAILING_WHITESPACE)
set(CPACK_PACKAGE_CONTACT "The Palpate developers <palpate@packages.debian.org>")
file(WRITE ${manual}/changelog
"palpate (${PROJECT_VERSION}) unstable; urgency=medium

  * Version ${PROJECT_VERSION}.

 -- ${CPACK_PACKAGE_CONTACT}  ${date}
")
execute_process(COMMAND ${GZIP} --force --best --no-name ${manual}/changelog)
file(READ ${PROJECT_SOURCE_DIR}/LICENSE license)
file(WRITE ${manual}/copyright
"Palpate, collision detection for surgical simulation.

Copyright: 2026 The Palpate developers

Licensed under the Apache License, version 2.0. On Debian systems its text is in
/usr/share/common-licenses/Apache-2.0.
")

set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_DESCRIPTION_SUMMARY "")  # each package has its own
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_COMPONENTS_ALL)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS_PRIVATE_DIRS ${PROJECT_BINARY_DIR}/Source ${PROJECT_BINARY_DIR}/Source/Simplify/Meshoptimizer
  ${PROJECT_BINARY_DIR}/Source/Adapters/MeshFiles ${PROJECT_BINARY_DIR}/Source/Adapters/Vtk)
set(CPACK_STRIP_FILES ON)
set(CPACK_PACKAGE_VERSION ${PROJECT_VERSION})
if(PALPATE_REPOSITORY)
  set(CPACK_DEBIAN_PACKAGE_HOMEPAGE ${PALPATE_REPOSITORY})
endif()
set(CPACK_INSTALL_DEFAULT_DIRECTORY_PERMISSIONS OWNER_READ OWNER_WRITE OWNER_EXECUTE GROUP_READ GROUP_EXECUTE WORLD_READ
  WORLD_EXECUTE)

# palpate_package(COMPONENT PACKAGE SECTION DEPENDS SUMMARY TEXT)
macro(palpate_package component package section depends summary text)
  string(TOUPPER ${component} upper)
  list(APPEND CPACK_COMPONENTS_ALL ${component})
  set(CPACK_DEBIAN_${upper}_PACKAGE_NAME ${package})
  set(CPACK_DEBIAN_${upper}_PACKAGE_SECTION ${section})
  set(CPACK_DEBIAN_${upper}_PACKAGE_DEPENDS "${depends}")
  set(CPACK_DEBIAN_${upper}_DESCRIPTION "${summary}\n${text}")
  install(FILES ${manual}/copyright DESTINATION share/doc/${package} COMPONENT ${component})
  install(FILES ${manual}/changelog.gz DESTINATION share/doc/${package} COMPONENT ${component})
endmacro()
set(same "(= ${PROJECT_VERSION})")
palpate_package(Library libpalpate0 libs ""
  "collision detection for surgical simulation"
  "Contacts between deforming meshes, lines, points, shapes and distance fields,\ncomplete, each once and the same on every machine.")
palpate_package(LibraryDevelopment libpalpate-dev libdevel
  "libpalpate0 ${same}, libeigen3-dev (>= 3.4), libhwy-dev, libgmp-dev"
  "collision detection for surgical simulation: development files"
  "Headers, and what CMake and pkg-config need. Programs need C++20, or C99.")
palpate_package(Vtk libpalpate-vtk0 libs "libpalpate0 ${same}"
  "collision detection for surgical simulation: drawing by VTK"
  "Pictures, windows and data sets of bodies and contacts.")
palpate_package(VtkDevelopment libpalpate-vtk-dev libdevel "libpalpate-vtk0 ${same}, libpalpate-dev ${same}, libvtk9-dev"
  "collision detection for surgical simulation: development files for VTK"
  "Headers of Palpate::Vtk, and what CMake needs.")
palpate_package(PythonPackage python3-palpate python "libpalpate0 ${same}, python3:any (>= 3.11), python3 (<< 3.12), python3-numpy"
  "collision detection for surgical simulation: Python package"
  "NumPy arrays in, contacts out.")
palpate_package(Tools palpate-tools science "python3:any, libpalpate-vtk0 ${same}, python3-palpate ${same}"
  "collision detection for surgical simulation: commands"
  "Scenes, charts of speed against accuracy, replay of captures, and a check of\nrecorded sequences.")
# Programs that link a library get this dependency.
file(WRITE ${manual}/library/shlibs "")
foreach(library Palpate PalpateMeshFiles PalpateSimplify)
  file(APPEND ${manual}/library/shlibs "lib${library} ${PROJECT_VERSION_MAJOR} libpalpate0 ${same}\n")
endforeach()
file(WRITE ${manual}/vtk/shlibs "libPalpateVtk ${PROJECT_VERSION_MAJOR} libpalpate-vtk0 ${same}\n")
file(WRITE ${manual}/triggers "activate-noawait ldconfig\n")
set(CPACK_DEBIAN_LIBRARY_PACKAGE_CONTROL_EXTRA ${manual}/library/shlibs ${manual}/triggers)
set(CPACK_DEBIAN_VTK_PACKAGE_CONTROL_EXTRA ${manual}/vtk/shlibs ${manual}/triggers)
include(CPack)
