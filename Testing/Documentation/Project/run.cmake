# cmake -DPROGRAM= -DEXPECTED= -P run.cmake: runs a program in an empty folder. If the file EXPECTED exists, the program
# must print its content.
cmake_minimum_required(VERSION 3.25)
set(folder ${PROGRAM}.run)
file(REMOVE_RECURSE ${folder})
file(MAKE_DIRECTORY ${folder})
execute_process(COMMAND ${PROGRAM} WORKING_DIRECTORY ${folder} OUTPUT_VARIABLE output ERROR_VARIABLE errors
  RESULT_VARIABLE result TIMEOUT 60)
if(NOT result EQUAL 0 OR errors)
  message(FATAL_ERROR "ended with ${result}: ${output}${errors}")
endif()
if(EXISTS ${EXPECTED})
  file(READ ${EXPECTED} expected)
  if(NOT output STREQUAL expected)
    message(FATAL_ERROR "printed\n${output}\nnot\n${expected}")
  endif()
endif()
