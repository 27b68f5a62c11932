// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/evaluation/perceptual.h"

#include <cmath>

#include <opencv2/dnn.hpp>

#include "descriptor/base/error.h"
#include "descriptor/image/cv_image.h"
#include "descriptor/plot/drawing.h"

namespace pliant {
namespace {

constexpr int kSide = 256;

// 1 x 3 x 256 x 256, -1..1.
cv::Mat ToBlob(const Image& image) {
  if (image.empty()) {
    throw Error(ErrorCode::kInvalidArgument, "bad_size", "An empty picture cannot be compared");
  }
  const Image scaled = ResizeImage(ToColour(image), kSide, kSide);
  return cv::dnn::blobFromImage(ViewAsMat(scaled), 1 / 127.5, {}, cv::Scalar::all(127.5));
}

}  // namespace

struct PerceptualDistance::Network {
  cv::dnn::Net net;
};

PerceptualDistance::PerceptualDistance(const std::filesystem::path& onnx)
    : name_(onnx.string()), network_(std::make_unique<Network>()) {
  std::error_code error;
  if (!std::filesystem::is_regular_file(onnx, error)) {
    throw Error(ErrorCode::kNotFound, "cannot_read", name_ + " cannot be read: there is no file");
  }
  try {
    network_->net = cv::dnn::readNetFromONNX(name_);
  } catch (const cv::Exception& failure) {
    throw Error(ErrorCode::kCorrupt, "network_unreadable",
                name_ + " is no ONNX file that OpenCV can read (" + failure.err + ")");
  }
  network_->net.setPreferableBackend(cv::dnn::DNN_BACKEND_OPENCV);
}

PerceptualDistance::~PerceptualDistance() = default;

double PerceptualDistance::Distance(const Image& a, const Image& b) {
  const cv::Mat first = ToBlob(a);
  const cv::Mat second = ToBlob(b);
  std::string fault = "its output is not one number";
  try {
    network_->net.setInput(first, "in0");
    network_->net.setInput(second, "in1");
    const cv::Mat output = network_->net.forward();
    if (output.total() == 1 && output.type() == CV_32F) {
      const double distance = static_cast<double>(*output.ptr<float>());
      if (std::isfinite(distance)) return distance;
      fault = "its output is not finite";
    }
  } catch (const cv::Exception& failure) {
    fault = failure.err;
  }
  throw Error(
      ErrorCode::kCorrupt, "network_unfit",
      name_ + " does not compare two pictures, inputs in0 and in1 of 1 x 3 x 256 x 256: " + fault);
}

}  // namespace pliant
