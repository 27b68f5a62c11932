# cmake -D PROGRAM=... -D FOLDER=... -P PliantPrint.cmake: writes what the program prints about itself.
file(MAKE_DIRECTORY ${FOLDER})
cmake_path(GET PROGRAM FILENAME name)

function(print_into file)
  execute_process(COMMAND ${PROGRAM} ${ARGN} OUTPUT_FILE ${FOLDER}/${file} COMMAND_ERROR_IS_FATAL ANY)
endfunction()

print_into(${name}.1 --man)
print_into(${name} --completion bash)
print_into(_${name} --completion zsh)
print_into(${name}.fish --completion fish)
