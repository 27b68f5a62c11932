// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/image/image.h"

#include <algorithm>
#include <new>
#include <utility>

#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "descriptor/base/error.h"
#include "descriptor/base/format_bytes.h"
#include "descriptor/image/byte_reader.h"
#include "descriptor/image/finish_pixels.h"
#include "descriptor/image/image_header.h"
#include "descriptor/image/jpeg_planes.h"
#include "descriptor/image/quiet_decoders.h"

namespace pliant {
namespace {

void CheckLimits(const ImageHeader& header, const DecodeOptions& options) {
  const std::string size = std::to_string(header.width) + " x " + std::to_string(header.height);
  if (header.width > options.max_pixels / header.height) {
    throw Error(ErrorCode::kTooLarge, "image_too_large",
                "The picture has " + size + " pixels; at most " +
                    std::to_string(options.max_pixels) + " are accepted. Scale it down.");
  }
  if (std::min(header.width, header.height) < options.min_side_px) {
    throw Error(ErrorCode::kUnprocessable, "image_too_small",
                "The picture has " + size + " pixels; each side needs at least " +
                    std::to_string(options.min_side_px) + ".");
  }
}

// What decoding and the conversions to 8 bits may take, by what the file says of itself.
void CheckMemory(const ScannedImage& scanned, int reduction, const DecodeOptions& options) {
  const std::int64_t pixels = scanned.header.width * scanned.header.height;
  const std::int64_t needed = pixels / (std::int64_t{reduction} * reduction) * scanned.pixel_bytes;
  if (needed <= options.max_decode_bytes &&
      scanned.buffer_bytes <= options.max_decode_bytes - needed) {
    return;
  }
  throw Error(ErrorCode::kTooLarge, "image_too_large",
              "Decoding the picture of " + std::to_string(scanned.header.width) + " x " +
                  std::to_string(scanned.header.height) + " pixels takes more than " +
                  FormatBytes(static_cast<std::uint64_t>(options.max_decode_bytes)) +
                  " of memory. Scale it down, or save it as JPEG that is not progressive.");
}

// libjpeg can decode at 1/2, 1/4 or 1/8 of the size; take the smallest that still covers max_side.
int JpegReduction(const ImageHeader& header, int max_side_px) {
  if (header.format != ImageFormat::kJpeg || max_side_px <= 0) return 1;
  const std::int64_t longer = std::max(header.width, header.height);
  int reduction = 1;
  while (reduction < 8 && longer / (reduction * 2) >= max_side_px) reduction *= 2;
  return reduction;
}

// PNG and WebP may carry transparency, which is composed below: all their channels are decoded.
bool IsDecodedWhole(const ImageHeader& header) {
  return header.format == ImageFormat::kPng || header.format == ImageFormat::kWebp;
}

int ReadFlags(const ImageHeader& header, bool colour, int reduction) {
  if (IsDecodedWhole(header)) return cv::IMREAD_UNCHANGED;
  int flags = colour ? cv::IMREAD_COLOR : cv::IMREAD_GRAYSCALE;
  if (reduction == 2) flags = colour ? cv::IMREAD_REDUCED_COLOR_2 : cv::IMREAD_REDUCED_GRAYSCALE_2;
  if (reduction == 4) flags = colour ? cv::IMREAD_REDUCED_COLOR_4 : cv::IMREAD_REDUCED_GRAYSCALE_4;
  if (reduction == 8) flags = colour ? cv::IMREAD_REDUCED_COLOR_8 : cv::IMREAD_REDUCED_GRAYSCALE_8;
  return flags | cv::IMREAD_IGNORE_ORIENTATION;
}

cv::Mat DecodePixels(Bytes bytes, int flags) {
  cv::Mat pixels;
  std::string detail;
  try {
    const cv::Mat encoded(1, static_cast<int>(bytes.size()), CV_8U,
                          const_cast<std::uint8_t*>(bytes.data()));  // imdecode only reads
    const DecoderSilence silence;  // what is wrong is said once, by the Error
    pixels = cv::imdecode(encoded, flags);
  } catch (const cv::Exception& e) {
    if (e.code == cv::Error::StsNoMem) throw;
    detail = " (" + e.err + ")";
  }
  if (pixels.empty() || (pixels.depth() != CV_8U && pixels.depth() != CV_16U)) {
    throw Error(ErrorCode::kUnprocessable, "image_corrupt",
                "The picture cannot be decoded: its data are damaged or of a kind that is not "
                "read" +
                    detail + ". Save it again as JPEG or PNG.");
  }
  return pixels;
}

// OpenCV takes a WebP that libwebp does not know for what else it may be. Of all that it reads,
// only DICOM has its mark in the middle of the file; none of the limits would hold for one.
void CheckIsNothingElse(Bytes bytes, const ImageHeader& header) {
  constexpr std::size_t kDicomMark = 128;
  if (header.format != ImageFormat::kWebp ||
      !ByteReader(bytes, false).StartsWith(kDicomMark, "DICM")) {
    return;
  }
  throw Error(ErrorCode::kUnprocessable, "image_corrupt",
              "The picture begins as WebP and goes on as DICOM. Save it again as JPEG or PNG.");
}

// The decoder must have understood the file as the limits did.
void CheckSize(const cv::Mat& pixels, const ImageHeader& header, int reduction) {
  const auto reduced = [&](std::int64_t side) { return (side + reduction - 1) / reduction; };
  const std::int64_t width = reduced(header.width);
  const std::int64_t height = reduced(header.height);
  const bool turned = header.format == ImageFormat::kTiff && header.exif_orientation >= 5;
  if (pixels.cols == (turned ? height : width) && pixels.rows == (turned ? width : height)) return;
  throw Error(ErrorCode::kUnprocessable, "image_corrupt",
              "The picture contradicts itself: its header says " + std::to_string(header.width) +
                  " x " + std::to_string(header.height) + " pixels, its data are of " +
                  std::to_string(pixels.cols) + " x " + std::to_string(pixels.rows) +
                  ". Save it again as JPEG or PNG.");
}

// OpenCV turns TIFF upright itself, whatever the flags; the other formats are ours to turn.
int OrientationLeft(const ImageHeader& header) {
  return header.format == ImageFormat::kTiff ? 1 : header.exif_orientation;
}

// Grey, or B, G, R; not turned upright.
cv::Mat Read(Bytes bytes, const ImageHeader& header, bool colour, int reduction) {
  const cv::Mat pixels = DecodePixels(bytes, ReadFlags(header, colour, reduction));
  CheckSize(pixels, header, reduction);
  return Simplified(pixels);
}

// What is asked of one picture: a size is of the upright one.
struct Wanted {
  int reduction = 1;
  int orientation = 1;  // that is left to turn
  bool colour = false;
  ScaledSize size;
  ScaledSize thumbnail = {};

