// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "python/native/convert.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "descriptor/base/error.h"
#include "descriptor/match/distance.h"

namespace pliant::python {
namespace {

[[noreturn]] void ThrowShape(const std::string& message) {
  throw Error(ErrorCode::kInvalidArgument, "array_shape", message);
}

template <typename Array>
void CheckRows(const Array& rows, py::ssize_t columns, const char* what) {
  if (rows.ndim() != 2 || rows.shape(1) != columns) {
    ThrowShape(std::string(what) + " must be an array of N x " + std::to_string(columns));
  }
  const auto at = rows.template unchecked<2>();
  for (py::ssize_t i = 0; i < rows.shape(0); ++i) {
    for (py::ssize_t j = 0; j < columns; ++j) {
      if (std::isfinite(at(i, j))) continue;
      throw Error(ErrorCode::kInvalidArgument, "not_finite",
                  std::string(what) + ": row " + std::to_string(i) + " is not finite");
    }
  }
}

}  // namespace

Image ToImage(const ByteArray& pixels) {
  const bool colour = pixels.ndim() == 3 && pixels.shape(2) == 3;
  if (pixels.ndim() != 2 && !colour) ThrowShape("image must be an array of H x W or H x W x 3");
  const DecodeOptions limits;
  const std::int64_t height = pixels.shape(0);
  const std::int64_t width = pixels.shape(1);
  if (std::min(width, height) < limits.min_side_px) {
    throw Error(ErrorCode::kUnprocessable, "image_too_small",
                "The image is " + std::to_string(width) + " x " + std::to_string(height) +
                    " pixels; the minimum is " + std::to_string(limits.min_side_px) + " per side.");
  }
  if (height > limits.max_pixels / width) {
    throw Error(ErrorCode::kTooLarge, "image_too_large",
                "The image is " + std::to_string(width) + " x " + std::to_string(height) +
                    " pixels; the limit is " + std::to_string(limits.max_pixels) + " pixels.");
  }
  const std::uint8_t* first = pixels.data();
  return {static_cast<int>(width), static_cast<int>(height), colour ? 3 : 1,
          std::vector<std::uint8_t>(first, first + pixels.size())};
}

ByteArray FromImage(const Image& image) {
  std::vector<py::ssize_t> shape = {image.height, image.width};
  if (image.channels == 3) shape.push_back(3);
  return ByteArray(shape, image.pixels.data());
}

Descriptors ToDescriptors(const py::array& rows, const char* what) {
  if (rows.ndim() != 2) ThrowShape(std::string(what) + " must be an array of N x D");
  constexpr py::ssize_t kMostColumns = 65536;
  if (rows.shape(1) > kMostColumns) {
    ThrowShape(std::string(what) + " must have at most " + std::to_string(kMostColumns) +
               " columns, not " + std::to_string(rows.shape(1)));
  }
  const auto n = static_cast<std::size_t>(rows.shape(0));
  const auto dim = static_cast<int>(rows.shape(1));
  Descriptors descriptors;
  if (py::isinstance<FloatArray>(rows)) {
    descriptors = Descriptors::Float(n, dim);
    if (n > 0) std::memcpy(descriptors.floats.data(), rows.data(), rows.nbytes());
  } else if (py::isinstance<ByteArray>(rows)) {
    descriptors = Descriptors::Binary(n, dim);
    if (n > 0) std::memcpy(descriptors.bytes.data(), rows.data(), rows.nbytes());
  } else {
    ThrowShape(std::string(what) + " must be C-contiguous float32 or uint8");
  }
  if (n > 0) CheckDescriptors(descriptors, what);  // without rows, D may be 0
  return descriptors;
}

py::array FromDescriptors(const Descriptors& descriptors) {
  const auto shape = Shape(descriptors.rows, descriptors.dim);
  if (descriptors.kind == DescriptorKind::kFloat)
    return FloatArray(shape, descriptors.floats.data());
  return ByteArray(shape, descriptors.bytes.data());
}

std::vector<Keypoint> ToKeypoints(const FloatArray& rows, const char* what) {
  CheckRows(rows, 6, what);
  const auto at = rows.unchecked<2>();
  std::vector<Keypoint> keypoints;
  keypoints.reserve(static_cast<std::size_t>(rows.shape(0)));
  for (py::ssize_t i = 0; i < rows.shape(0); ++i) {
    const float octave = std::clamp(at(i, 5), -2147483648.0F, 2147483520.0F);
    keypoints.push_back(
        {at(i, 0), at(i, 1), at(i, 2), at(i, 3), at(i, 4), static_cast<std::int32_t>(octave)});
  }
  return keypoints;
}

FloatArray FromKeypoints(const std::vector<Keypoint>& keypoints) {
  FloatArray rows(Shape(keypoints.size(), 6));
  auto at = rows.mutable_unchecked<2>();
  for (py::ssize_t i = 0; i < rows.shape(0); ++i) {
    const Keypoint& k = keypoints[static_cast<std::size_t>(i)];
    at(i, 0) = k.x;
    at(i, 1) = k.y;
    at(i, 2) = k.size;
    at(i, 3) = k.angle;
    at(i, 4) = k.response;
    at(i, 5) = static_cast<float>(k.octave);
  }
  return rows;
}

Features ToFeatures(const py::object& features, const char* what) {
  const std::string name = what;
  Features result;
  result.width = features.attr("width").cast<int>();
  result.height = features.attr("height").cast<int>();
  result.model_id = features.attr("model_id").cast<std::string>();
  const py::object keypoints = features.attr("keypoints");
  if (!py::isinstance<FloatArray>(keypoints)) {
    ThrowShape(name + ".keypoints must be C-contiguous float32");
  }
  result.keypoints = ToKeypoints(keypoints.cast<FloatArray>(), (name + ".keypoints").c_str());
  result.descriptors = ToDescriptors(features.attr("descriptors").cast<py::array>(),
                                     (name + ".descriptors").c_str());
  if (result.descriptors.rows != result.keypoints.size()) {
    ThrowShape(name + " has " + std::to_string(result.keypoints.size()) + " keypoints and " +
               std::to_string(result.descriptors.rows) + " descriptors");
  }
  return result;
}

py::tuple FromFeatures(const Features& features) {
  return py::make_tuple(FromKeypoints(features.keypoints), FromDescriptors(features.descriptors),
                        features.width, features.height, features.model_id);
}

std::vector<Vec2> ToPoints(const DoubleArray& points, const char* what) {
  CheckRows(points, 2, what);
  const auto at = points.unchecked<2>();
  std::vector<Vec2> result;
  result.reserve(static_cast<std::size_t>(points.shape(0)));
  for (py::ssize_t i = 0; i < points.shape(0); ++i) {
    result.push_back({at(i, 0), at(i, 1)});
  }
  return result;
}

DoubleArray FromPoints(const std::vector<Vec2>& points) {
  DoubleArray rows(Shape(points.size(), 2));
  auto at = rows.mutable_unchecked<2>();
  for (py::ssize_t i = 0; i < rows.shape(0); ++i) {
    at(i, 0) = points[static_cast<std::size_t>(i)].x;
    at(i, 1) = points[static_cast<std::size_t>(i)].y;
  }
  return rows;
}

}  // namespace pliant::python
