// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// BMP: a file header, an information header of one of several lengths, rows of pixels.
#include <cstdlib>

#include <opencv2/imgcodecs.hpp>

#include "descriptor/image/image_header.h"

namespace pliant {

ScannedImage ScanBmp(Bytes bytes) {
  // Three of colour and one of grey.
  ScannedImage scanned{.header = {.format = ImageFormat::kBmp}, .pixel_bytes = 3 + 1};
  ImageHeader& header = scanned.header;
  const ByteReader reader(bytes, false);
  const bool core = reader.U32(14) == 12U;  // of OS/2
  if (core) {
    header.width = reader.U16(18).value_or(0);
    header.height = reader.U16(20).value_or(0);
  } else {
    header.width = static_cast<std::int32_t>(reader.U32(18).value_or(0));
    header.height = std::llabs(static_cast<std::int32_t>(reader.U32(22).value_or(0)));
  }
  const std::uint32_t compression = core ? 0 : reader.U32(30).value_or(0);
  if (compression != 0 && compression != 3) return scanned;  // run lengths: the decoder notices
  const std::int64_t bits = reader.U16(core ? 24 : 28).value_or(0);
  const std::int64_t row = (header.width * bits + 31) / 32 * 4;  // rows are padded to four bytes
  const std::int64_t offset = reader.U32(10).value_or(0);
  const auto data = static_cast<std::int64_t>(bytes.size()) - offset;
  // Divided, not multiplied: nobody has checked the size yet, and the product may overflow.
  scanned.complete = data >= 0 && (header.height == 0 || row <= data / header.height);
  return scanned;
}

cv::Mat DecodeBmp(Bytes bytes, const ImageHeader& /*header*/, bool /*colour*/, int /*reduction*/) {
  cv::Mat pixels;
  std::string detail;
  try {
    const cv::Mat file(1, static_cast<int>(bytes.size()), CV_8U,
                       const_cast<std::uint8_t*>(bytes.data()));  // imdecode only reads
    pixels = cv::imdecode(file, cv::IMREAD_COLOR);
  } catch (const cv::Exception& e) {
    if (e.code == cv::Error::StsNoMem) throw;
    detail = e.err;
  }
  if (pixels.empty()) ThrowUndecodable(detail);
  return pixels;
}

}  // namespace pliant
