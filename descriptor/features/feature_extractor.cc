// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <chrono>
#include <cmath>
#include <memory>
#include <utility>

#include "descriptor/base/error.h"
#include "descriptor/features/descriptor.h"

namespace pliant {
namespace {

class Stopwatch {
 public:
  // Milliseconds since the last lap.
  double Lap() {
    const auto now = std::chrono::steady_clock::now();
    const std::chrono::duration<double, std::milli> passed = now - last_;
    last_ = now;
    return passed.count();
  }

 private:
  std::chrono::steady_clock::time_point last_ = std::chrono::steady_clock::now();
};

// From pixels of the decoded picture to pixels of the original: centres are at integers.
void ScaleToOriginal(std::vector<Keypoint>& keypoints, double scale) {
  if (scale == 1.0) return;
  const auto inverse = static_cast<float>(1.0 / scale);
  for (Keypoint& k : keypoints) {
    k.x = (k.x + 0.5F) * inverse - 0.5F;
    k.y = (k.y + 0.5F) * inverse - 0.5F;
    k.size *= inverse;
  }
}

constexpr double kEnlargement = 2;
constexpr int kEnlargedSide = 1024;         // pixels, at most: a larger picture is not a small one
constexpr double kLeastEnlargement = 1.25;  // below, nothing new comes to light

// How much larger a picture of this size may be described again; 1 = not at all.
double EnlargementOf(const Image& image, int most) {
  const int longer = std::max(image.width, image.height);
  const int side = most > 0 ? std::min(most, kEnlargedSide) : kEnlargedSide;
  const double factor = std::min(kEnlargement, static_cast<double>(side) / longer);
  return factor < kLeastEnlargement ? 1 : factor;
}

// The detector finds most key points at both sizes. Twins would spoil the ratio test of matching,
// in which the second nearest must be clearly farther away.
bool IsTwin(const Keypoint& a, const Keypoint& b) {
  constexpr float kPlace = 0.25F;   // of the size
  constexpr float kOctaves = 1.2F;  // ratio of sizes
  const float size = std::min(a.size, b.size);
  return std::abs(a.x - b.x) < kPlace * size && std::abs(a.y - b.y) < kPlace * size &&
         a.size < kOctaves * b.size && b.size < kOctaves * a.size;
}

void Append(const Features& more, Features* features) {
  features->keypoints.insert(features->keypoints.end(), more.keypoints.begin(),
                             more.keypoints.end());
  Descriptors& all = features->descriptors;
  all.rows += more.descriptors.rows;
  all.floats.insert(all.floats.end(), more.descriptors.floats.begin(),
                    more.descriptors.floats.end());
  all.bytes.insert(all.bytes.end(), more.descriptors.bytes.begin(), more.descriptors.bytes.end());
}

}  // namespace

FeatureExtractor::FeatureExtractor(std::shared_ptr<const Descriptor> descriptor,
                                   ExtractionOptions options)
    : descriptor_(std::move(descriptor)), options_(options) {
  if (!descriptor_) {
    throw Error(ErrorCode::kInvalidArgument, "no_descriptor",
                "FeatureExtractor needs a descriptor");
  }
  options_.decode.colour = false;
}

Descriptors FeatureExtractor::Describe(const Image& grey, std::span<const Keypoint> keypoints,
                                       PictureRole role, int threads) const {
  return role == PictureRole::kReference ? descriptor_->DescribeReference(grey, keypoints, threads)
                                         : descriptor_->Describe(grey, keypoints, threads);
}

Features FeatureExtractor::ExtractFrom(const Image& picture, int threads,
                                       ExtractionTimings* timings, PictureRole role) const {
  if (picture.empty()) {
    throw Error(ErrorCode::kInvalidArgument, "picture_empty", "A picture without pixels was given");
  }
  Stopwatch watch;
  DecodedImage decoded;
  decoded.original_width = picture.width;
  decoded.original_height = picture.height;
  decoded.image = ToGrey(picture);
  const int longer = std::max(picture.width, picture.height);
  const int most = options_.decode.max_side_px;
  if (most > 0 && longer > most) {
    decoded.scale = static_cast<double>(most) / longer;
    const auto scaled = [&](int side) {
      return std::max(1, static_cast<int>(std::lround(side * decoded.scale)));
    };
    decoded.image = ResizeImage(decoded.image, scaled(picture.width), scaled(picture.height));
  }
  if (timings != nullptr) timings->decode_ms = watch.Lap();
  return Extract(decoded, threads, timings, role);
}

Features FeatureExtractor::Extract(Bytes encoded, int threads, ExtractionTimings* timings,
                                   PictureRole role) const {
  Stopwatch watch;
  const DecodedImage decoded = DecodeImage(encoded, options_.decode);
  if (timings != nullptr) timings->decode_ms = watch.Lap();
  return Extract(decoded, threads, timings, role);
}

Features FeatureExtractor::Extract(const DecodedImage& decoded, int threads,
                                   ExtractionTimings* timings, PictureRole role) const {
  Stopwatch watch;
  Features features;
  features.width = decoded.original_width;
  features.height = decoded.original_height;
  features.model_id = descriptor_->info().model_id;
  features.keypoints = DetectKeypoints(decoded.image, options_.keypoints);
  const double detect_ms = watch.Lap();

  features.descriptors = Describe(decoded.image, features.keypoints, role, threads);
  ScaleToOriginal(features.keypoints, decoded.scale);
  if (timings != nullptr) {
    timings->detect_ms = detect_ms;
    timings->describe_ms = watch.Lap();
  }
  if (features.keypoints.size() < static_cast<std::size_t>(options_.enlarge_below)) {
    AddEnlarged(decoded, threads, role, &features, timings);
  }
  return features;
}

void FeatureExtractor::AddEnlarged(const DecodedImage& decoded, int threads, PictureRole role,
                                   Features* features, ExtractionTimings* timings) const {
  const double factor = EnlargementOf(decoded.image, options_.decode.max_side_px);
  if (factor == 1) return;
  Stopwatch watch;
  const auto scaled = [&](int side) { return static_cast<int>(std::lround(side * factor)); };
  const Image large =
      ResizeImage(decoded.image, scaled(decoded.image.width), scaled(decoded.image.height));
  Features more;
  more.keypoints = DetectKeypoints(large, options_.keypoints);
  const std::vector<Keypoint> in_large = more.keypoints;
  ScaleToOriginal(more.keypoints, decoded.scale * factor);
  std::vector<Keypoint> kept;  // in the enlarged picture
  std::vector<Keypoint> placed;
  for (std::size_t i = 0; i < in_large.size(); ++i) {
    const Keypoint& found = more.keypoints[i];
    if (std::any_of(features->keypoints.begin(), features->keypoints.end(),
                    [&](const Keypoint& known) { return IsTwin(found, known); })) {
      continue;
    }
    kept.push_back(in_large[i]);
    placed.push_back(found);
  }
  if (timings != nullptr) timings->detect_ms += watch.Lap();
  more.descriptors = Describe(large, kept, role, threads);
  more.keypoints = std::move(placed);
  Append(more, features);
  if (timings != nullptr) timings->describe_ms += watch.Lap();
}

FeatureExtractor FeatureExtractor::WithEnlargeBelow(int keypoints) const {
  ExtractionOptions options = options_;
  options.enlarge_below = keypoints;
  return {descriptor_, options};
}

}  // namespace pliant
