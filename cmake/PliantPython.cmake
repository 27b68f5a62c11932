# Whether the Python package is built: PLIANT_PYTHON_FOUND. Sanitised builds leave it out, because Python itself is
# not sanitised.
# Debian's Python, which has Debian's packages, runs the tests in any case.
set(PLIANT_PYTHON_FOUND OFF)
find_program(PLIANT_PYTHON_EXECUTABLE NAMES /usr/bin/python3 python3 DOC "The Python that the package is for")
set(Python3_EXECUTABLE ${PLIANT_PYTHON_EXECUTABLE})
if(NOT PLIANT_PYTHON)
  return()
endif()

find_package(Python3 COMPONENTS Interpreter Development.Module)
if(Python3_FOUND)
  set(PYTHON_EXECUTABLE ${Python3_EXECUTABLE})
  find_package(pybind11 2.10 QUIET)
  execute_process(COMMAND ${Python3_EXECUTABLE} -c "import numpy" RESULT_VARIABLE numpy_missing OUTPUT_QUIET ERROR_QUIET)
endif()
if(pybind11_FOUND AND NOT numpy_missing)
  set(PLIANT_PYTHON_FOUND ON)
elseif(PLIANT_PYTHON STREQUAL "AUTO")
  message(STATUS "Python package left out: it needs pybind11 and NumPy (docker/packages-python.txt)")
else()
  message(FATAL_ERROR "The Python package needs pybind11 and NumPy: bash docker/install-packages.sh python\n"
                      "Without it: -DPLIANT_PYTHON=OFF")
endif()
