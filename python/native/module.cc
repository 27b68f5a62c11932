// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "python/native/bindings.h"

PYBIND11_MODULE(_native, module) {
  module.doc() = "The C++ libraries of Pliant. Use the package `pliant`.";
  pliant::python::BindErrors();
  pliant::python::BindExtractor(module);
  pliant::python::BindMatching(module);
  pliant::python::BindEngine(module);
  pliant::python::BindTracking(module);
  pliant::python::BindSimulation(module);
}
