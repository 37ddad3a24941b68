# Finds CUDA by itself, also where nvcc is not on the PATH. Sets VOXELD_HAVE_CUDA.
#
# VOXELD_CUDA: AUTO takes it if it is there, ON asks for it, OFF leaves it out.
# VOXELD_HASTY: kernels are compiled in a tenth of the time and run several times slower: for machines without a GPU,
# where all that can be seen of them is that they compile and link.
set(VOXELD_HAVE_CUDA OFF)
if(VOXELD_CUDA STREQUAL "OFF")
  message(STATUS "CUDA engine: left out (VOXELD_CUDA=OFF)")
  return()
endif()
if(NOT CMAKE_CUDA_COMPILER)
  find_program(VOXELD_NVCC nvcc HINTS ENV CUDACXX ENV CUDA_PATH PATHS /usr/local/cuda/bin /opt/cuda/bin
                                PATH_SUFFIXES bin)
  if(VOXELD_NVCC)
    set(CMAKE_CUDA_COMPILER ${VOXELD_NVCC})
  endif()
endif()
if(NOT CMAKE_CUDA_COMPILER)
  if(VOXELD_CUDA STREQUAL "AUTO")
    message(STATUS "CUDA engine: no nvcc found; this build has the CPU engine alone")
    return()
  endif()
  message(FATAL_ERROR "VOXELD_CUDA=ON, but there is no nvcc on the PATH, in CUDA_PATH or under /usr/local/cuda")
endif()
# Hopper natively, others by way of PTX: the generator from Turing on, the engine from Ampere on, whose blocks of threads
# have the shared memory that it draws in.
set(CMAKE_CUDA_ARCHITECTURES 75-virtual 90-real)
set(CMAKE_CUDA_RUNTIME_LIBRARY Static)
if(VOXELD_CCACHE)
  set(CMAKE_CUDA_COMPILER_LAUNCHER ${VOXELD_CCACHE})
endif()
enable_language(CUDA)
# CMake 3.25 does not know this level of the newest compilers.
if(NOT CMAKE_CUDA20_STANDARD_COMPILE_OPTION)
  set(CMAKE_CUDA20_STANDARD_COMPILE_OPTION "-std=c++20")
  set(CMAKE_CUDA20_EXTENSION_COMPILE_OPTION "-std=c++20")
endif()
set(VOXELD_CUDA_HASTE)
if(VOXELD_HASTY)
  if(CMAKE_CUDA_COMPILER_VERSION VERSION_GREATER_EQUAL 13.0)
    set(VOXELD_CUDA_HASTE --Ofast-compile=max)
  else()
    set(VOXELD_CUDA_HASTE -Xptxas=-O0)
  endif()
endif()
find_package(CUDAToolkit REQUIRED)
set(VOXELD_HAVE_CUDA ON)
message(STATUS "CUDA engine: nvcc ${CMAKE_CUDA_COMPILER_VERSION}, ${CMAKE_CUDA_COMPILER}")
