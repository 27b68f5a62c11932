// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/tracking/track_image.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdio>
#include <utility>

#include "descriptor/base/error.h"
#include "descriptor/drawing/drawing.h"
#include "descriptor/warp/unwarp.h"

namespace pliant {
namespace {

constexpr int kGap = 8;
constexpr int kCellHeight = 180;  // of a contact sheet
constexpr int kCaptionHeight = 22;
constexpr std::size_t kColumns = 3;

Image ScaledToHeight(const Image& image, int height) {
  const double scale = static_cast<double>(height) / image.height;
  return ResizeImage(image, std::max(1, static_cast<int>(std::lround(image.width * scale))),
                     height);
}

// Both at `height`, side by side.
Image Beside(const Image& left, const Image& right, int height, int gap) {
  const Image a = ScaledToHeight(left, height);
  const Image b = ScaledToHeight(right, height);
  Image both = BlankImage(a.width + gap + b.width, height, colours::kWhite);
  PasteImage(both, a, 0, 0);
  PasteImage(both, b, a.width + gap, 0);
  return both;
}

int Thickness(const Image& frame) { return std::max(1, std::max(frame.width, frame.height) / 500); }

void DrawMeshLines(Image& on, const Mesh& mesh) {
  const auto draw = [&](int c, int r, int c2, int r2) {
    const std::size_t a = static_cast<std::size_t>(r) * mesh.columns + c;
    const std::size_t b = static_cast<std::size_t>(r2) * mesh.columns + c2;
    if (!mesh.trusted[a] || !mesh.trusted[b]) return;
    DrawLine(on, mesh.points[a], mesh.points[b], colours::kYellow, 1);
  };
  for (int r = 0; r < mesh.rows; ++r) {
    for (int c = 0; c < mesh.columns; ++c) {
      if (c + 1 < mesh.columns) draw(c, r, c + 1, r);
      if (r + 1 < mesh.rows) draw(c, r, c, r + 1);
    }
  }
}

Image DrawMesh(const Image& frame, const Location& location) {
  Image image = ToColour(frame);
  if (!location.found) return image;
  DrawMeshLines(image, *location.mesh);
  DrawPolyline(image, location.outline, true, colours::kGreen, Thickness(frame) + 1);
  return image;
}

}  // namespace

Image DrawUnwarped(const Image& frame, const Location& location, const PixelBox& box) {
  if (location.found) return ToColour(Unwarp(frame, *location.warp, box.width, box.height).image);
  Image nothing = BlankImage(box.width, box.height, {40, 40, 40});
  const double right = box.width - 1.0;
  const double bottom = box.height - 1.0;
  DrawLine(nothing, {0, 0}, {right, bottom}, colours::kRed, 2);
  DrawLine(nothing, {0, bottom}, {right, 0}, colours::kRed, 2);
  return nothing;
}

std::string Caption(const TrackedFrame& tracked) {
  const Location& location = tracked.location;
  std::string text = "frame " + std::to_string(tracked.frame.number) + "  ";
  if (tracked.frame.time_s) {
    std::array<char, 32> time{};
    std::snprintf(time.data(), time.size(), "%.1f s  ", *tracked.frame.time_s);
    text += time.data();
  }
  if (!location.found) return text + "lost: " + Describe(location.reason);
  return text + "inliers " + std::to_string(location.inliers.size()) + "/" +
         std::to_string(location.matches);
}

Image DrawTracked(const TrackedFrame& tracked, const PixelBox& box) {
  const Image& frame = tracked.frame.image;
  Image left = DrawMesh(frame, tracked.location);
  const int letters = std::max(10, frame.height / 32);
  FillBox(left, 0, 0, std::min(frame.width, TextWidth(Caption(tracked), letters) + letters),
          2 * letters, {20, 20, 20});
  DrawText(left, letters / 2, letters * 3 / 2, Caption(tracked),
           tracked.location.found ? colours::kGreen : colours::kRed, letters);
  return Beside(left, DrawUnwarped(frame, tracked.location, box), frame.height, kGap);
}

ContactSheet::ContactSheet(Image reference, int cells)
    : reference_(std::move(reference)), cells_(static_cast<std::size_t>(std::max(1, cells))) {}

// Keeps every step-th frame; when there are too many, every second of them goes.
void ContactSheet::Add(const TrackedFrame& tracked, const PixelBox& box) {
  if (seen_++ % step_ != 0) return;
  if (kept_.size() == 2 * cells_) {
    for (std::size_t i = 0; 2 * i < kept_.size(); ++i) {
      if (i > 0) kept_[i] = std::move(kept_[2 * i]);
    }
    kept_.resize(cells_);
    step_ *= 2;
    if ((seen_ - 1) % step_ != 0) return;
  }
  const Image& frame = tracked.frame.image;
  kept_.push_back({Beside(DrawMesh(frame, tracked.location),
                          DrawUnwarped(frame, tracked.location, box), kCellHeight, kGap / 2),
                   Caption(tracked)});
}

Image ContactSheet::Draw(const std::string& title) const {
  if (kept_.empty()) {
    throw Error(ErrorCode::kInvalidArgument, "no_frames", "a contact sheet needs a frame");
  }
  std::vector<const Cell*> shown;
  const std::size_t count = std::min(cells_, kept_.size());
  for (std::size_t i = 0; i < count; ++i) {
    shown.push_back(&kept_[count > 1 ? i * (kept_.size() - 1) / (count - 1) : 0]);
  }
  const Cell first{ScaledToHeight(reference_, kCellHeight), "template"};
  shown.insert(shown.begin(), &first);

  int cell_width = 0;
  for (const Cell* cell : shown) {
    cell_width = std::max({cell_width, cell->image.width, TextWidth(cell->caption, 11)});
  }
  const auto rows = static_cast<int>((shown.size() + kColumns - 1) / kColumns);
  const int row_height = kCellHeight + kCaptionHeight + kGap;
  const int head = 40;
  Image sheet = BlankImage(static_cast<int>(kColumns) * (cell_width + kGap) + kGap,
                           head + rows * row_height, colours::kWhite);
  DrawText(sheet, kGap, 26, title, colours::kBlack, 15);
  for (std::size_t i = 0; i < shown.size(); ++i) {
    const int x = kGap + static_cast<int>(i % kColumns) * (cell_width + kGap);
    const int y = head + static_cast<int>(i / kColumns) * row_height;
    PasteImage(sheet, shown[i]->image, x, y);
    DrawText(sheet, x, y + kCellHeight + 15, shown[i]->caption, colours::kBlack, 11);
  }
  return sheet;
}

}  // namespace pliant
