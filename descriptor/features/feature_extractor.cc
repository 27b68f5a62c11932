// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <memory>
#include <utility>

#include "descriptor/base/error.h"
#include "descriptor/base/stopwatch.h"
#include "descriptor/features/descriptor.h"
#include "descriptor/features/enlarged_keypoints.h"

namespace pliant {
namespace {

constexpr int kPreviewQuality = 60;  // of its JPEG
// How many times the keypoints the second pass takes.
constexpr int kSecondPassKeypoints = 4;

void Shift(std::vector<Keypoint>* keypoints, double right, double down) {
  for (Keypoint& k : *keypoints) {
    k.x += static_cast<float>(right);
    k.y += static_cast<float>(down);
  }
}

}  // namespace

Descriptors Descriptor::DescribeFine(const Image& grey, std::span<const Keypoint> keypoints,
                                     std::span<const EnlargedKeypoints> finer, int threads) const {
  Descriptors rows = Describe(grey, keypoints, threads);
  for (const EnlargedKeypoints& more : finer) {
    if (!more.inside.empty()) rows.Append(Describe(more.image, more.inside, threads));
  }
  return rows;
}

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
  options_.decode.thumbnail_side_px = options_.colour_side;
}

DecodedImage FeatureExtractor::Decode(Bytes encoded) const {
  return options_.decoder(encoded, options_.decode);
}

Features FeatureExtractor::ExtractFrom(const Image& image, int threads, ExtractionTimings* timings,
                                       ImageRole role) const {
  if (image.empty()) {
    throw Error(ErrorCode::kInvalidArgument, "image_empty", "An image without pixels was given");
  }
  Stopwatch watch;
  DecodedImage decoded;
  decoded.original_width = image.width;
  decoded.original_height = image.height;
  decoded.image = ToGrey(image);
  if (options_.colour_side > 0 && image.channels == 3) {
    const ScaledSize small = ScaleToFit(image.width, image.height, options_.colour_side);
    decoded.thumbnail = ResizeImage(image, small.width, small.height);
  }
  const ScaledSize size = ScaleToFit(image.width, image.height, options_.decode.max_side_px);
  decoded.scale = size.scale;
  if (size.scale < 1) decoded.image = ResizeImage(decoded.image, size.width, size.height);
  if (timings != nullptr) timings->decode_ms = watch.LapMs();
  return Extract(decoded, threads, timings, role);
}

Features FeatureExtractor::Extract(Bytes encoded, int threads, ExtractionTimings* timings,
                                   ImageRole role) const {
  Stopwatch watch;
  const DecodedImage decoded = Decode(encoded);
  if (timings != nullptr) timings->decode_ms = watch.LapMs();
  return Extract(decoded, threads, timings, role);
}

Features FeatureExtractor::Extract(const DecodedImage& decoded, int threads,
                                   ExtractionTimings* timings, ImageRole role) const {
  return Extract(decoded, {}, threads, timings, role);
}

Features FeatureExtractor::ExtractPart(Bytes encoded, const Region& part, int threads,
                                       ExtractionTimings* timings) const {
  Stopwatch watch;
  const auto view =
      DecodePart(encoded, part, options_.decode.max_side_px, options_.decoder, options_.decode);
  if (timings != nullptr) timings->decode_ms = watch.LapMs();
  if (!view) {
    Features none{.keypoints = {}, .descriptors = {}, .model_id = descriptor_->info().model_id};
    // Not ReadImageHeader: no byte from outside is read where the decoder is not.
    const DecodedImage whole = options_.decoder(encoded, options_.decode);
    none.width = whole.original_width;
    none.height = whole.original_height;
    return none;
  }
  Features features = Extract(view->decoded, view->inside, threads, timings, ImageRole::kQuery);
  Shift(&features.keypoints, view->left, view->top);
  return features;
}

