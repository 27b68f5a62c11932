// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include <exception>

#include "descriptor/base/error.h"
#include "python/native/bindings.h"

namespace pliant::python {
namespace {

constexpr std::pair<ErrorCode, const char*> kClasses[] = {
    {ErrorCode::kInvalidArgument, "InvalidArgumentError"},
    {ErrorCode::kNotFound, "NotFoundError"},
    {ErrorCode::kConflict, "ConflictError"},
    {ErrorCode::kCorrupt, "CorruptError"},
    {ErrorCode::kUnsupportedMediaType, "UnsupportedMediaTypeError"},
    {ErrorCode::kTooLarge, "TooLargeError"},
    {ErrorCode::kUnprocessable, "UnprocessableError"},
    {ErrorCode::kUnavailable, "UnavailableError"},
    {ErrorCode::kNoSpace, "NoSpaceError"},
    {ErrorCode::kCancelled, "CancelledError"},
    {ErrorCode::kReadOnly, "ReadOnlyError"}};

// The class of pliant.errors for the error's code, with its reason and its sentence.
void Raise(const Error& error) {
  try {
    const std::string what = error.what();  // may quote a path that is not UTF-8
    const auto text = py::reinterpret_steal<py::str>(PyUnicode_DecodeUTF8(
        what.data(), static_cast<Py_ssize_t>(what.size()), "backslashreplace"));
    if (!text) throw py::error_already_set();
    const char* name = "InternalError";
    for (const auto& [code, of_code] : kClasses)
      if (code == error.code()) name = of_code;
    const py::object type = py::module_::import("pliant.errors").attr(name);
    const py::object raised = type(text, py::arg("code") = error.reason());
    PyErr_SetObject(type.ptr(), raised.ptr());
  } catch (py::error_already_set& other) {
    other.restore();
  }
}

}  // namespace
}  // namespace pliant::python

PYBIND11_MODULE(_native, module) {
  module.doc() = "The C++ libraries of Pliant. Use the package `pliant`.";
  pybind11::register_exception_translator([](std::exception_ptr thrown) {
    try {
      if (thrown) std::rethrow_exception(thrown);
    } catch (const pliant::Error& error) {
      pliant::python::Raise(error);
    }
  });
  pliant::python::BindExtractor(module);
  pliant::python::BindMatching(module);
  pliant::python::BindIndex(module);
  pliant::python::BindTracking(module);
  pliant::python::BindEvaluation(module);
  pliant::python::BindSimulation(module);
}
