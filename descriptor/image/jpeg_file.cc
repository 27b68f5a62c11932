// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// JPEG (ITU T.81): a list of marker segments; entropy-coded data follows SOS.
#include <algorithm>
#include <array>
#include <csetjmp>
#include <cstdio>
#include <memory>
#include <new>

#include <jerror.h>
#include <jpeglib.h>
#include <opencv2/imgproc.hpp>
#include <turbojpeg.h>

#include "descriptor/image/image_header.h"

namespace pliant {
namespace {

constexpr int kEndOfImage = 0xD9;
constexpr int kStartOfScan = 0xDA;
constexpr int kApp1 = 0xE1;  // EXIF, XMP

// Programs write ten scans or so, one that separates every coefficient some hundred.
constexpr int kMostScans = 200;
// A decoder goes through all blocks in every scan, however few bytes the scan has.
constexpr std::int64_t kMostScannedPixels = 1'000'000'000;

bool IsStartOfFrame(int marker) {
  return marker >= 0xC0 && marker <= 0xCF && marker != 0xC4 && marker != 0xC8 && marker != 0xCC;
}

bool IsProgressive(int marker) { return (marker & 3) == 2; }

bool HasNoPayload(int marker) { return marker == 0x01 || (marker >= 0xD0 && marker <= 0xD8); }

// Calls visit(marker, payload) for each segment from `at` up to EOI, leaving `at` at the segment
// for which visit said false; false when the file ends before EOI. Entropy-coded data hold no
// marker by themselves: an 0xFF in them is followed by a stuffed 0x00 (B.1.1.5), so they are
// skipped bytewise.
template <typename Visit>
bool WalkJpeg(Bytes bytes, std::size_t& at, Visit visit) {
  while (at + 1 < bytes.size()) {
    if (bytes[at] != 0xFF) {  // entropy-coded data, or padding
      ++at;
      continue;
    }
    const int marker = bytes[at + 1];
    if (marker == 0xFF) {
      ++at;
      continue;
    }
    if (marker == kEndOfImage) return true;
    if (marker == 0x00 || HasNoPayload(marker)) {
      at += 2;
      continue;
    }
    const auto length = ByteReader(bytes, true).U16(at + 2);
    if (!length || *length < 2 || bytes.size() - at - 2 < *length) return false;
    if (!visit(marker, bytes.subspan(at + 4, *length - 2))) return true;
    at += 2 + *length;
  }
  return false;
}

// Bytes of all components' coefficients (16 bits each) a pixel of the image, times 16 to stay
// whole: component i has h_i v_i samples where the finest has h_max v_max (A.1.1).
std::int64_t CoefficientBytesBy16(const ByteReader& frame) {
  const int components = frame.U8(5).value_or(0);
  std::int64_t sum = 0;
  std::int64_t most_h = 1;
  std::int64_t most_v = 1;
  for (int i = 0; i < components; ++i) {
    const int sampling = frame.U8(std::size_t{7} + std::size_t{3} * i).value_or(0);
    const std::int64_t h = sampling >> 4;
    const std::int64_t v = sampling & 15;
    sum += h * v;
    most_h = std::max(most_h, h);
    most_v = std::max(most_v, v);
  }
  return 2 * 16 * sum / (most_h * most_v);
}

// By libjpeg itself: TurboJPEG does not tell a warning from a failure that follows one, nor whether
// rows are missing.
class JpegDecoder {
 public:
  JpegDecoder() {
    jpeg_.err = jpeg_std_error(&errors_);
    errors_.error_exit = OnError;
    errors_.emit_message = OnWarning;
    jpeg_.client_data = this;
    jpeg_create_decompress(&jpeg_);
  }
  ~JpegDecoder() { jpeg_destroy_decompress(&jpeg_); }
  JpegDecoder(const JpegDecoder&) = delete;
  JpegDecoder& operator=(const JpegDecoder&) = delete;

