# npm ci into WORK. Without a registry the test is skipped, and the build goes on.
file(MAKE_DIRECTORY ${WORK})
file(COPY ${SOURCE}/package.json ${SOURCE}/package-lock.json DESTINATION ${WORK})
execute_process(COMMAND ${NPM} ci --no-audit --no-fund --loglevel=error WORKING_DIRECTORY ${WORK} RESULT_VARIABLE failed)
if(failed)
  message(WARNING "npm ci failed in ${WORK}: the test that needs it will be skipped")
  file(REMOVE_RECURSE ${WORK}/node_modules)
endif()
file(TOUCH ${WORK}/installed)
