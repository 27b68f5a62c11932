// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The module pliant._native: the C++ libraries as the package `pliant` calls them, with arguments
// by position. It checks types and shapes, releases the GIL while it works, and turns Error into
// the classes of pliant.errors. Python makes of it what users see (paths, arrays of any layout,
// records).
#pragma once

#include "python/native/convert.h"

namespace pliant::python {

void BindExtractor(py::module_& module);
void BindMatching(py::module_& module);
void BindIndex(py::module_& module);
void BindTracking(py::module_& module);
void BindEvaluation(py::module_& module);
void BindSimulation(py::module_& module);

}  // namespace pliant::python