  // Grey, B, G, R, or the inks C, M, Y, K.
  cv::Mat Decode(Bytes bytes, bool colour, int reduction) {
    if (!Start(bytes, colour, reduction)) ThrowFailed();
    cv::Mat pixels(static_cast<int>(jpeg_.output_height), static_cast<int>(jpeg_.output_width),
                   CV_8UC(jpeg_.output_components));
    if (!ReadRows(pixels)) ThrowFailed();
    if (rows_missing_ || ScansMissing()) ThrowFailed();
    if (ended_ ? jpeg_.arith_code != 0 : IsFilledUp(bytes)) ThrowTruncated(kRowsMissing);
    return pixels;
  }

 private:
  [[noreturn]] void ThrowFailed() const {
    if (ended_) ThrowTruncated(kRowsMissing);
    ThrowUndecodable(error_[0] != 0 ? error_.data() : "a marker stands in the pixels' data");
  }

  // Where the data end early, a progressive image can have all its rows, but blurred, and one with
  // a scan for each colour lacks colours. Data that an end mark closes are as their writer wants.
  bool ScansMissing() const {
    if (!ended_) return false;
    for (int i = 0; i < jpeg_.num_components; ++i) {
      if (jpeg_.comp_info[i].component_needed == 0) continue;
      if (jpeg_.comp_info[i].quant_table == nullptr) return true;
      const auto* bits = jpeg_.coef_bits == nullptr ? nullptr : jpeg_.coef_bits[i];
      if (bits != nullptr && std::any_of(bits, bits + DCTSIZE2, [](int b) { return b != 0; })) {
        return true;
      }
    }
    return false;
  }

  // A download that stopped can have its whole length, zeros to the end: they are pixels as well.
  bool IsFilledUp(Bytes bytes) const {
    constexpr std::size_t kZeros = 32;
    const std::size_t read = bytes.size() - jpeg_.src->bytes_in_buffer;
    if (jpeg_.unread_marker == kEndOfImage || read < kZeros) return false;
    const Bytes last = bytes.subspan(read - kZeros, kZeros);
    if (!std::all_of(last.begin(), last.end(), [](std::uint8_t b) { return b == 0; })) return false;
    std::size_t at = read;
    return !WalkJpeg(bytes, at, [](int, Bytes) { return true; });
  }

  // No destructor runs when libjpeg jumps back here.
  bool Start(Bytes bytes, bool colour, int reduction) {
    if (setjmp(jump_) != 0) return false;
    jpeg_mem_src(&jpeg_, bytes.data(), bytes.size());
    jpeg_read_header(&jpeg_, TRUE);
    jpeg_.scale_num = 1;
    jpeg_.scale_denom = static_cast<unsigned>(reduction);
    const bool inks = jpeg_.num_components == 4;
    jpeg_.out_color_space = inks ? JCS_CMYK : (colour ? JCS_EXT_BGR : JCS_GRAYSCALE);
    jpeg_start_decompress(&jpeg_);
    return true;
  }

  bool ReadRows(cv::Mat& pixels) {
    if (setjmp(jump_) != 0) return false;
    while (jpeg_.output_scanline < jpeg_.output_height) {
      JSAMPROW row = pixels.ptr(static_cast<int>(jpeg_.output_scanline));
      jpeg_read_scanlines(&jpeg_, &row, 1);
    }
    return true;
  }

  // Level -1 is a warning: libjpeg goes on, with grey for the pixels it does not find.
  static void OnWarning(j_common_ptr jpeg, int level) {
    if (level >= 0) return;
    auto& self = *static_cast<JpegDecoder*>(jpeg->client_data);
    if (jpeg->err->msg_code == JWRN_JPEG_EOF) self.ended_ = true;
    if (jpeg->err->msg_code == JWRN_HIT_MARKER && self.LosesRows()) self.rows_missing_ = true;
  }

  // At a marker that comes too early: a restart or another scan goes on behind it, and some files
  // lack bits of their last blocks.
  bool LosesRows() const {
    if (ended_) return true;
    const int marker = jpeg_.unread_marker;
    const bool restart = marker >= 0xD0 && marker <= 0xD7 && jpeg_.restart_interval > 0;
    return !restart && jpeg_.progressive_mode == 0 &&
           jpeg_.input_iMCU_row + 1 < jpeg_.total_iMCU_rows;
  }

