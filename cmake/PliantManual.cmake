# cmake -D HELP2MAN=... -D PROGRAM=... -D OUT=... -P PliantManual.cmake: the program's manual page, from its --help and
# that of every command.
cmake_path(GET PROGRAM FILENAME name)

# Appends the help of the commands below `pliant ARGN`, and of those below them.
function(add_commands)
  execute_process(COMMAND ${PROGRAM} ${ARGN} --help OUTPUT_VARIABLE help COMMAND_ERROR_IS_FATAL ANY)
  if(ARGN)
    list(JOIN ARGN " " words)
    file(APPEND ${OUT}.commands "[${name} ${words}]\n.nf\n${help}\n.fi\n")
  endif()
  if(help MATCHES "\nSubcommands:\n(.*)")
    string(REGEX MATCHALL "\n  [a-z]+ " commands "\n${CMAKE_MATCH_1}")
    foreach(command IN LISTS commands)
      string(STRIP "${command}" command)
      add_commands(${ARGN} ${command})
    endforeach()
  endif()
endfunction()

file(WRITE ${OUT}.commands "")
add_commands()
if(name STREQUAL "pliant-server")
  add_commands(keys) # a command of its own, which --help names in words
endif()
execute_process(COMMAND ${PROGRAM} --help OUTPUT_VARIABLE help COMMAND_ERROR_IS_FATAL ANY)
string(REGEX MATCH "^[^\n]*" title "${help}")
execute_process(COMMAND ${HELP2MAN} --no-info --name=${title} --include=${OUT}.commands --output=${OUT} ${PROGRAM}
                COMMAND_ERROR_IS_FATAL ANY)
