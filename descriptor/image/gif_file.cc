// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// GIF (89a): a screen, then extensions and frames. The first frame counts.
#include <algorithm>
#include <array>
#include <cstring>
#include <new>
#include <string>
#include <vector>

#include <gif_lib.h>

#include "descriptor/image/image_header.h"

namespace pliant {
namespace {

// A file at its first frame.
class FirstFrame {
 public:
  explicit FirstFrame(Bytes bytes) : bytes_(bytes) {
    int error = 0;
    gif_ = DGifOpen(this, Read, &error);
    found_ = gif_ != nullptr && FindFrame();
  }
  ~FirstFrame() {
    if (gif_ != nullptr) DGifCloseFile(gif_, nullptr);
  }
  FirstFrame(const FirstFrame&) = delete;
  FirstFrame& operator=(const FirstFrame&) = delete;

  bool found() const { return found_; }
  bool ended() const { return ended_; }

  // Some screens are smaller than what they show.
  int width() const { return std::max(gif_->SWidth, gif_->Image.Left + gif_->Image.Width); }
  int height() const { return std::max(gif_->SHeight, gif_->Image.Top + gif_->Image.Height); }

  // B, G, R, A.
  cv::Mat Decode() {
    const std::array<cv::Vec4b, 256> colours = Colours();
    const GifImageDesc& frame = gif_->Image;
    cv::Mat pixels(height(), width(), CV_8UC4, cv::Scalar::all(0));
    std::vector<GifPixelType> row(static_cast<std::size_t>(frame.Width));
    for (const int y : RowOrder()) {
      if (DGifGetLine(gif_, row.data(), frame.Width) == GIF_ERROR) {
        if (ended_) ThrowTruncated(kRowsMissing);
        ThrowUndecodable();
      }
      auto* to = pixels.ptr<cv::Vec4b>(frame.Top + y, frame.Left);
      for (const GifPixelType index : row) *to++ = colours[index];
    }
    return pixels;
  }

 private:
  // Behind the end are zeros: the one that ends the pixels' data can be missing.
  static int Read(GifFileType* gif, GifByteType* to, int size) {
    auto& self = *static_cast<FirstFrame*>(gif->UserData);
    const std::size_t count = std::min(static_cast<std::size_t>(size), self.bytes_.size());
    std::copy_n(self.bytes_.begin(), count, to);
    self.bytes_ = self.bytes_.subspan(count);
    if (static_cast<int>(count) == size) return size;
    self.ended_ = true;
    if (size != 1) return static_cast<int>(count);
    *to = 0;
    return 1;
  }

  bool FindFrame() {
    GifRecordType type{};
    while (!ended_ && DGifGetRecordType(gif_, &type) != GIF_ERROR) {
      if (type == IMAGE_DESC_RECORD_TYPE) return DGifGetImageDesc(gif_) != GIF_ERROR && !ended_;
      if (type != EXTENSION_RECORD_TYPE || !ReadExtension()) return false;
    }
    return false;
  }

  bool ReadExtension() {
    int code = 0;
    GifByteType* block = nullptr;  // its length, then its bytes
    if (DGifGetExtension(gif_, &code, &block) == GIF_ERROR) return false;
    GraphicsControlBlock control;
    if (code == GRAPHICS_EXT_FUNC_CODE && block != nullptr &&
        DGifExtensionToGCB(block[0], block + 1, &control) != GIF_ERROR) {
      transparent_ = control.TransparentColor;
    }
    while (block != nullptr) {
      if (DGifGetExtensionNext(gif_, &block) == GIF_ERROR) return false;
    }
    return true;
  }

  std::array<cv::Vec4b, 256> Colours() const {
    const ColorMapObject* map =
        gif_->Image.ColorMap != nullptr ? gif_->Image.ColorMap : gif_->SColorMap;
    if (map == nullptr) ThrowUndecodable("it has no colours");
    std::array<cv::Vec4b, 256> colours;
    colours.fill({0, 0, 0, 255});
    for (int i = 0; i < std::min(map->ColorCount, 256); ++i) {
      const GifColorType& colour = map->Colors[i];
      colours[static_cast<std::size_t>(i)] = {colour.Blue, colour.Green, colour.Red, 255};
    }
    if (transparent_ >= 0 && transparent_ < 256)
      colours[static_cast<std::size_t>(transparent_)] = {};
    return colours;
  }

  // Of the frame, as the file has them.
  std::vector<int> RowOrder() const {
    std::vector<int> order;
    const auto add = [&](int first, int step) {
      for (int y = first; y < gif_->Image.Height; y += step) order.push_back(y);
    };
    if (!gif_->Image.Interlace) {
      add(0, 1);
    } else {  // Appendix E
      add(0, 8);
      add(4, 8);
      add(2, 4);
      add(1, 2);
    }
    return order;
  }

  Bytes bytes_;  // those not read yet
  bool ended_ = false;
  GifFileType* gif_ = nullptr;
  bool found_ = false;
  int transparent_ = NO_TRANSPARENT_COLOR;
};

}  // namespace

ScannedImage ScanGif(Bytes bytes) {
  ScannedImage scanned{.header = {.format = ImageFormat::kGif}, .pixel_bytes = 4 + 3};
  const FirstFrame frame(bytes);
  if (frame.found()) {
    scanned.header.width = frame.width();
    scanned.header.height = frame.height();
  } else if (!frame.ended()) {
    scanned.defect = "it has no frame";
  }
  return scanned;
}

cv::Mat DecodeGif(Bytes bytes, const ImageHeader& /*header*/, bool /*colour*/, int /*reduction*/) {
  FirstFrame frame(bytes);
  if (!frame.found()) ThrowUndecodable();
  return frame.Decode();
}

}  // namespace pliant
