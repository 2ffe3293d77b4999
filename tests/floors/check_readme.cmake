# Fails when the README's picture of the house is not the house: every module with its floor, and nothing else.
#   ROOT      the source tree
#   MODULES   FOLDER=FLOOR of every module, with commas between them
cmake_minimum_required(VERSION 3.25)
file(STRINGS ${ROOT}/README.md lines REGEX "^(calib|service|clients|idl)[a-z0-9_/]* +[0-9]+ ")
set(drawn "")
foreach(line IN LISTS lines)
  string(REGEX REPLACE "^([a-z0-9_/]+) +([0-9]+) .*" "\\1=\\2" module "${line}")
  list(APPEND drawn ${module})
endforeach()
string(REPLACE "," ";" there "${MODULES}")
set(missing ${there})
list(REMOVE_ITEM missing ${drawn})
set(wrong ${drawn})
list(REMOVE_ITEM wrong ${there})
if(missing OR wrong)
  message(FATAL_ERROR "README.md's picture of the folders and their floors is not that of the CMake files:\n"
                      "  it lacks: ${missing}\n  it has, and should not: ${wrong}")
endif()