Features FeatureExtractor::Extract(const DecodedImage& decoded, const std::optional<Region>& inside,
                                   int threads, ExtractionTimings* timings, ImageRole role) const {
  Stopwatch watch;
  KeypointOptions keypoints = options_.keypoints;
  keypoints.inside = inside;
  Features features;
  features.width = decoded.original_width;
  features.height = decoded.original_height;
  features.model_id = descriptor_->info().model_id;
  features.colours = MakeColourGrid(decoded.thumbnail, options_.colour_side);
  if (options_.preview_side_px > 0 && !inside) {
    const ScaledSize small =
        ScaleToFit(decoded.image.width, decoded.image.height, options_.preview_side_px);
    features.preview =
        EncodeJpeg(ResizeImage(decoded.image, small.width, small.height), kPreviewQuality);
  }
  features.keypoints = options_.enlarge_below > 0
                           ? DetectLowContrastKeypoints(decoded.image, keypoints, threads)
                           : DetectKeypoints(decoded.image, keypoints, threads);
  if (options_.keep > 0) {
    KeepStrongAndSpread(static_cast<std::size_t>(options_.keep), &features.keypoints);
  }
  const auto enlarge_below = static_cast<std::size_t>(options_.enlarge_below);
  EnlargedKeypoints more;
  if (role == ImageRole::kQuery && features.keypoints.size() < enlarge_below) {
    more = DetectEnlarged(decoded.image, features.keypoints, options_.decode.max_side_px, keypoints,
                          threads);
    const std::size_t wanted = enlarge_below - features.keypoints.size();
    more.inside.resize(std::min(more.inside.size(), wanted));  // the strongest come first
    more.placed.resize(more.inside.size());
  }
  if (timings != nullptr) timings->detect_ms = watch.LapMs();
  features.descriptors =
      role == ImageRole::kReference
          ? descriptor_->DescribeReference(decoded.image, features.keypoints, threads)
          : descriptor_->DescribeFine(decoded.image, features.keypoints, {&more, 1}, threads);
  features.keypoints.insert(features.keypoints.end(), more.placed.begin(), more.placed.end());
  if (timings != nullptr) timings->describe_ms = watch.LapMs();
  ScaleToOriginal(features.keypoints, decoded.scale);
  return features;
}

Features FeatureExtractor::ExtractMirrored(Bytes encoded, int threads,
                                           ExtractionTimings* timings) const {
  Stopwatch watch;
  DecodedImage decoded = Decode(encoded);
  decoded.image = MirrorImage(decoded.image);
  decoded.thumbnail = MirrorImage(decoded.thumbnail);
  if (timings != nullptr) timings->decode_ms = watch.LapMs();
  return Extract(decoded, threads, timings);
}

std::optional<Features> FeatureExtractor::ExtractSecondPass(Bytes encoded, const Features& known,
                                                            const std::optional<Region>& part,
                                                            int threads,
                                                            ExtractionTimings* timings) const {
  if (options_.enlarge_below == 0) return {};
  const Region looked_at = part ? *part : FrameOf(known.width, known.height);
  const double longer_side = LongerSide(looked_at, known.width, known.height);
  if (longer_side == 0) return {};
  const auto side = SecondPassSide(longer_side, options_.decode.max_side_px);
  if (!side) return {};
  Stopwatch watch;
  DecodeOptions decode = options_.decode;
  decode.max_side_px = *side;
  decode.thumbnail_side_px = 0;
  const auto view = DecodePart(encoded, looked_at, *side, options_.decoder, decode);
  if (!view) return {};
  const double decode_ms = watch.LapMs();

  KeypointOptions keypoints = options_.keypoints;
  keypoints.max_keypoints = std::min(kSecondPassKeypoints * keypoints.max_keypoints, kMaxKeypoints);
  if (part) keypoints.inside = view->inside;
  std::vector<Keypoint> known_here = known.keypoints;
  Shift(&known_here, -view->left, -view->top);
  const Image& image = view->decoded.image;
  const double scale = view->decoded.scale;
  ScaleToOriginal(known_here, 1 / scale);  // to pixels of `image`
  auto strips = DetectAtHighResolution(
      image, known_here, std::max(1.0, *side / (longer_side * scale)), keypoints, threads);
  const double detect_ms = watch.LapMs();
  const ScaledSize usual = ScaleToFit(image.width, image.height, options_.decode.max_side_px);
  for (EnlargedKeypoints& more : strips) ScaleToOriginal(more.placed, 1 / usual.scale);
  Features features = known;
  features.descriptors.Append(descriptor_->DescribeFine(
      ResizeImage(image, usual.width, usual.height), {}, strips, threads));
  for (EnlargedKeypoints& more : strips) {
    ScaleToOriginal(more.placed, scale * usual.scale);
    Shift(&more.placed, view->left, view->top);
    features.keypoints.insert(features.keypoints.end(), more.placed.begin(), more.placed.end());
  }
  if (timings != nullptr) {
    timings->decode_ms += decode_ms;
    timings->detect_ms += detect_ms;
    timings->describe_ms += watch.LapMs();
  }
  return features;
}

}  // namespace pliant
