// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The module pliant._native: the C++ libraries as the package `pliant` calls them. It checks types
// and shapes, releases the GIL while it works, and turns Error into the classes of pliant.errors;
// what users see (paths, arrays of any layout, records) is made of it in Python.
#pragma once

#include <pybind11/pybind11.h>

namespace pliant::python {

void BindErrors();
void BindExtractor(pybind11::module_& module);
void BindMatching(pybind11::module_& module);
void BindEngine(pybind11::module_& module);
void BindTracking(pybind11::module_& module);
void BindSimulation(pybind11::module_& module);

}  // namespace pliant::python
