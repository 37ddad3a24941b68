# The engine on CUDA: the sources for nvcc, headers that only these include, and the host's part.
set(VOXELD_CUDA_KERNELS
  kernels_draw_all.cu kernels_draw_lines.cu
  kernels_few_lines.cu kernels_filled.cu kernels_generate.cu kernels_implicit.cu kernels_index.cu kernels_line_regions.cu
  kernels_lines.cu kernels_points.cu kernels_slice.cu kernels_triangles.cu)
set(VOXELD_CUDA_KERNEL_PARTS
  covered-inl.h draw-inl.h filled-inl.h flush-inl.h implicit-inl.h items-inl.h lines-inl.h pairs-inl.h pixels-inl.h points-inl.h region_scratch-inl.h samples-inl.h solids-inl.h spans-inl.h
  triangles-inl.h unsorted-inl.h warp-inl.h)
set(VOXELD_CUDA_HOST
  api.cc broadcast_plan.cc compiled_formulas.cc cpu_voxels.cc cuda_core.cc cuda_engine.cc cuda_generator.cc cuda_pictures.cc cuda_volume.cc
  cuda_volume_arrays.cc cuda_volume_crowds.cc cuda_volume_enter.cc cuda_volume_implicit.cc cuda_volume_passes.cc device.cc formula_source.cc line_index.cc nccl.cc nvrtc.cc opened_library.cc packed_plan.cc pair_index.cc pin.cc point_index.cc pool.cc
  region_index.cc stopwatch.cc triangle_index.cc upload_plan.cc uploader.cc)
# The files that a kernel compiled at run time includes: the host's part embeds their text.
set(VOXELD_FORMULA_SOURCES
  gpu/portable.h gpu/implicit/number.h gpu/implicit/interval.h gpu/implicit/dual.h gpu/implicit/row.h gpu/cuda/covered_types.h
  gpu/cuda/covered-inl.h)
# Sets `variable` to a source with that text, made in this directory.
function(voxeld_formula_sources variable)
  set(output ${CMAKE_CURRENT_BINARY_DIR}/formula_sources.cc)
  list(TRANSFORM VOXELD_FORMULA_SOURCES PREPEND ${CMAKE_SOURCE_DIR}/ OUTPUT_VARIABLE sources)
  add_custom_command(OUTPUT ${output}
    COMMAND ${CMAKE_COMMAND} -DROOT=${CMAKE_SOURCE_DIR} "-DSOURCES=${VOXELD_FORMULA_SOURCES}" -DOUTPUT=${output}
            -P ${CMAKE_SOURCE_DIR}/cmake/EmbedSources.cmake
    DEPENDS ${sources} ${CMAKE_SOURCE_DIR}/cmake/EmbedSources.cmake VERBATIM)
  set(${variable} ${output} PARENT_SCOPE)
endfunction()
