# Fails when a file outside a fence has what only the files inside may have.
#   ROOT   the source tree
#   FENCE  one of the names below
cmake_minimum_required(VERSION 3.25)
include(${CMAKE_CURRENT_LIST_DIR}/sources.cmake)

set(folders calib service idl clients tests)   # where it is looked for
set(inside "^$")                               # the paths that may
set(except "^$")                               # what matches the pattern and is allowed all the same
set(include "[\n][ \t]*#[ \t]*include[ \t]*[\"<]")
if(FENCE STREQUAL "ioctl")
  set(pattern "[^A-Za-z0-9_]ioctl[ \t\n]*\\(")
  # and those that stand in for a driver, by an ioctl() of their own
  set(inside "^(service/capture/v4l2/v4l2_call\\.cpp|tests/capture/v4l2_faults_test\\.cpp|tests/v4l2/locked_up\\.c)$")
elseif(FENCE STREQUAL "yaml_cpp")
  set(pattern "${include}yaml-cpp/")
  set(inside "^calib/yaml/")
elseif(FENCE STREQUAL "yaml_reader")   # modules are given option structs; YAML ends where files are read
  set(pattern "${include}calib/(yaml/yaml_reader|files/csv_table)")
  set(inside "^(calib|service/(recordings|capture|truth|tracks|config|pipeline|page|doctor|daemon)|clients/plot|tests)/")
elseif(FENCE STREQUAL "fast_dds")
  set(pattern "${include}(fastdds|fastrtps|fastcdr)/")
  set(inside "^(service/publish|service/hosts|idl|clients|tests)/")
elseif(FENCE STREQUAL "cairo")   # one drawing surface
  set(pattern "${include}cairo/")
  set(inside "^service/drawing/")
elseif(FENCE STREQUAL "frames_for_trackers")   # what a frame is, not where it came from
  set(folders service/color service/object_tracking service/camera_tracking)
  set(pattern "${include}capture/")
  set(except "${include}capture/frames/(frame|pixel_format)\\.h")
elseif(FENCE STREQUAL "results_for_publish")   # what was found, not how; and the clock that latencies are measured by
  set(folders service/publish)
  set(pattern "${include}(capture|object_tracking|camera_tracking)/")
  set(except "${include}(capture/frames/frame|capture/timing/(capture_clock|host_clock)|object_tracking/object_estimate|camera_tracking/camera_estimate)\\.h")
elseif(FENCE STREQUAL "camera_methods")   # what is built without them, as the demo is, does not link otherwise
  set(folders service clients)
  set(pattern "${include}camera_tracking/")
  set(inside "^service/(camera_tracking/|config/board_start\\.cpp)")
  set(except "${include}camera_tracking/(camera_estimate|camera_tracker|camera_start|map_file|methods/make_camera_tracker)\\.h")
elseif(FENCE STREQUAL "cli11")   # heavy headers from here on: each costs every file that sees it seconds
  set(pattern "${include}CLI/")
  set(inside "^(service/daemon/(main|commands)\\.cpp|clients/huetrack/main\\.cpp|calib/program/|tests/benchmark/)")
elseif(FENCE STREQUAL "spdlog")
  set(pattern "${include}spdlog/")
  set(inside "^(service/(pipeline|reports|daemon)/[a-z0-9_]*\\.cpp|tests/(pipeline|reports)/)")
elseif(FENCE STREQUAL "ceres")
  set(pattern "${include}ceres/")
  set(inside "^calib/(solver|wave)/([a-z0-9_]*adjustment[a-z0-9_]*\\.cpp|(corner|outline)_cost\\.(h|cpp))$")
elseif(FENCE STREQUAL "regex")   # and it recurses once per character: it runs out of stack on a long line
  set(pattern "${include}regex>")
else()
  message(FATAL_ERROR "there is no fence ${FENCE}")
endif()

set(problems "")
foreach(folder IN LISTS folders)
  source_files(files ${ROOT}/${folder})
  foreach(file IN LISTS files)
    cmake_path(RELATIVE_PATH file BASE_DIRECTORY ${ROOT} OUTPUT_VARIABLE shown)
    code_of(text ${file})
    string(REGEX REPLACE "${except}" "" text "${text}")
    if(NOT shown MATCHES "${inside}" AND "${text}" MATCHES "${pattern}")
      string(STRIP "${CMAKE_MATCH_0}" found)
      list(APPEND problems "${shown} has '${found}', which is fenced in (fence ${FENCE})")
    endif()
  endforeach()
endforeach()
report("${problems}")
