# What the library is built on. The build and the installed package (EigenposeConfig.cmake) read this one file, so that a
# program outside the tree finds the same libraries as the tree itself.
find_package(PkgConfig REQUIRED)
find_package(Threads REQUIRED)
find_package(TBB REQUIRED)
find_package(Eigen3 REQUIRED NO_MODULE)
find_package(ZLIB REQUIRED)
find_package(JPEG REQUIRED)
find_package(PNG REQUIRED)
find_package(nlohmann_json REQUIRED)
# "hdf5" may mean the MPI build; this name is always the plain one.
pkg_check_modules(HDF5 REQUIRED IMPORTED_TARGET hdf5-serial)
pkg_check_modules(HIGHWAY REQUIRED IMPORTED_TARGET libhwy)

# Debian's flann.pc asks for the MPI build of HDF5 beside the serial one that models are kept in; two HDF5 in one process
# must not be. Of FLANN only headers and its serialisation's LZ4 are used.
pkg_check_modules(LZ4 REQUIRED IMPORTED_TARGET liblz4)
find_path(FLANN_INCLUDE flann/flann.hpp REQUIRED)
if(NOT TARGET eigenpose_flann)
  add_library(eigenpose_flann INTERFACE IMPORTED)
  target_include_directories(eigenpose_flann SYSTEM INTERFACE ${FLANN_INCLUDE})
  target_link_libraries(eigenpose_flann INTERFACE PkgConfig::LZ4)
endif()

# Debian keeps OpenCV's CMake and pkg-config files in libopencv-dev, which pulls in a whole desktop; the three component
# packages we need bring only headers and libraries.
find_path(OPENCV_INCLUDE opencv2/core.hpp PATH_SUFFIXES opencv4 REQUIRED)
if(NOT TARGET eigenpose_opencv)
  add_library(eigenpose_opencv INTERFACE IMPORTED)
  target_include_directories(eigenpose_opencv SYSTEM INTERFACE ${OPENCV_INCLUDE})
  foreach(component core imgproc imgcodecs)
    find_library(OPENCV_${component} opencv_${component} REQUIRED)
    target_link_libraries(eigenpose_opencv INTERFACE ${OPENCV_${component}})
  endforeach()
endif()
