# npm ci, then the bundle. SOURCE: the page's folder. OUTPUT: where the files go. NPM, NODE: the programs. DOCUMENTS: what
# the page's Help shows, separated by commas, from ROOT on.
# Packages are installed beside the output, so that the source tree stays as it is.
file(MAKE_DIRECTORY ${OUTPUT})
file(COPY ${SOURCE}/package.json ${SOURCE}/package-lock.json ${SOURCE}/tsconfig.json ${SOURCE}/build.mjs ${SOURCE}/help.mjs ${SOURCE}/index.html
          ${SOURCE}/page.css ${SOURCE}/src DESTINATION ${OUTPUT}/work)
file(SHA256 ${SOURCE}/package-lock.json lock)
set(stamp ${OUTPUT}/work/installed)
set(installed "")
if(EXISTS ${stamp})
  file(READ ${stamp} installed)
endif()
if(NOT installed STREQUAL lock)
  execute_process(COMMAND ${NPM} ci --no-audit --no-fund --loglevel=error WORKING_DIRECTORY ${OUTPUT}/work RESULT_VARIABLE failed)
  if(failed)
    message(FATAL_ERROR "npm ci failed in ${OUTPUT}/work: the page of `huetrack view` needs npm's registry (or a filled npm cache) "
                        "once. Without a network, configure with -DHUETRACK_PAGE=OFF")
  endif()
  file(WRITE ${stamp} ${lock})
endif()
execute_process(COMMAND ${NODE} build.mjs ${OUTPUT} ${ROOT} ${DOCUMENTS} WORKING_DIRECTORY ${OUTPUT}/work RESULT_VARIABLE failed)
if(failed)
  message(FATAL_ERROR "bundling the page failed, see above")
endif()

# For page_files.cpp: its compilation must be new whenever a file is, for ccache too, which does not look into .incbin.
set(stamp "")
foreach(file index.html page.css page.js help.html)
  file(SHA256 ${OUTPUT}/${file} hash)
  string(APPEND stamp ${hash})
endforeach()
file(WRITE ${OUTPUT}/page_stamp.h "#define HUETRACK_PAGE_STAMP \"${stamp}\"\n")
