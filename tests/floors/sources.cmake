# source_files(OUT FOLDER): the C++ files below a folder.
function(source_files out folder)
  file(GLOB_RECURSE files ${folder}/*.h ${folder}/*.hpp ${folder}/*.cpp ${folder}/*.cc ${folder}/*.c)
  set(${out} ${files} PARENT_SCOPE)
endfunction()

# code_of(OUT FILE): its text without comments, each line with a line break before it.
function(code_of out file)
  file(READ ${file} text)
  string(REGEX REPLACE "//[^\n]*" "" text "${text}")
  string(REGEX REPLACE "/\\*([^*]|\\*+[^*/])*\\*+/" "" text "${text}")
  set(${out} "\n${text}" PARENT_SCOPE)
endfunction()

# includes_of(OUT FILE): what it includes, quoted or in angle brackets, without the brackets.
function(includes_of out file)
  code_of(text ${file})
  string(REGEX MATCHALL "\n[ \t]*#[ \t]*include[ \t]*[\"<][^\">\n]+" lines "${text}")
  list(TRANSFORM lines REPLACE "^[^\"<]*[\"<]" "")
  set(${out} ${lines} PARENT_SCOPE)
endfunction()

function(report problems)
  if(problems)
    list(JOIN problems "\n  " text)
    message(FATAL_ERROR "\n  ${text}")
  endif()
endfunction()
