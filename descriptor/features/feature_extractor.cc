// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <chrono>
#include <memory>
#include <utility>

#include "descriptor/base/error.h"
#include "descriptor/features/closer_keypoints.h"
#include "descriptor/features/descriptor.h"
#include "descriptor/features/enlarged_keypoints.h"
#include "descriptor/features/faint_keypoints.h"

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

// A closer look takes so many times the key points.
constexpr int kCloserKeypoints = 4;

}  // namespace

FeatureExtractor::FeatureExtractor(std::shared_ptr<const Descriptor> descriptor,
                                   ExtractionOptions options)
    : descriptor_(std::move(descriptor)), options_(std::move(options)) {
  if (!descriptor_) {
    throw Error(ErrorCode::kInvalidArgument, "no_descriptor",
                "FeatureExtractor needs a descriptor");
  }
  if (!options_.decoder) {
    throw Error(ErrorCode::kInvalidArgument, "no_decoder", "FeatureExtractor needs a decoder");
  }
  options_.decode.colour = false;
  options_.decode.thumbnail_side_px = options_.colours ? kColourGridSide : 0;
}

DecodedImage FeatureExtractor::Decode(Bytes encoded) const {
  return options_.decoder(encoded, options_.decode);
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
  if (options_.colours && picture.channels == 3) {
    const ScaledSize small = ScaleToFit(picture.width, picture.height, kColourGridSide);
    decoded.thumbnail = ResizeImage(picture, small.width, small.height);
  }
  const ScaledSize size = ScaleToFit(picture.width, picture.height, options_.decode.max_side_px);
  decoded.scale = size.scale;
  if (size.scale < 1) decoded.image = ResizeImage(decoded.image, size.width, size.height);
  if (timings != nullptr) timings->decode_ms = watch.Lap();
  return Extract(decoded, threads, timings, role);
}

Features FeatureExtractor::Extract(Bytes encoded, int threads, ExtractionTimings* timings,
                                   PictureRole role) const {
  Stopwatch watch;
  const DecodedImage decoded = Decode(encoded);
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
  features.colours = MakeColourGrid(decoded.thumbnail);
  features.keypoints = options_.enlarge_below > 0
                           ? DetectFaintKeypoints(decoded.image, options_.keypoints)
                           : DetectKeypoints(decoded.image, options_.keypoints);
  const double detect_ms = watch.Lap();

  features.descriptors = Describe(decoded.image, features.keypoints, role, threads);
  if (timings != nullptr) {
    timings->detect_ms = detect_ms;
    timings->describe_ms = watch.Lap();
  }
  if (features.keypoints.size() < static_cast<std::size_t>(options_.enlarge_below)) {
    AddEnlarged(decoded.image, threads, role, &features, timings);
  }
  ScaleToOriginal(features.keypoints, decoded.scale);
  return features;
}

void FeatureExtractor::AddEnlarged(const Image& image, int threads, PictureRole role,
                                   Features* features, ExtractionTimings* timings) const {
  Stopwatch watch;
  const EnlargedKeypoints more =
      DetectEnlarged(image, features->keypoints, options_.decode.max_side_px, options_.keypoints);
  if (timings != nullptr) timings->detect_ms += watch.Lap();
  Append(more, threads, role, features);
  if (timings != nullptr) timings->describe_ms += watch.Lap();
}

void FeatureExtractor::Append(const EnlargedKeypoints& more, int threads, PictureRole role,
                              Features* features) const {
  if (more.inside.empty()) return;
  features->descriptors.Append(Describe(more.picture, more.inside, role, threads));
  features->keypoints.insert(features->keypoints.end(), more.placed.begin(), more.placed.end());
}

std::optional<Features> FeatureExtractor::LookCloser(Bytes encoded, const Features& known,
                                                     int threads,
                                                     ExtractionTimings* timings) const {
  if (options_.enlarge_below == 0) return {};
  const auto side = CloserSide(std::max(known.width, known.height), options_.decode.max_side_px);
  if (!side) return {};
  Stopwatch watch;
  DecodeOptions decode = options_.decode;
  decode.max_side_px = *side;
  decode.thumbnail_side_px = 0;
  const DecodedImage decoded = options_.decoder(encoded, decode);
  const double decode_ms = watch.Lap();

  KeypointOptions keypoints = options_.keypoints;
  keypoints.max_keypoints = std::min(kCloserKeypoints * keypoints.max_keypoints, kMaxKeypoints);
  const auto parts = DetectCloser(decoded.image, decoded.scale, known.keypoints, *side, keypoints);
  const double detect_ms = watch.Lap();
  Features features = known;
  for (const EnlargedKeypoints& more : parts) {
    Append(more, threads, PictureRole::kQuery, &features);
  }
  if (timings != nullptr) {
    timings->decode_ms += decode_ms;
    timings->detect_ms += detect_ms;
    timings->describe_ms += watch.Lap();
  }
  return features;
}

FeatureExtractor FeatureExtractor::WithEnlargeBelow(int keypoints) const {
  ExtractionOptions options = options_;
  options.enlarge_below = keypoints;
  return {descriptor_, std::move(options)};
}

}  // namespace pliant
