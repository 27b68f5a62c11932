// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The common interface of DEAL and the baselines.
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "descriptor/features/features.h"
#include "descriptor/features/keypoints.h"
#include "descriptor/image/image.h"

namespace pliant {

struct EnlargedKeypoints;  // enlarged_keypoints.h

struct DescriptorInfo {
  std::string name;  // one of DescriptorNames()
  DescriptorKind kind = DescriptorKind::kFloat;
  int dim = 0;           // floats or bytes per descriptor
  std::string model_id;  // "deal:<first 16 hex digits of the weight file's SHA-256>", "sift:1", ...
};

// Describes given keypoints in a grey image. Implementations are immutable and thread-safe.
class Descriptor {
 public:
  virtual ~Descriptor() = default;

  virtual const DescriptorInfo& info() const = 0;

  // Row i of the result describes keypoints[i] (pixels of `grey`). `threads`: how many cores this
  // call may use, 0 = all. Throws kInvalidArgument for an image that is not grey.
  virtual Descriptors Describe(const Image& grey, std::span<const Keypoint> keypoints,
                               int threads) const = 0;

  // The same for an image that is described once and compared with many. This can take longer and
  // match better. The rows are comparable with those of Describe, and the model id is the same.
  virtual Descriptors DescribeReference(const Image& grey, std::span<const Keypoint> keypoints,
                                        int threads) const {
    return Describe(grey, keypoints, threads);
  }

  // Rows of Describe, then rows of the keypoints in `finer`, whose places are in pixels of `grey`.
  // They are described from their own images; DEAL takes their warps from `grey`.
  virtual Descriptors DescribeFine(const Image& grey, std::span<const Keypoint> keypoints,
                                   std::span<const EnlargedKeypoints> finer, int threads) const;
};

struct DescriptorOptions {
  std::filesystem::path model_path;  // weights for deal and its variants; ModelPath
};

// Names that MakeDescriptor knows, best first.
std::vector<std::string> DescriptorNames();

// Throws kInvalidArgument for an unknown name (the message lists the known ones), kNotFound or
// kCorrupt for the weight file.
std::shared_ptr<const Descriptor> MakeDescriptor(const std::string& name,
                                                 const DescriptorOptions& options = {});

// The weight file of DEAL, name "deal" or "deal-small": `given` or else $PLIANT_MODEL, which are a
// file (used whatever the name), or a folder that holds NAME.safetensors; else
// share/pliant/NAME.safetensors beside or above the running program, else the installed one. Throws
// kNotFound naming all paths searched.
std::filesystem::path ModelPath(const std::string& name, const std::filesystem::path& given = {});

struct ExtractionOptions {
  DecodeOptions decode;
  KeypointOptions keypoints;
  // Of an image with more keypoints at its own size, only so many are described
  // (KeepStrongAndSpread). 0: all.
  int keep = 0;
  // 0: off. Above 0, low-contrast keypoints are described too. An image with fewer keypoints than
  // this is also described enlarged (enlarged_keypoints.h), which adds the strongest keypoints up
  // to this number, and at most keypoints.max_keypoints. Not for references.
  int enlarge_below = 0;
  int colour_side = kColourGridSide;  // cells of Features::colours along the longer side; 0 = none
  int preview_side_px = 128;          // longer side of Features::preview, two kilobytes; 0 = none
  ImageDecoder decoder = DecodeImage;
};

// The purpose for which an image is described.
enum class ImageRole {
  kQuery,      // compared now: Descriptor::Describe
  kReference,  // compared with many images: Descriptor::DescribeReference
};

// Wall-clock milliseconds of each stage.
struct ExtractionTimings {
  double decode_ms = 0;
  double detect_ms = 0;
  double describe_ms = 0;
};

// Encoded image to features: decode, detect, describe. Immutable and thread-safe.
class FeatureExtractor {
 public:
  FeatureExtractor(std::shared_ptr<const Descriptor> descriptor, ExtractionOptions options);

  const Descriptor& descriptor() const { return *descriptor_; }
  const ExtractionOptions& options() const { return options_; }

  // Throws what DecodeImage throws. An image without keypoints gives features without rows.
  Features Extract(Bytes encoded, int threads, ExtractionTimings* timings = nullptr,
                   ImageRole role = ImageRole::kQuery) const;

  // Describes one part of the image, at up to the size of a whole image (DecodePart). Keypoints are
  // in pixels of the whole original. Size and colours are also those of the whole original. A part
  // outside the image gives features without rows.
  Features ExtractPart(Bytes encoded, const Region& part, int threads,
                       ExtractionTimings* timings = nullptr) const;

  // The first step: options().decoder with options().decode.
  DecodedImage Decode(Bytes encoded) const;

  // The same from the result of Decode, for callers that also need its other fields (the format).
  // Does not change `timings->decode_ms`.
  Features Extract(const DecodedImage& decoded, int threads, ExtractionTimings* timings = nullptr,
                   ImageRole role = ImageRole::kQuery) const;

  // The same from a decoded image, grey or colour, of any size, such as a frame of a video.
  Features ExtractFrom(const Image& image, int threads, ExtractionTimings* timings = nullptr,
                       ImageRole role = ImageRole::kQuery) const;

  // Of the mirrored image, in its pixels: x is the original's width - 1 - x.
  Features ExtractMirrored(Bytes encoded, int threads, ExtractionTimings* timings = nullptr) const;

  // The second pass at high resolution (SecondPassSide). Returns `known`, which this extractor made
  // of the same file and part, followed by the new features. They are at most 4 x
  // keypoints.max_keypoints, and at most 4096. Absent if a second pass cannot find more, or if
  // options().enlarge_below is 0. Throws what DecodeImage throws.
  std::optional<Features> ExtractSecondPass(Bytes encoded, const Features& known,
                                            const std::optional<Region>& part, int threads,
                                            ExtractionTimings* timings = nullptr) const;

 private:
  Features Extract(const DecodedImage& decoded, const std::optional<Region>& inside, int threads,
                   ExtractionTimings* timings, ImageRole role) const;

  std::shared_ptr<const Descriptor> descriptor_;
  ExtractionOptions options_;
};

}  // namespace pliant
