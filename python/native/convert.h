// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Between NumPy's arrays and the value types. All of it needs the GIL. The arrays that come in are
// of the exact type and C-contiguous: the Python side sees to that, and bindings declare them with
// noconvert(), so that nothing is copied or rounded behind the caller's back.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include "descriptor/features/features.h"
#include "descriptor/image/image.h"
#include "descriptor/warp/tps.h"

namespace pliant::python {

namespace py = pybind11;

using FloatArray = py::array_t<float, py::array::c_style>;
using DoubleArray = py::array_t<double, py::array::c_style>;
using ByteArray = py::array_t<std::uint8_t, py::array::c_style>;
using IndexArray = py::array_t<std::int64_t, py::array::c_style>;

inline std::vector<py::ssize_t> Shape(std::size_t rows, int columns) {
  return {static_cast<py::ssize_t>(rows), columns};
}

// H x W or H x W x 3 (R, G, B). Throws kInvalidArgument "array_shape" for others, kUnprocessable
// "image_too_small" below 16 pixels a side, kTooLarge "image_too_large" above 100 megapixels, as
// decoding a file of that size does.
Image ToImage(const ByteArray& pixels);
ByteArray FromImage(const Image& image);

// N x D float32 (Euclidean) or uint8 (Hamming). Throws kInvalidArgument for other shapes and types,
// and for values that are not finite, naming `what` and the row.
Descriptors ToDescriptors(const py::array& rows, const char* what);
py::array FromDescriptors(const Descriptors& descriptors);

// N x 6 float32: x, y, size, angle, response, octave. Values must be finite.
std::vector<Keypoint> ToKeypoints(const FloatArray& rows, const char* what);
FloatArray FromKeypoints(const std::vector<Keypoint>& keypoints);

// The object that pliant.Features is: with the attributes keypoints, descriptors, width, height and
// model_id. Back: a tuple of these five in that order.
Features ToFeatures(const py::object& features, const char* what);
py::tuple FromFeatures(const Features& features);

// N x 2 float64.
std::vector<Vec2> ToPoints(const DoubleArray& points, const char* what);
DoubleArray FromPoints(const std::vector<Vec2>& points);

// Runs long work without the GIL.
template <typename Work>
auto WithoutGil(Work work) {
  const py::gil_scoped_release release;
  return work();
}

inline py::bytes ToBytes(const std::vector<std::uint8_t>& data) {
  return {reinterpret_cast<const char*>(data.data()), data.size()};
}

// The bytes stay valid as long as `data` does: Python's bytes never change.
inline Bytes ViewOf(const py::bytes& data) {
  char* begin = nullptr;
  Py_ssize_t size = 0;
  if (PyBytes_AsStringAndSize(data.ptr(), &begin, &size) != 0) throw py::error_already_set();
  return {reinterpret_cast<const std::uint8_t*>(begin), static_cast<std::size_t>(size)};
}

}  // namespace pliant::python
