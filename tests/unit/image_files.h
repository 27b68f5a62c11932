// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Image files made in memory for tests: every format, EXIF orientation, headers that lie.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

namespace pliant::testing {

using FileBytes = std::vector<std::uint8_t>;

// Four quarters: top left, top right, bottom left, bottom right.
inline cv::Mat Quarters(int width, int height, const std::array<cv::Scalar, 4>& colours) {
  const int w = width / 2;
  const int h = height / 2;
  cv::Mat image(height, width, CV_8UC3, colours[3]);
  image(cv::Rect(0, 0, w, h)).setTo(colours[0]);
  image(cv::Rect(w, 0, width - w, h)).setTo(colours[1]);
  image(cv::Rect(0, h, w, height - h)).setTo(colours[2]);
  return image;
}

// An image whose four corners can be told apart: top left bright, top right dark, ...
inline cv::Mat CornerImage(int width = 96, int height = 64) {
  return Quarters(
      width, height,
      {cv::Scalar::all(250), cv::Scalar::all(10), cv::Scalar::all(90), cv::Scalar::all(170)});
}

// Smoothed noise: plenty of keypoints, the same for a seed everywhere.
inline cv::Mat NoiseImage(int width, int height, std::uint64_t seed) {
  cv::RNG rng(seed);
  cv::Mat image(height, width, CV_8UC1);
  rng.fill(image, cv::RNG::UNIFORM, 0, 256);
  cv::GaussianBlur(image, image, {0, 0}, 2.5);
  cv::normalize(image, image, 0, 255, cv::NORM_MINMAX);
  return image;
}

inline FileBytes EncodeAs(const cv::Mat& image, const std::string& extension) {
  FileBytes bytes;
  cv::imencode(extension, image, bytes);
  return bytes;
}

inline void Append(FileBytes& bytes, std::uint32_t value, int width, bool big_endian) {
  for (int i = 0; i < width; ++i) {
    const int shift = 8 * (big_endian ? width - 1 - i : i);
    bytes.push_back(static_cast<std::uint8_t>(value >> shift));
  }
}

// A TIFF directory with the orientation tag alone, as EXIF blocks carry it.
inline FileBytes ExifBlock(int orientation, bool big_endian) {
  FileBytes block;
  Append(block, big_endian ? 0x4D4D : 0x4949, 2, big_endian);
  Append(block, 42, 2, big_endian);
  Append(block, 8, 4, big_endian);
  Append(block, 1, 2, big_endian);    // one entry
  Append(block, 274, 2, big_endian);  // Orientation
  Append(block, 3, 2, big_endian);    // SHORT
  Append(block, 1, 4, big_endian);
  Append(block, orientation, 2, big_endian);
  Append(block, 0, 2, big_endian);
  Append(block, 0, 4, big_endian);
  return block;
}

inline FileBytes WithJpegExif(const FileBytes& jpeg, int orientation, bool big_endian) {
  const FileBytes block = ExifBlock(orientation, big_endian);
  FileBytes bytes(jpeg.begin(), jpeg.begin() + 2);
  Append(bytes, 0xFFE1, 2, true);
  Append(bytes, static_cast<std::uint32_t>(2 + 6 + block.size()), 2, true);
  for (const char c : std::string("Exif\0\0", 6)) bytes.push_back(static_cast<std::uint8_t>(c));
  bytes.insert(bytes.end(), block.begin(), block.end());
  bytes.insert(bytes.end(), jpeg.begin() + 2, jpeg.end());
  return bytes;
}

inline std::uint32_t PngCrc(const std::uint8_t* data, std::size_t size) {
  std::uint32_t crc = 0xFFFFFFFFU;
  for (std::size_t i = 0; i < size; ++i) {
    crc ^= data[i];
    for (int bit = 0; bit < 8; ++bit) crc = (crc >> 1) ^ (0xEDB88320U & (0U - (crc & 1U)));
  }
  return ~crc;
}

// Puts a chunk in after the header of a PNG file.
inline FileBytes WithPngChunk(const FileBytes& png, const std::string& type,
                              const FileBytes& data) {
  constexpr std::size_t kAfterHeader = 8 + 25;
  FileBytes chunk(type.begin(), type.end());
  chunk.insert(chunk.end(), data.begin(), data.end());
  FileBytes bytes(png.begin(), png.begin() + kAfterHeader);
  Append(bytes, static_cast<std::uint32_t>(data.size()), 4, true);
  bytes.insert(bytes.end(), chunk.begin(), chunk.end());
  Append(bytes, PngCrc(chunk.data(), chunk.size()), 4, true);
  bytes.insert(bytes.end(), png.begin() + kAfterHeader, png.end());
  return bytes;
}

// A PNG whose header claims a size that its data do not have; the header's CRC is right.
inline FileBytes PngClaiming(std::uint32_t width, std::uint32_t height) {
  FileBytes png = EncodeAs(CornerImage(), ".png");
  FileBytes size;
  Append(size, width, 4, true);
  Append(size, height, 4, true);
  std::copy(size.begin(), size.end(), png.begin() + 16);
  FileBytes crc;
  Append(crc, PngCrc(png.data() + 12, 17), 4, true);
  std::copy(crc.begin(), crc.end(), png.begin() + 29);
  return png;
}

// An uncompressed grey TIFF in one strip, with an orientation tag.
inline FileBytes GreyTiff(const cv::Mat& grey, int orientation) {
  FileBytes bytes;
  const auto pixels = static_cast<std::uint32_t>(grey.total());
  Append(bytes, 0x4949, 2, false);
  Append(bytes, 42, 2, false);
  Append(bytes, 8 + pixels, 4, false);
  for (int y = 0; y < grey.rows; ++y) {
    bytes.insert(bytes.end(), grey.ptr(y), grey.ptr(y) + grey.cols);
  }
  const std::vector<std::pair<int, std::uint32_t>> tags = {
      {256, grey.cols}, {257, grey.rows},   {258, 8}, {259, 1},         {262, 1},
      {273, 8},         {274, orientation}, {277, 1}, {278, grey.rows}, {279, pixels}};
  Append(bytes, static_cast<std::uint32_t>(tags.size()), 2, false);
  for (const auto& [tag, value] : tags) {
    Append(bytes, tag, 2, false);
    Append(bytes, 4, 2, false);  // LONG
    Append(bytes, 1, 4, false);
    Append(bytes, value, 4, false);
  }
  Append(bytes, 0, 4, false);
  return bytes;
}

}  // namespace pliant::testing
