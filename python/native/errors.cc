// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Error -> the class of pliant.errors for its code, with its reason and its sentence.
#include <exception>

#include "descriptor/base/error.h"
#include "python/native/bindings.h"

namespace pliant::python {
namespace {

namespace py = pybind11;

const char* ClassName(ErrorCode code) {
  switch (code) {
    case ErrorCode::kInvalidArgument:
      return "InvalidArgumentError";
    case ErrorCode::kNotFound:
      return "NotFoundError";
    case ErrorCode::kConflict:
      return "ConflictError";
    case ErrorCode::kCorrupt:
      return "CorruptError";
    case ErrorCode::kUnsupportedMediaType:
      return "UnsupportedMediaTypeError";
    case ErrorCode::kTooLarge:
      return "TooLargeError";
    case ErrorCode::kUnprocessable:
      return "UnprocessableError";
    case ErrorCode::kUnavailable:
      return "UnavailableError";
    case ErrorCode::kNoSpace:
      return "NoSpaceError";
    case ErrorCode::kCancelled:
      return "CancelledError";
    case ErrorCode::kReadOnly:
      return "ReadOnlyError";
    case ErrorCode::kInternal:
      break;
  }
  return "InternalError";
}

void Raise(const Error& error) {
  try {
    const std::string what = error.what();  // may quote a path that is not UTF-8
    const auto text = py::reinterpret_steal<py::str>(PyUnicode_DecodeUTF8(
        what.data(), static_cast<Py_ssize_t>(what.size()), "backslashreplace"));
    if (!text) throw py::error_already_set();
    const py::object type = py::module_::import("pliant.errors").attr(ClassName(error.code()));
    const py::object raised = type(text, py::arg("code") = error.reason());
    PyErr_SetObject(type.ptr(), raised.ptr());
  } catch (py::error_already_set& other) {
    other.restore();
  }
}

}  // namespace

void BindErrors() {
  py::register_exception_translator([](std::exception_ptr thrown) {
    try {
      if (thrown) std::rethrow_exception(thrown);
    } catch (const Error& error) {
      Raise(error);
    }
  });
}

}  // namespace pliant::python
