// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/image/jpeg_planes.h"

#include <array>
#include <memory>
#include <new>

#include <opencv2/imgproc.hpp>
#include <turbojpeg.h>

namespace pliant {
namespace {

struct Destroy {
  void operator()(void* decompressor) const { tjDestroy(decompressor); }
};

cv::Mat ScaledTo(const cv::Mat& plane, const cv::Size& size) {
  if (plane.size() == size) return plane;
  const bool smaller = plane.cols >= size.width && plane.rows >= size.height;
  cv::Mat scaled;
  cv::resize(plane, scaled, size, 0, 0, smaller ? cv::INTER_AREA : cv::INTER_LINEAR);
  return scaled;
}

// Of a plane that reaches as far beyond the image as `padded` does beyond `image`, the
// image's part, scaled to `size`.
cv::Mat PartScaledTo(const cv::Mat& plane, const cv::Size& padded, const cv::Size& image,
                     const cv::Size& size) {
  const cv::Size whole(cvRound(1.0 * size.width * padded.width / image.width),
                       cvRound(1.0 * size.height * padded.height / image.height));
  return ScaledTo(plane, whole)(cv::Rect(cv::Point(), size));
}

}  // namespace

std::optional<JpegPlanes> DecodeJpegPlanes(Bytes bytes, const ImageHeader& header, int reduction) {
  const std::unique_ptr<void, Destroy> decompressor(tjInitDecompress());
  if (!decompressor) throw std::bad_alloc();
  int width = 0;
  int height = 0;
  int sampling = 0;
  int colours = 0;
  if (tjDecompressHeader3(decompressor.get(), bytes.data(), bytes.size(), &width, &height,
                          &sampling, &colours) != 0 ||
      (colours != TJCS_YCbCr && colours != TJCS_GRAY) || width != header.width ||
      height != header.height) {
    return std::nullopt;
  }
  const cv::Size size((width + reduction - 1) / reduction, (height + reduction - 1) / reduction);
  const int count = colours == TJCS_GRAY ? 1 : 3;
  std::array<cv::Mat, 3> planes;
  std::array<unsigned char*, 3> rows{};
  for (int i = 0; i < count; ++i) {
    planes[i].create(tjPlaneHeight(i, size.height, sampling), tjPlaneWidth(i, size.width, sampling),
                     CV_8U);
    rows[i] = planes[i].data;
  }
  const int failed = tjDecompressToYUVPlanes(decompressor.get(), bytes.data(), bytes.size(),
                                             rows.data(), size.width, nullptr, size.height, 0);
  if (failed != 0 && tjGetErrorCode(decompressor.get()) == TJERR_FATAL) return std::nullopt;
  return JpegPlanes{.grey = planes[0](cv::Rect(cv::Point(), size)),
                    .padded = planes[0].size(),
                    .blue = planes[1],
                    .red = planes[2],
                    .damaged = failed != 0};
}

cv::Mat ThumbnailOf(const JpegPlanes& planes, cv::Size size) {
  const cv::Mat grey = ScaledTo(planes.grey, size);
  cv::Mat thumbnail;
  if (planes.blue.empty()) {
    cv::cvtColor(grey, thumbnail, cv::COLOR_GRAY2BGR);
    return thumbnail;
  }
  const auto scaled = [&](const cv::Mat& plane) {
    return PartScaledTo(plane, planes.padded, planes.grey.size(), size);
  };
  cv::merge(std::array<cv::Mat, 3>{grey, scaled(planes.red), scaled(planes.blue)}, thumbnail);
  cv::cvtColor(thumbnail, thumbnail, cv::COLOR_YCrCb2BGR);
  return thumbnail;
}

}  // namespace pliant
