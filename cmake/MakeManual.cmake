# Generates manual pages and shell completions by running the programs:
#   cmake -DVOXELD= -DVOXELCTL= -DGZIP= -DOUT=FOLDER -P MakeManual.cmake
# Previous content of the folder is removed.
file(REMOVE_RECURSE ${OUT})

function(run)
  execute_process(COMMAND ${ARGN} RESULT_VARIABLE result)
  if(NOT result EQUAL 0)
    message(FATAL_ERROR "${ARGN} ended with ${result}")
  endif()
endfunction()

# write(FILE PROGRAM ARGUMENT …): writes what the program prints to the file.
function(write file)
  get_filename_component(folder ${OUT}/${file} DIRECTORY)
  file(MAKE_DIRECTORY ${folder})
  execute_process(COMMAND ${ARGN} OUTPUT_FILE ${OUT}/${file} RESULT_VARIABLE result)
  if(NOT result EQUAL 0)
    message(FATAL_ERROR "${ARGN} ended with ${result}")
  endif()
endfunction()

run(${VOXELCTL} __manual ${OUT}/man/man1)
write(man/man8/voxeld.8 ${VOXELD} --help-man)
file(GLOB pages ${OUT}/man/*/*)
run(${GZIP} -9n ${pages})
write(bash-completion/completions/voxelctl ${VOXELCTL} completion bash)
write(zsh/vendor-completions/_voxelctl ${VOXELCTL} completion zsh)
write(fish/vendor_completions.d/voxelctl.fish ${VOXELCTL} completion fish)
