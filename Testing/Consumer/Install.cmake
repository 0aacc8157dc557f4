cmake_minimum_required(VERSION 3.25)
# cmake -DBUILD= -DSOURCE= -DPREFIX= -P Install.cmake: installs and then moves the tree to PREFIX, so that
# whoever uses it there shows that it can be moved.
file(REMOVE_RECURSE ${PREFIX} ${PREFIX}-before)
execute_process(COMMAND ${CMAKE_COMMAND} --install ${BUILD} --prefix ${PREFIX}-before
  OUTPUT_QUIET COMMAND_ERROR_IS_FATAL ANY)
file(RENAME ${PREFIX}-before ${PREFIX})

file(GLOB_RECURSE headers RELATIVE ${PREFIX}/include ${PREFIX}/include/*)
if(NOT "palpate/Palpate.h" IN_LIST headers)
  message(FATAL_ERROR "palpate/Palpate.h is not installed: ${headers}")
endif()
foreach(header IN LISTS headers)
  if(NOT header MATCHES "^palpate/((vtk/|fcl/|imstk/)?[A-Za-z]+|palpate_c)\\.h$")
    message(FATAL_ERROR "installed, but not a public header: ${header}")
  endif()
endforeach()

file(GLOB_RECURSE packageFiles ${PREFIX}/*.cmake)
foreach(packageFile IN LISTS packageFiles)
  file(READ ${packageFile} text)
  foreach(folder ${BUILD} ${SOURCE} ${PREFIX})
    string(FIND "${text}" "${folder}" found)
    if(NOT found EQUAL -1)
      message(FATAL_ERROR "${packageFile} names ${folder}")
    endif()
  endforeach()
endforeach()