  cv::Size StoredThumbnail() const {
    const cv::Size upright(thumbnail.width, thumbnail.height);
    return orientation < 5 ? upright : cv::Size(upright.height, upright.width);
  }
};

Image ThumbnailFrom(const cv::Mat& pixels, const Wanted& wanted) {
  const cv::Size size = wanted.StoredThumbnail();
  cv::Mat small;
  if (size.width < pixels.cols || size.height < pixels.rows) {
    cv::resize(pixels, small, size, 0, 0, cv::INTER_AREA);
  } else {
    small = pixels.clone();  // turned below
  }
  return Finished(small, wanted.orientation, wanted.thumbnail, true);
}

// In one pass over the file where a decoder gives both; in two, the thumbnail's pixels are gone
// before the picture's come, and memory is what it is without a thumbnail in colours.
void ReadBoth(Bytes bytes, const ImageHeader& header, const Wanted& wanted, DecodedImage* decoded) {
  cv::Mat pixels;
  if (header.format == ImageFormat::kJpeg && !wanted.colour) {
    if (const auto planes = DecodeJpegPlanes(bytes, header, wanted.reduction)) {
      decoded->thumbnail = ThumbnailFrom(ThumbnailOf(*planes, wanted.StoredThumbnail()), wanted);
      if (!planes->damaged) pixels = planes->grey;
    }
  }
  if (decoded->thumbnail.empty() && !wanted.colour && !IsDecodedWhole(header)) {
    const int coarse =
        JpegReduction(header, std::max(wanted.thumbnail.width, wanted.thumbnail.height));
    decoded->thumbnail = ThumbnailFrom(Read(bytes, header, true, coarse), wanted);
  }
  if (pixels.empty()) pixels = Read(bytes, header, wanted.colour, wanted.reduction);
  if (decoded->thumbnail.empty()) decoded->thumbnail = ThumbnailFrom(pixels, wanted);
  decoded->image = Finished(std::move(pixels), wanted.orientation, wanted.size, wanted.colour);
}

DecodedImage Decode(Bytes bytes, const DecodeOptions& options) {
  if (static_cast<std::int64_t>(bytes.size()) > options.max_bytes) {
    throw Error(ErrorCode::kTooLarge, "image_too_large",
                "The picture file is larger than " +
                    FormatBytes(static_cast<std::uint64_t>(options.max_bytes)) +
                    ", which is the limit.");
  }
  ScannedImage scanned = ScanImage(bytes);
  const ImageHeader& header = scanned.header;
  const int reduction = JpegReduction(header, options.max_side_px);
  CheckLimits(header, options);
  CheckMemory(scanned, reduction, options);
  CheckStructure(bytes, scanned);
  CheckMemory(scanned, reduction, options);  // now all that is needed is known

  const std::vector<std::uint8_t> essential = WithoutMetadata(bytes, header.format);
  const Bytes data = essential.empty() ? bytes : Bytes(essential);
  CheckIsNothingElse(data, header);
  DecodedImage decoded;
  decoded.format = header.format;
  const bool turned = header.exif_orientation >= 5;
  decoded.original_width = static_cast<int>(turned ? header.height : header.width);
  decoded.original_height = static_cast<int>(turned ? header.width : header.height);
  Wanted wanted{
      .reduction = reduction,
      .orientation = OrientationLeft(header),
      .colour = options.colour,
      .size = ScaleToFit(decoded.original_width, decoded.original_height, options.max_side_px)};
  decoded.scale = wanted.size.scale;
  if (options.thumbnail_side_px > 0) {
    wanted.thumbnail = ScaleToFit(wanted.size.width, wanted.size.height, options.thumbnail_side_px);
    ReadBoth(data, header, wanted, &decoded);
  } else {
    decoded.image = Finished(Read(data, header, options.colour, reduction), wanted.orientation,
                             wanted.size, options.colour);
  }
  return decoded;
}

}  // namespace

DecodedImage DecodeImage(Bytes bytes, const DecodeOptions& options) {
  try {
    return Decode(bytes, options);
  } catch (const cv::Exception& e) {
    if (e.code == cv::Error::StsNoMem) throw std::bad_alloc();
    throw;
  }
}

}  // namespace pliant
