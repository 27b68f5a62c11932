// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// How well searches of a collection will work: simulated photos of its own images are the
// queries, once as the collection is, and once without the photographed object.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <stop_token>
#include <string>
#include <vector>

#include "descriptor/image/image.h"
#include "index/engine/engine.h"

namespace pliant {

struct SelfTestOptions {
  std::string collection = kDefaultCollection;
  // Photos, 1 to 10 000: of one image of each object in random order, then again.
  int pictures = 100;
  // Highest share of photos of absent objects that may be found, above 0 and below 1. Needs
  // 1 / false_alarms - 1 photos or more.
  double false_alarms = 0.01;
  std::uint64_t seed = 1;
  ImageDecoder decode = DecodeImage;  // of the stored files
  int threads = 0;                    // photos at a time; 0 = all cores
  std::stop_token stop = {};
  std::function<void(std::uint64_t done, std::uint64_t total)> progress = {};  // from any thread
};

enum class SelfTestVerdict {
  kFound,    // the photographed object is found
  kPerhaps,  // it is perhaps one of the first three hits
  kMissed,
  kWrong,  // another object is found
};

// The photo of one image, and the answers.
struct SelfTestPhoto {
  std::string image_id;
  std::string object;
  double strength = 0;  // of the deformation, 0 to 1
  double share = 0;     // of the photo that shows the object, 0 to 1
  SelfTestVerdict verdict = SelfTestVerdict::kMissed;
  bool false_alarm = false;  // something is found although the object is taken out
  // Probability of the photographed object; 0 = no hit among the first three.
  double probability = 0;
  // Largest probability when the object is taken out, and the object and image that has it.
  double absent_probability = 0;
  std::string other;
  std::string other_image;
  std::vector<std::uint8_t> thumbnail;  // JPEG
};

// Two objects that searches confuse.
struct SimilarObjects {
  std::string object, image_id;
  std::string other, other_image;
  int confused = 0;  // photos of one in which the other was found
};

struct PlainImage {
  std::string image_id;
  std::string object;
  std::uint32_t keypoints = 0;
};

struct SelfTestReport {
  std::uint64_t images = 0;             // of the collection
  std::vector<SelfTestPhoto> photos;    // in a random order
  std::vector<SimilarObjects> similar;  // most confused first
  std::vector<PlainImage> plain;        // fewest keypoints first
  // From this probability on a hit should count as found, so that at most
  // SelfTestOptions::false_alarms of absent objects are.
  double found_from = kFoundProbability;
  bool reaches_rate = false;  // false: even the highest probability has more false alarms
  double seconds = 0;
};

// Reads the collection, changes nothing. The same collection, options and program give the same
// report but for the time. Throws Error: kInvalidArgument "option_out_of_range"; kNotFound
// "collection_not_found", "content_not_kept" if no image has a stored file; kConflict
// "no_images", "no_vocabulary"; kCancelled "cancelled".
SelfTestReport RunSelfTest(Engine& engine, const SelfTestOptions& options);

}  // namespace pliant