  static void OnError(j_common_ptr jpeg) {
    auto& self = *static_cast<JpegDecoder*>(jpeg->client_data);
    jpeg->err->format_message(jpeg, self.error_.data());
    std::longjmp(self.jump_, 1);
  }

  jpeg_decompress_struct jpeg_{};
  jpeg_error_mgr errors_{};
  std::jmp_buf jump_{};
  std::array<char, JMSG_LENGTH_MAX> error_{};
  bool ended_ = false;  // the file has ended before its end mark
  bool rows_missing_ = false;
};

// B, G, R of the inks C, M, Y, K as Adobe's programs store them, inverted.
cv::Mat FromInks(const cv::Mat& inks) {
  cv::Mat pixels(inks.size(), CV_8UC3);
  for (int y = 0; y < inks.rows; ++y) {
    const auto* from = inks.ptr<cv::Vec4b>(y);
    auto* to = pixels.ptr<cv::Vec3b>(y);
    for (int x = 0; x < inks.cols; ++x) {
      const int black = from[x][3];
      for (int c = 0; c < 3; ++c) {
        to[x][2 - c] = static_cast<std::uint8_t>(black - ((255 - from[x][c]) * black >> 8));
      }
    }
  }
  return pixels;
}

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

ScannedImage ScanJpeg(Bytes bytes) {
  ScannedImage scanned{.header = {.format = ImageFormat::kJpeg}, .jpeg_rest = 2};
  ImageHeader& header = scanned.header;
  bool exif = false;
  WalkJpeg(bytes, scanned.jpeg_rest, [&](int marker, Bytes payload) {
    const ByteReader reader(payload, true);
    if (!exif && marker == kApp1 && payload.size() > 6 && reader.StartsWith(0, "Exif")) {
      header.exif_orientation = ReadOrientation(reader.From(6));
      exif = true;
    }
    if (!IsStartOfFrame(marker)) return true;
    header.height = reader.U16(1).value_or(0);
    header.width = reader.U16(3).value_or(0);
    return false;
  });
  return scanned;
}

void CheckJpegScans(Bytes bytes, ScannedImage& scanned) {
  const std::int64_t pixels = scanned.header.width * scanned.header.height;
  int components = 0;
  int scans = 0;
  std::int64_t coefficients = 0;
  std::size_t at = scanned.jpeg_rest;
  WalkJpeg(bytes, at, [&](int marker, Bytes payload) {
    const ByteReader reader(payload, true);
    if (IsStartOfFrame(marker) && components == 0) {
      components = reader.U8(5).value_or(0);
      coefficients = pixels * CoefficientBytesBy16(reader) / 16;
      if (IsProgressive(marker)) scanned.buffer_bytes = coefficients;
      if (components == 4) scanned.pixel_bytes = 4 + 3 + 1;  // inks, then colours, then grey
    }
    if (marker != kStartOfScan) return true;
    // A decoder keeps all coefficients where one scan does not bring all components.
    if (reader.U8(0).value_or(0) < components) scanned.buffer_bytes = coefficients;
    ++scans;
    return scans <= kMostScans && scans * pixels <= kMostScannedPixels;
  });
  if (scans > kMostScans || (scans > 1 && scans * pixels > kMostScannedPixels)) {
    scanned.defect = "it has too many scans to decode in a reasonable time";
  }
}

cv::Mat DecodeJpeg(Bytes bytes, const ImageHeader& /*header*/, bool colour, int reduction) {
  const cv::Mat pixels = JpegDecoder().Decode(bytes, colour, reduction);
  return pixels.channels() == 4 ? FromInks(pixels) : pixels;
}

std::optional<JpegPlanes> DecodeJpegPlanes(Bytes bytes, const ImageHeader& header, int reduction) {
  const std::unique_ptr<void, int (*)(tjhandle)> decompressor(tjInitDecompress(), tjDestroy);
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
